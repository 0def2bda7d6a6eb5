// twoview match A B: writes matches as CSV and as a picture; it needs no camera.

#include <CLI/App.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "pair/reconstruct_pair.h"
#include "pictures/pictures.h"
#include "report/tables.h"
#include "verbs/verbs.h"

namespace cli {
namespace {

constexpr unsigned kGroups = kFeature | kMatch | kEffort | kCommon;

struct Arguments {
  Common common;
  std::string image[2];
};

// The most matches on any rung: as many as the keypoints, at most 6.5 times those of rung 0.
size_t most_matches(const Options& options) {
  const auto most = static_cast<size_t>(options.feature.max_keypoints);
  return options.highest_rung() == 0 ? most : 7 * most;
}

nlohmann::ordered_json match_json(const Outcome& outcome, const Options& options, Session& session,
                                  uint64_t total_ns) {
  const tv_reconstruction& r = outcome.reconstruction;
  nlohmann::ordered_json json;
  for (int i = 0; i < 2; ++i) json["image" + std::to_string(i)] = outcome.picture[i].name;
  for (int i = 0; i < 2; ++i)
    json["image_size" + std::to_string(i)] = {outcome.picture[i].luma.cols,
                                              outcome.picture[i].luma.rows};
  json["masked_share"] = {masked_share(outcome.picture[0].mask),
                          masked_share(outcome.picture[1].mask)};
  json["num_keypoints"] = {r.num_keypoints[0], r.num_keypoints[1]};
  json["effort"] = r.effort;
  json["num_matches"] = r.num_matches;
  json["timings_ms"] = session.take_times(total_ns, false);
  json["timings_ms"]["rungs"] = rungs_json(r);
  json["context_bytes"] = session.context_bytes();
  json["options"] = options_json(options, kGroups);
  json["version"] = tv_version_string();
  json["kernels"] = session.kernels();
  return json;
}

int match(Arguments& a) {
  Common& common = a.common;
  common.options.settle();
  // There is no camera. Rows of matches.csv name keypoints where `detect` finds them.
  common.options.estimate.method = TV_SOLVER_SEVEN_POINT;
  common.options.align_matches = 0;
  Outcome outcome;
  Picture* const picture = outcome.picture;
  for (int i = 0; i < 2; ++i) {
    picture[i] = load_picture(a.image[i]);
    add_picture_mask(picture[i].name, picture[i], common);
    bring_to_size(picture[i], common);
  }
  OutputSet files(common.output);
  for (const std::string& image : a.image) files.keep(image);
  for (const std::string& mask : common.options.masks.files()) files.keep(mask);
  files.require_own({"match", {"matches.csv", "matches.png"}, {"matches.csv", "matches.png"}, {}});
  Session session(common.options);
  session.context(std::max(picture[0].luma.cols, picture[1].luma.cols),
                  std::max(picture[0].luma.rows, picture[1].luma.rows),
                  most_matches(common.options));
  uint64_t total_ns = 0;
  {
    const Stopwatch watch(!common.quiet, watch_text(common.options));
    // Without cameras a fundamental matrix or a homography decides whether to climb.
    total_ns = reconstruct_pair(session, common.options, outcome);
  }
  const tv_reconstruction& r = outcome.reconstruction;
  files.add("matches.csv", matches_csv(r.keypoints[0], r.keypoints[1], r.matches,
                                       static_cast<size_t>(r.num_matches)));
  files.add("matches.png",
            png_bytes(matches_picture(picture[0], picture[1], r.keypoints[0], r.keypoints[1],
                                      r.matches, r.num_matches, nullptr)));
  if (common.json) print(json_text(match_json(outcome, common.options, session, total_ns)));
  const std::string notes = common.note_lines();
  if (common.speaks()) {
    char text[160];
    std::snprintf(text, sizeof text, "%d matches of %d and %d keypoints in %.1f ms%s\n",
                  r.num_matches, r.num_keypoints[0], r.num_keypoints[1],
                  static_cast<double>(total_ns) * 1e-6,
                  r.effort == 0 ? "" : (", on rung " + std::to_string(r.effort)).c_str());
    print(notes + text +
          ("files        " + files.folder().string() + ": matches.csv matches.png\n"));
  }
  files.commit();
  return 0;
}

}  // namespace

void add_match(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      program.add_subcommand("match", "matches of two images, as CSV and as a picture");
  verb->add_option("A", a->image[0], "image 0")->required()->type_name("IMAGE");
  verb->add_option("B", a->image[1], "image 1")->required()->type_name("IMAGE");
  add_common(*verb, a->common, kGroups, "folder for matches.csv and matches.png");
  verb->final_callback([a, &run] { run = [a] { return match(*a); }; });
}

}  // namespace cli
