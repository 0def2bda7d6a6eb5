// twoview drone: how its verbs are added.
#pragma once

#include "base/cli_fwd.h"
#include "verbs/common.h"

namespace cli {

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
