// The homography of four matched rays, and the camera motions that a calibrated one allows.
#pragma once

#include "geometry/essential.h"

namespace tv {

// The homography f1 ~ H f0, of Frobenius norm 1, with the sign that sends all four rays in front
// (f1' H f0 > 0). False for a degenerate sample, or when no sign does.
bool homography_4pt(const Vec3 rays0[4], const Vec3 rays1[4], Mat3* H);

// A motion, and the plane normal . X = 1 in camera 0's frame, in units of the plane's distance from
// camera 0. In these units the baseline is baseline_over_depth long; pose.t itself has length 1.
struct PlanarPose {
  Pose pose;
  Vec3 normal = Vec3::Zero();      // unit vector; towards the plane, away from camera 0
  double baseline_over_depth = 0;  // |t| / distance of the plane from camera 0
};

// H ~ R + t n' / d with H's sign as above (det H > 0 for a plane seen from one side). Writes the
// two motions, with the sign of the normal for which normal . mean_ray0 >= 0, and returns how many
// there are: 0 when H is a rotation (within rounding) or singular.
int decompose_homography(const Mat3& H, const Vec3& mean_ray0, PlanarPose poses[2]);

}  // namespace tv
