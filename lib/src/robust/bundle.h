// Bundle adjustment of two views, and the covariance of points. Derivations:
// docs/algorithms/bundle.md.
#pragma once

#include "base/arena.h"
#include "geometry/essential.h"
#include "twoview/bundle.h"

namespace tv {

struct BundleProblem {
  Camera camera[2];
  const double* pixels[2];  // num x 2
  int num;
  tv_bundle_options options;
};

// A pair of views about which matches are linearised: t has unit length, b1, b2 span what is
// across it.
struct BundleFrame {
  Mat3 R;
  Vec3 t, b1, b2;
};
BundleFrame bundle_frame(const Pose& pose);

// A point as a unit direction from camera 0 and the inverse of its distance, in baselines: smooth
// through infinity, where the inverse distance is 0, and beyond.
struct BundlePoint {
  double direction[3];
  double inverse_distance;
};

// A point, what its projections leave, and how they move with it.
struct BundleMatch {
  BundlePoint point;
  double error[2][2];        // of each image: projection - pixel
  double from_pixel0[2][2];  // pixels of image 0 to steps along sphere_basis
  double jacobian1[2][3];    // d pixel 1 / d point in camera 1
};

// False where a camera does not see the point.
bool linearise(const Camera cameras[2], const BundleFrame& frame, const BundlePoint& point,
               const Vec2& pixel0, const Vec2& pixel1, BundleMatch* match);

// The match with its point eliminated: to first order, the least error that the pose leaves is one
// signed distance r (Sampson's, about the present point), the Schur complement of the match's block
// is a a', a = dr / dpose.
struct Elimination {
  double r;
  double a[5];      // for the pose parameters (w, a, b)
  double B[2][2];   // d pixel 1 / d direction
  double along[2];  // unit: where the projection in image 1 goes with the inverse distance
  double length;    // and how fast; 0 for a point on the baseline
  double k[2];      // of the residual across `along`: the part that image 0 can take
};
Elimination eliminate(const BundleFrame& frame, const BundleMatch& match);

struct BundleOutcome {
  Pose pose;
  int num_points, num_iterations;
  bool moved;  // the pose is another than at the start
  bool converged, has_covariance;
  double initial_cost, final_cost, initial_sum_sq, final_sum_sq;
  double covariance[25];
  double noise_px;
};

// The arena that one adjustment takes.
size_t bundle_scratch_bytes(int max_points);

// points: in units of `baseline`, updated where they take part.
void adjust_two_view(const BundleProblem& problem, const Pose& start, double baseline, Arena& arena,
                     tv_point* points, BundleOutcome* outcome);

// Two unit vectors that span what is across a unit direction.
void sphere_basis(const double direction[3], double e1[3], double e2[3]);

// As tv_point_covariances for one point. False, and zeros, where it is not known.
bool point_covariance(const Camera cameras[2], const BundleFrame& frame, double baseline,
                      const double* pose_covariance, double noise_px, const tv_point& point,
                      double covariance[9]);

}  // namespace tv
