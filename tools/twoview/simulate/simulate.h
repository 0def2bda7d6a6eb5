// twoview drone simulate, the one verb that needs the simulator (tools/simulator and tools/room).
#pragma once

#include "verbs/common.h"

namespace cli {

void add_drone_simulate(CLI::App& drone, Run& run);

}  // namespace cli
