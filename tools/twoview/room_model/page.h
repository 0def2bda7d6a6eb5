// The room in a report: a viewer of the surface, the plan, and why parts are missing.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "room_model/scene.h"

namespace cli {

// A section about the room for a page, and the scripts that follow it. Of a room without a surface
// the section has words alone.
struct RoomSection {
  std::string html, script;
};
RoomSection room_section(const RoomScene& scene, const RoomModel& model);

// A page of the room alone. json: the content of result.json.
std::string room_report(const RoomScene& scene, const RoomModel& model, const std::string& name,
                        const std::vector<std::string>& notes, const nlohmann::ordered_json& json);

}  // namespace cli
