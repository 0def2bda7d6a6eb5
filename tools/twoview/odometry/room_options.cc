#include "odometry/room_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/terminal.h"
#include "pair/options.h"
#include "room_model/room_files.h"

namespace cli {
namespace {

namespace fs = std::filesystem;

// The names of the depth maps that lie in a folder: five digits or more, ".png".
std::vector<std::string> depth_names(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string stem = entry.path().stem().string();
    if (entry.path().extension() == ".png" && stem.size() >= 5 &&
        std::all_of(stem.begin(), stem.end(), [](char c) { return c >= '0' && c <= '9'; }))
      names.push_back(entry.path().filename().string());
  }
  return names;
}

}  // namespace

std::vector<CLI::Option*> add_room_options(CLI::App& verb, RoomSettings& settings,
                                           RoomTruthOptions& truth) {
  constexpr int kMostMiB = 65536;
  CLI::Option* voxel =
      add_number(verb, "voxel", &settings.voxel, 1e-6, 1e6,
                 "side of a voxel in the unit of the path; without: from the scene");
  voxel->default_str("");
  CLI::Option* memory = add_number(verb, "max-memory", &settings.max_memory_mib, 1, kMostMiB,
                                   "MiB for the room; where it is full, voxels get coarser");
  CLI::Option* measured =
      verb.add_flag("--measured-only", settings.measured_only,
                    "only what was measured: planes are not carried across plain walls");
  CLI::Option* depth = verb.add_flag("--depth-maps", settings.keeps_depth_maps,
                                     "write the keyframes' depth maps to depth/, 16 bits");
  std::vector<CLI::Option*> added = {voxel, memory, measured, depth};
  for (CLI::Option* option : add_truth_options(verb, truth)) added.push_back(option);
  return added;
}

nlohmann::ordered_json room_options_json(const RoomSettings& settings,
                                         const RoomTruthOptions& truth) {
  nlohmann::ordered_json json;
  json["voxel"] = nullptr;
  if (settings.voxel > 0) json["voxel"] = settings.voxel;
  json["max_memory"] = settings.max_memory_mib;
  json["measured_only"] = settings.measured_only;
  json["depth_maps"] = settings.keeps_depth_maps;
  json.update(truth_options_json(truth));
  return json;
}

void read_pictures_with_progress(FrameSource& source, const Masks& masks, const cv::Mat& still,
                                 RoomBuilder& builder, const std::atomic<bool>& stop, bool speaks,
                                 const std::function<void(const std::string&)>& after_keyframe) {
  const Progress line(speaks);
  size_t shown = 0;
  read_room_pictures(source, masks, still, builder, stop, [&] {
    if (builder.num_done() == shown) return;
    shown = builder.num_done();
    const std::string words = "room: " + std::to_string(shown) + " of " +
                              std::to_string(builder.num_keyframes()) + " keyframes";
    line.tell(words);
    if (after_keyframe) after_keyframe(words);
  });
}

RoomModel finish_with_progress(RoomBuilder& builder, bool speaks) {
  const Stopwatch watch(speaks, "room: the surface");
  return builder.finish();
}

void add_truth(const std::function<TrueSurface()>& surface, const RoomScene& scene,
               RoomModel& model, bool speaks, Common& common) {
  const Stopwatch watch(speaks, "room: comparing with the true surface");
  try {
    model.truth = compared(scene, model, surface());
  } catch (const BadInput& e) {
    common.note(std::string("no comparison with the truth: ") + e.what());
  }
}

std::vector<std::string> room_notes(const RoomModel& model, bool was_stopped) {
  std::vector<std::string> notes;
  if (was_stopped) notes.emplace_back("interrupted: the room is of what had been read until then");
  if (model.voxel > 1.5 * model.first_voxel) {
    char text[120];
    std::snprintf(text, sizeof text,
                  "the room's memory was full: voxels became %.3g instead of %.3g (--max-memory)",
                  model.voxel, model.first_voxel);
    notes.emplace_back(text);
  }
  if (model.inferred_without_memory > 0)
    notes.push_back("the room's memory was full: the plain walls of " +
                    std::to_string(model.inferred_without_memory) +
                    " keyframes were left out (--max-memory)");
  if (model.keyframes_used == 1)
    notes.emplace_back("one keyframe alone has a depth map: no other one confirms what it shows");
  if (model.pictures_missing > 0 && !was_stopped)
    notes.push_back(std::to_string(model.pictures_missing) +
                    " pictures that a depth map needs could not be read");
  return notes;
}

DepthFolder::DepthFolder(const fs::path& results, const RoomModel& model)
    : path_(results / "depth") {
  std::error_code error;
  if (model.depth_maps.empty() && depth_names(path_).empty()) return;
  files_.emplace(path_);
  add_depth_pictures(model, *files_);
}

void DepthFolder::commit() {
  if (!files_) return;
  files_->commit();
  files_->remove_others(depth_names(path_));
  std::error_code ignored;
  fs::remove(path_, ignored);  // only where it is empty
}

}  // namespace cli
