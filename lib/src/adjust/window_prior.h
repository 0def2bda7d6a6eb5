// The terms of a window's cost that do not come from observations: what is known of poses, of the
// direction of gravity and of distances between views, each with its Jacobian in the parameters
// (w, v) of a view, x -> exp([w]x) x + v. Derivations: docs/algorithms/window.md. Tests:
// test/unit/test_window.cc.
#pragma once

#include "pose/rigid.h"
#include "twoview/window.h"

namespace tv {

// cam_from_world, and the camera's centre.
struct WindowPose : Rigid {
  double centre[3];
};

inline void set_centre(WindowPose* pose) { centre_of(*pose, pose->centre); }

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
