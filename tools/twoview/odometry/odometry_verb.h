// twoview odometry, twoview map and twoview room: how the verbs are added. A program that is built
// without the library's odometry (TWOVIEW_ODOMETRY=OFF) does not have them; without the library's
// room or depth maps (TWOVIEW_ROOM=OFF, TWOVIEW_DENSE=OFF) it does not have the third.
#pragma once

#include "verbs/common.h"

namespace cli {

void add_odometry(CLI::App& program, Run& run);
void add_map(CLI::App& program, Run& run);
void add_room(CLI::App& program, Run& run);

}  // namespace cli
