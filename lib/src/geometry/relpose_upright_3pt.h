// Relative poses from three matched rays and the direction of gravity in both views.
#pragma once

#include "geometry/essential.h"

namespace tv {

inline constexpr int kMaxRelposeUpright3pt = 4;

// The rotation into a frame whose z axis is the unit vector `down`.
Mat3 level_from_camera(const Vec3& down);

// rays0, rays1: three each, of any positive length; level0, level1: level_from_camera of each view.
// poses: room for kMaxRelposeUpright3pt; R maps one gravity onto the other, t is unit, of either
// sign. Returns how many there are; 0 for a degenerate sample.
int relpose_upright_3pt(const Vec3 rays0[3], const Vec3 rays1[3], const Mat3& level0,
                        const Mat3& level1, Pose poses[kMaxRelposeUpright3pt]);

}  // namespace tv
