// Relative poses from three matched rays and the direction of gravity in both views.
#pragma once

#include "geometry/essential.h"

namespace tv {

inline constexpr int kMaxRelposeUpright3pt = 4;

// The rotation from the camera's frame into one whose z axis is the unit vector `down`, the
// direction of gravity in the camera's frame.
Mat3 level_from_camera(const Vec3& down);

// Finds the poses of three matches with known gravity. rays0, rays1: three rays each, of any
// positive length; level0, level1: level_from_camera of each view. poses has room for
// kMaxRelposeUpright3pt; R maps the gravity of view 0 onto that of view 1, and t is a unit vector
// of either sign. Returns the number of poses; 0 for a degenerate sample.
int relpose_upright_3pt(const Vec3 rays0[3], const Vec3 rays1[3], const Mat3& level0,
                        const Mat3& level1, Pose poses[kMaxRelposeUpright3pt]);

}  // namespace tv
