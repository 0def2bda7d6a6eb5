// What `twoview room` and `twoview odometry --room` have in common: options, progress, notes.
#pragma once

#include <atomic>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/cli_fwd.h"
#include "base/output.h"
#include "odometry/frames.h"
#include "odometry/room_source.h"
#include "odometry/room_truth.h"
#include "room_model/builder.h"
#include "verbs/common.h"

namespace cli {

// Adds --voxel, --max-memory, --measured-only, --depth-maps and the options of the truth. Returns
// the options that were added.
std::vector<CLI::Option*> add_room_options(CLI::App& verb, RoomSettings& settings,
                                           RoomTruthOptions& truth);
nlohmann::ordered_json room_options_json(const RoomSettings& settings,
                                         const RoomTruthOptions& truth);

// read_room_pictures with a progress line on a terminal; `after_keyframe` gets the same words and
// may be empty.
void read_pictures_with_progress(FrameSource& source, const Masks& masks, const cv::Mat& still,
                                 RoomBuilder& builder, const std::atomic<bool>& stop, bool speaks,
                                 const std::function<void(const std::string&)>& after_keyframe);
RoomModel finish_with_progress(RoomBuilder& builder, bool speaks);

// Compares the model with the true surface. What goes wrong with that is noted, and the room's
// results are written all the same.
void add_truth(const std::function<TrueSurface()>& surface, const RoomScene& scene,
               RoomModel& model, bool speaks, Common& common);

// What the user must know of the model, as lines without an end.
std::vector<std::string> room_notes(const RoomModel& model, bool was_stopped);

// The folder depth/ of the results, with the model's depth maps; without any, those of an earlier
// run are removed.
class DepthFolder {
 public:
  DepthFolder(const std::filesystem::path& results, const RoomModel& model);
  void commit();

 private:
  std::filesystem::path path_;
  std::optional<OutputSet> files_;
};

}  // namespace cli
