// twoview match A B: writes matches as CSV and as a picture; it needs no camera.

#include <cstdio>
#include <memory>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "pair/session.h"
#include "pictures/pictures.h"
#include "report/tables.h"
#include "verbs/verbs.h"

namespace cli {
namespace {

struct Arguments {
  Common common;
  std::string image[2];
};

int match(Arguments& a) {
  Common& common = a.common;
  common.options.settle();
  Picture picture[2];
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
  tv_context* context = session.context(std::max(picture[0].luma.cols, picture[1].luma.cols),
                                        std::max(picture[0].luma.rows, picture[1].luma.rows));
  auto watch = std::make_unique<Stopwatch>(!common.quiet, watch_text(common.options));
  const uint64_t start_ns = now_ns();
  const Features features[2] = {extract(context, picture[0], common.options),
                                extract(context, picture[1], common.options)};
  const std::vector<tv_correspondence> matches =
      match_features(context, features[0], features[1], common.options.match);
  const uint64_t total_ns = now_ns() - start_ns;
  watch.reset();
  const tv_keypoint *k0 = features[0].keypoints.data(), *k1 = features[1].keypoints.data();

  nlohmann::ordered_json json;
  for (int i = 0; i < 2; ++i) json["image" + std::to_string(i)] = picture[i].name;
  for (int i = 0; i < 2; ++i)
    json["image_size" + std::to_string(i)] = {picture[i].luma.cols, picture[i].luma.rows};
  json["masked_share"] = {masked_share(picture[0].mask), masked_share(picture[1].mask)};
  json["num_keypoints"] = {features[0].keypoints.size(), features[1].keypoints.size()};
  json["num_matches"] = matches.size();
  json["timings_ms"] = session.take_times(total_ns, false);
  json["context_bytes"] = session.context_bytes();
  json["options"] = options_json(common.options, kFeature | kMatch | kCommon);
  json["version"] = tv_version_string();
  json["kernels"] = session.kernels();

  files.add("matches.csv", matches_csv(k0, k1, matches.data(), matches.size()));
  files.add("matches.png", png_bytes(matches_picture(picture[0], picture[1], k0, k1, matches.data(),
                                                     static_cast<int>(matches.size()), nullptr)));
  if (common.json) print(json_text(json));
  const std::string notes = common.note_lines();
  if (common.speaks()) {
    char text[160];
    std::snprintf(text, sizeof text, "%zu matches of %zu and %zu keypoints in %.1f ms\n",
                  matches.size(), features[0].keypoints.size(), features[1].keypoints.size(),
                  static_cast<double>(total_ns) * 1e-6);
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
  add_common(*verb, a->common, kFeature | kMatch | kCommon,
             "folder for matches.csv and matches.png");
  verb->final_callback([a, &run] { run = [a] { return match(*a); }; });
}

}  // namespace cli
