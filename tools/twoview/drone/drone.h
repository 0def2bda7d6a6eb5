// twoview drone: how its verbs are added, and the options that they share.
#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <string>

#include "verbs/common.h"

namespace cli {

// The address of a drone: the options --host and a port for each channel.
struct DroneAddress {
  std::string host;
  int at_port = 5556, navdata_port = 5554, video_port = 5555, control_port = 5559;
};
void add_address(CLI::App& verb, DroneAddress& address, const std::string& host);
// Adds the ports alone, for a verb that has another option for the host.
void add_ports(CLI::App& verb, DroneAddress& address);

// A range check like CLI::Range that also refuses "nan".
CLI::Validator number_in(double low, double high);

// Adds --duration: the verb ends by itself after this number of seconds; 0 means no limit.
void add_duration(CLI::App& verb, double& seconds);

// A function that adds a verb to the command `drone`; `run` receives the work of the chosen verb.
using AddDroneVerb = void (*)(CLI::App& drone, Run& run);

// Adds `drone` with its verbs. `add_simulate` adds the verb that needs the simulator; pass null in
// a program that is built without the simulator.
void add_drone(CLI::App& program, Run& run, AddDroneVerb add_simulate);

void add_drone_info(CLI::App& drone, Run& run);
void add_drone_record(CLI::App& drone, Run& run);
void add_drone_replay(CLI::App& drone, Run& run);
void add_drone_fly(CLI::App& drone, Run& run);

}  // namespace cli
