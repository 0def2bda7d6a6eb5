// The room among the files and the JSON of a verb.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/output.h"
#include "room_model/scene.h"

namespace cli {

// The files that a room may write, for OutputSet; and those of the folder depth/.
extern const std::vector<std::string> kRoomFiles;

// The unit of the scene in words: "m", or "times the distance of the first two keyframes".
// Which part of the vertices no view measured.
double share_inferred(const RoomModel& model);
std::string unit_of(const RoomScene& scene);

// The key `room` of result.json.
nlohmann::ordered_json room_json(const RoomScene& scene, const RoomModel& model);

// Adds the room's files; none where there is no surface.
void add_room_files(const RoomScene& scene, const RoomModel& model, OutputSet& files);
// depth/NNNNN.png, 16 bits, of the depth maps that the model holds: NNNNN is the index of the frame
// in its source, and grey levels over depth_levels(model) are the distance along the optical axis.
void add_depth_pictures(const RoomModel& model, OutputSet& depth_files);
double depth_levels(const RoomModel& model);

// Lines of the summary.
std::string room_summary(const RoomScene& scene, const RoomModel& model);
// What was measured in each direction of the plan, and why the rest is missing: sentences without
// an end, in the order of Direction.
std::vector<std::string> direction_words(const RoomModel& model);
// Why parts of the room are missing, the most frequent first, as sentences without an end.
std::vector<std::string> missing_words(const RoomModel& model);

}  // namespace cli
