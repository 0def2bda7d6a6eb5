// The homography of four matched rays, and the camera motions that a calibrated one allows.
#pragma once

#include "geometry/essential.h"

namespace tv {

// f1 ~ H f0, Frobenius norm 1, with the sign that sends all four rays in front (f1' H f0 > 0).
// False for a degenerate sample, or when no sign does.
bool homography_4pt(const Vec3 rays0[4], const Vec3 rays1[4], Mat3* H);

// A plane n' X = 1 (camera 0's frame, in units in which |t| = 1 / baseline_per_depth).
struct PlanarPose {
  Pose pose;
  Vec3 normal = Vec3::Zero();      // unit; towards the plane, away from camera 0
  double baseline_over_depth = 0;  // |t| / distance of the plane from camera 0
};

// H ~ R + t n' / d with H's sign as above (det H > 0 for a plane seen from one side). Writes the
// two motions whose normals look away from the camera at `mean_ray0`'s side; returns 0 when H is a
// rotation (within rounding) or singular.
int decompose_homography(const Mat3& H, const Vec3& mean_ray0, PlanarPose poses[2]);

}  // namespace tv
