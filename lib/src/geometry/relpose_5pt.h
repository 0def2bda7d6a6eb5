// Essential matrices from five matched rays.
#pragma once

#include "geometry/camera.h"

namespace tv {

inline constexpr int kMaxRelpose5pt = 10;

// rays0, rays1: five each, of any positive length. essentials: room for kMaxRelpose5pt, Frobenius
// norm 1, either sign. Returns how many there are; 0 for a degenerate sample.
int relpose_5pt(const Vec3 rays0[5], const Vec3 rays1[5], Mat3 essentials[kMaxRelpose5pt]);

}  // namespace tv
