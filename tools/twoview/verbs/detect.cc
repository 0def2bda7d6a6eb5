// twoview detect IMAGE: writes keypoints as CSV and as a picture.

#include <CLI/App.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

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
  std::string image;
};

int detect(Arguments& a) {
  Common& common = a.common;
  common.options.settle();
  Picture picture = load_picture(a.image);
  add_picture_mask(picture.name, picture, common);
  bring_to_size(picture, common);
  OutputSet files(common.output);
  files.keep(a.image);
  for (const std::string& mask : common.options.masks.files()) files.keep(mask);
  files.require_own({"detect", {"keypoints.csv", "keypoints.png"}, {"keypoints.csv"}, {}});
  Session session(common.options);
  tv_context* context = session.context(picture.luma.cols, picture.luma.rows);
  auto watch = std::make_unique<Stopwatch>(!common.quiet, watch_text(common.options));
  const uint64_t start_ns = now_ns();
  const Features features = extract(context, picture, common.options);
  const uint64_t total_ns = now_ns() - start_ns;
  watch.reset();

  nlohmann::ordered_json json;
  json["image"] = picture.name;
  json["image_size"] = {picture.luma.cols, picture.luma.rows};
  json["masked_share"] = masked_share(picture.mask);
  json["num_keypoints"] = features.keypoints.size();
  json["timings_ms"] = session.take_times(total_ns, false);
  json["context_bytes"] = session.context_bytes();
  json["options"] = options_json(common.options, kFeature | kCommon);
  json["version"] = tv_version_string();
  json["kernels"] = session.kernels();

  files.add("keypoints.csv", keypoints_csv(features.keypoints.data(), features.keypoints.size()));
  files.add("keypoints.png", png_bytes(keypoints_picture(picture, features.keypoints)));
  if (common.json) print(json_text(json));
  const std::string notes = common.note_lines();
  if (common.speaks()) {
    char text[128];
    std::snprintf(text, sizeof text, "%zu keypoints in %.1f ms\n", features.keypoints.size(),
                  static_cast<double>(total_ns) * 1e-6);
    print(notes + text +
          ("files        " + files.folder().string() + ": keypoints.csv keypoints.png\n"));
  }
  files.commit();
  return 0;
}

}  // namespace

void add_detect(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      program.add_subcommand("detect", "keypoints of an image, as CSV and as a picture");
  verb->add_option("IMAGE", a->image, "image")->required()->type_name("IMAGE");
  add_common(*verb, a->common, kFeature | kCommon, "folder for keypoints.csv and keypoints.png");
  verb->final_callback([a, &run] { run = [a] { return detect(*a); }; });
}

}  // namespace cli
