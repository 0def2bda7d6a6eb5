// twoview drone, and what its verbs share.
#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <string>

#include "verbs/common.h"

namespace cli {

// Where a drone is: --host and a port option for each channel.
struct DroneAddress {
  std::string host;
  int at_port = 5556, navdata_port = 5554, video_port = 5555, control_port = 5559;
};
void add_address(CLI::App& verb, DroneAddress& address, const std::string& host);

// As CLI::Range, but it refuses "nan" too.
CLI::Validator number_in(double low, double high);

// --duration: seconds until the verb ends by itself, 0 for no end.
void add_duration(CLI::App& verb, double& seconds);

// Adds a verb to `drone`.
using AddDroneVerb = void (*)(CLI::App& drone, Run& run);

// Adds `drone` with its verbs. `add_simulate` adds the verb that needs the simulator, which a
// program may be built without; it is then null.
void add_drone(CLI::App& program, Run& run, AddDroneVerb add_simulate);

void add_drone_info(CLI::App& drone, Run& run);
void add_drone_record(CLI::App& drone, Run& run);
void add_drone_replay(CLI::App& drone, Run& run);
void add_drone_fly(CLI::App& drone, Run& run);

}  // namespace cli
