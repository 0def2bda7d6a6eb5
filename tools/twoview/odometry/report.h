// Makes the report of a flight: one file that needs no other file and no network.
#pragma once

#include <string>

#include "odometry/outputs.h"

namespace cli {

// `name`: of the source, for the heading.
// room_html, room_script: a section on the room, and the scripts that it needs; may be empty.
std::string flight_report(const FlightResult& result, const std::string& name,
                          const std::string& room_html, const std::string& room_script);

}  // namespace cli
