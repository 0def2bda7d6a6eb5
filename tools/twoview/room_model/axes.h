// How a room lies: its axes along walls and upwards, its floor and its size.
#pragma once

#include "room_model/scene.h"

namespace cli {

// Fills axes, floor and size of a model by its surface, its planes and `up`.
void find_axes(RoomModel& model);

}  // namespace cli
