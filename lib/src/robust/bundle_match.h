// One match of a bundle adjustment of two views: its point, the linearised projections of it, and
// the elimination of the point, which leaves one residual for the pose. Derivations:
// docs/algorithms/bundle.md. Tests: test/unit/test_bundle.cc, against differences and a QR.
#pragma once

#include "geometry/essential.h"
#include "geometry/ray_pairs.h"
#include "twoview/bundle.h"

namespace tv {

struct BundleProblem {
  Camera camera[2];
  const double* pixels[2];  // num x 2
  const float* sigmas[2];   // num each; null: 1 for all
  int num;
  tv_bundle_options options;
};

inline Vec2 pixel_of(const BundleProblem& problem, int view, int i) {
  return Vec2(problem.pixels[view][2 * i], problem.pixels[view][2 * i + 1]);
}
inline double sigma_of(const BundleProblem& problem, int view, int i) {
  return sigma_at(problem.sigmas[view], i);
}

// The pose at which matches are linearised: t has unit length, and b1, b2 span the plane across it.
struct BundleFrame {
  Mat3 R;
  Vec3 t, b1, b2;
};
BundleFrame bundle_frame(const Pose& pose);

inline constexpr double kMaxInverseDistance = 1e6;

// A point as a unit direction from camera 0 and the inverse of its distance, in baselines. This is
// smooth through infinity, where the inverse distance is 0, and beyond.
struct BundlePoint {
  double direction[3];
  double inverse_distance;
};

// Reads a point whose position is in units of `baseline`. False for a point without a place or
// direction, or nearer to camera 0 than 1 / kMaxInverseDistance baselines.
bool read_point(const tv_point& point, double baseline, BundlePoint* out);

// The point after a step: along the two vectors of sphere_basis, and in inverse distance. It is a
// step of the homogeneous point (direction, inverse distance).
BundlePoint moved_point(const BundlePoint& point, const double move[3]);

// A point, the errors of its projections, and how the projections move with it. Pixels are in units
// of the sigma of the match's pixel in that image.
struct BundleMatch {
  BundlePoint point;
  double error[2][2];        // projection - pixel in each image, pixels
  double from_pixel0[2][2];  // turns pixels of image 0 into steps along sphere_basis
  double jacobian1[2][3];    // d pixel 1 / d point in camera 1
};

// Returns false where a camera does not see the point.
bool linearise(const Camera cameras[2], const BundleFrame& frame, const BundlePoint& point,
               const Vec2& pixel0, const Vec2& pixel1, BundleMatch* match);
// The same for the problem's i-th match, with its sigmas; linearise above takes them as 1.
bool linearise(const BundleProblem& problem, const BundleFrame& frame, const BundlePoint& point,
               int32_t i, BundleMatch* match);

// The squared error of both projections, px^2 in units of the sigmas.
double error_sq(const BundleMatch& match);

// The match with its point eliminated: to first order, the least error over all points is, for a
// given pose, one signed distance r (Sampson's, about the present point), and the Schur complement
// of the match's block is a a', a = dr / dpose.
struct Elimination {
  double r;
  double a[5];      // derivatives of r by the pose parameters (w, a, b) of PoseModel
  double B[2][2];   // d pixel 1 / d direction
  double along[2];  // unit vector: how the projection in image 1 moves with the inverse distance
  double length;    // speed of the projection along this vector; 0 for a point on the baseline
  double k[2];      // the part of the residual across `along` that image 0 can take
};
Elimination eliminate(const BundleFrame& frame, const BundleMatch& match);

// How a point moves when the pose moves by `step`: the least squares of the linearised match, as a
// step for moved_point.
void linear_step(const BundleFrame& frame, const BundleMatch& match, const Elimination& e,
                 const double step[5], double move[3]);

// Two unit vectors that span the plane across a unit direction.
void sphere_basis(const double direction[3], double e1[3], double e2[3]);

}  // namespace tv
