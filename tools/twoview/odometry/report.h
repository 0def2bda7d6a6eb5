// Makes the report of a flight: one file that needs no other file and no network.
#pragma once

#include <string>

#include "odometry/outputs.h"

namespace cli {

// `name`: of the source, for the heading.
std::string flight_report(const FlightResult& result, const std::string& name);

}  // namespace cli
