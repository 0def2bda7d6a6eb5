// twoview drone: communicates with an AR.Drone 2.0, or simulates one.

#include "drone/drone.h"

#include <CLI/App.hpp>

namespace cli {

void add_drone(CLI::App& program, Run& run, AddDroneVerb add_simulate) {
  CLI::App* drone = program.add_subcommand("drone", "talk to an AR.Drone 2.0, or be one");
  drone->require_subcommand(1);
  add_drone_info(*drone, run);
  add_drone_record(*drone, run);
  add_drone_replay(*drone, run);
  add_drone_fly(*drone, run);
  if (add_simulate != nullptr) add_simulate(*drone, run);
}

}  // namespace cli
