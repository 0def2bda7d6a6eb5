// twoview odometry and twoview map: how the verbs are added. A program that is built without the
// library's odometry (TWOVIEW_ODOMETRY=OFF) does not have them.
#pragma once

#include "verbs/common.h"

namespace cli {

void add_odometry(CLI::App& program, Run& run);
void add_map(CLI::App& program, Run& run);

}  // namespace cli
