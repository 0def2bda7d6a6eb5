// twoview odometry: how its verb is added. A program that is built without the library's odometry
// (TWOVIEW_ODOMETRY=OFF) does not have it.
#pragma once

#include "verbs/common.h"

namespace cli {

void add_odometry(CLI::App& program, Run& run);

}  // namespace cli
