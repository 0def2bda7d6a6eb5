// Relative poses and essential matrices: E = [t]x R for x1 = R x0 + t, |t| = 1.
#pragma once

#include "geometry/camera.h"

namespace tv {

// A rigid motion x -> R x + t, as the estimators calculate with it: cam1_from_cam0 of a pair, with
// t of length 1, or cam_from_world of a camera before known points, with t in their unit. What is
// kept is a Rigid (pose/rigid.h); docs/decisions/0013-footprint.md says why there are both.
struct Pose {
  Mat3 R = Mat3::Identity();
  Vec3 t = Vec3::Zero();
};

Mat3 cross_matrix(const Vec3& v);
Mat3 essential_from_pose(const Pose& pose);

// exp([w]x) to first order and exactly a rotation (the unit quaternion (1, w/2), normalised): for
// steps of an optimiser, free of trigonometry.
Mat3 rotation_step(const Vec3& w);

// R with its rows made orthonormal by Gram-Schmidt. It removes the rounding errors that products of
// rotations accumulate.
Mat3 orthonormalised(const Mat3& R);
Mat3 orthonormal_product(const Mat3& A, const Mat3& B);  // of A B

// Whether every entry of R R' is within 1e-6 of that of I, and det R > 0.
bool is_rotation(const double R[9]);

// Two unit vectors perpendicular to the unit vector t and to each other: b1 = normalise(e_k x t), k
// the index of the smallest |t_k| (the lowest on a tie), and b2 = t x b1.
void tangent_basis(const Vec3& t, Vec3* b1, Vec3* b2);

// The rotation that turns by `angle_rad` about a unit axis.
Mat3 rotation_about(const Vec3& unit_axis, double angle_rad);

// R0, R1 and t such that E ~ [t]x R0 ~ [-t]x R1 (~: equal up to a positive factor), in closed form
// (B. K. P. Horn, "Recovering baseline and orientation from essential matrix", 1990). R0 and R1 are
// rotations only as exactly as E is an essential matrix: call orthonormalised for the one that is
// kept. False when E is zero, of rank one, or not finite.
bool decompose_essential(const Mat3& E, Mat3 R[2], Vec3* t);

// On which side of each camera two rays meet. depth0 and depth1, of which only the signs matter,
// are the numerators of the depths that minimise |d0 R f0 + t - d1 f1| (the normal equations of the
// midpoint; their denominator is positive), for rays of any length.
struct DepthSigns {
  double depth0, depth1;
  // Bounds of the squared changes of depth0 and depth1 when a ray turns by angle_rad.
  double tolerance0_sq, tolerance1_sq;
};
DepthSigns depth_signs(const Pose& pose, const Vec3& ray0, const Vec3& ray1, double angle_rad);

// +1 when the rays meet in front of both cameras, -1 when they meet behind at least one. 0 when a
// turn of one ray by the angle_rad of depth_signs could change the sign that decides: so little
// parallax is evidence for neither.
inline int depth_vote(const DepthSigns& d) {
  const bool clear0 = d.depth0 * d.depth0 > d.tolerance0_sq;
  const bool clear1 = d.depth1 * d.depth1 > d.tolerance1_sq;
  if ((clear0 && d.depth0 < 0) || (clear1 && d.depth1 < 0)) return -1;
  return clear0 && clear1 ? 1 : 0;
}

}  // namespace tv
