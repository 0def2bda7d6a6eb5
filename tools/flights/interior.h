// A furnished room made from a seed: its size, walls, furniture, things on the furniture, lamps.
#pragma once

#include <vector>

#include "flights/scene.h"

namespace flights {

struct Interior {
  std::vector<Box> boxes;  // boxes[0] is the room, centred on x = y = 0
  std::vector<Lamp> lamps;
  double half_x, half_y, height;  // of the room, metres
  Vec3 table;                     // the middle of the table's top
};

Interior furnished(uint64_t seed);

}  // namespace flights
