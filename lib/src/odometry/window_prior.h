// The terms of a window's cost that do not come from observations: what is known of poses, of the
// direction of gravity and of distances between views, each with its Jacobian in the parameters
// (w, v) of a view, x -> exp([w]x) x + v. Derivations: docs/algorithms/window.md. Tests:
// test/unit/test_window.cc.
#pragma once

#include "geometry/vector3.h"
#include "odometry/block_cholesky.h"
#include "twoview/window.h"

namespace tv {

// cam_from_world, and the camera's centre -R't, in plain arrays: the arena and the loops over
// observations take them.
struct WindowPose {
  double R[9], t[3], centre[3];
};

inline void to_camera(const WindowPose& pose, const double X[3], double x[3]) {
#if !defined(__OPTIMIZE_SIZE__)
#pragma GCC unroll 3  // 7 per cent of an adjustment's time
#endif
  for (int i = 0; i < 3; ++i) {
    const double* row = pose.R + 3 * i;
    x[i] = ((row[0] * X[0] + row[1] * X[1]) + row[2] * X[2]) + pose.t[i];
  }
}

inline void set_centre(WindowPose* pose) {
  rotate_back(pose->R, pose->t, pose->centre);
  for (int i = 0; i < 3; ++i) pose->centre[i] = -pose->centre[i];
}

WindowPose stepped(const WindowPose& pose, const double step[6]);

// A term of the cost, quadratic to first order: `cost`, half its gradient by the parameters of one
// or two views, and half its Hessian, of which H[a][b] is the block of the views a and b <= a.
struct PriorTerm {
  double cost;
  double gradient[2][6];
  double H[2][2][36];
};

void pose_term(const tv_pose_prior& prior, const WindowPose& pose, PriorTerm* term);
void gravity_term(const tv_gravity_prior& prior, const double world_down[3], const WindowPose& pose,
                  PriorTerm* term);
void distance_term(const tv_distance_prior& prior, const WindowPose& pose0, const WindowPose& pose1,
                   PriorTerm* term);

}  // namespace tv
