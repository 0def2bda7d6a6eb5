// A caller's matches, made ready for the robust loop: sorted, repeated ones last, and with rays,
// which can be computed again for a moved principal point.
#pragma once

#include "base/arena.h"
#include "geometry/ray_pairs.h"
#include "twoview/two_view.h"

namespace tv {

struct TwoViewProblem {
  bool calibrated;
  bool one_camera;          // whether both views are of the same camera
  Camera camera[2];         // valid for calibrated views only
  const double* pixels[2];  // num x 2
  const float* ratios;      // null when the matches have no ratios
  const float* sigmas[2];   // tv_pixel_pairs.sigmas0 and sigmas1; null: 1 for all
  int num;
  const uint8_t* is_still;  // null, or of each match whether it is left out (robust/still.h)
  tv_estimate_options options;
  double focal_log_scale;   // logarithm of the cameras' focal length over the given one
  bool focal_is_ambiguous;  // whether two directions of motion fit, each at its own focal length
  const tvk_geometry_table* kernels;  // null: the kernels of the base ISA
  double sigma(int view, int32_t i) const { return sigma_at(sigmas[view], i); }
};

struct Matches {
  // pairs.num is num_unique(): the matches that differ from each other, by which models are
  // searched, refined and tested. The arrays of pairs, and order, have num_all entries: the
  // different matches, then those that repeat one of them. Repeats count in the numbers of matches
  // and inliers that are reported, and nowhere else.
  RayPairs pairs = {};
  int num_all = 0;
  int num_unique() const { return pairs.num; }
  int32_t* order = nullptr;                     // match k of `pairs` is the caller's match order[k]
  const float* sigmas[2] = {nullptr, nullptr};  // those of the problem
  double sigma(int view, int k) const { return sigma_at(sigmas[view], order[k]); }
  double sigma_sq(int k) const;  // the mean of its two sigmas' squares
  // For each view, the map from the plane of the rays to undistorted pixels: K of the camera, or,
  // for uncalibrated views, K of the pinhole that normalises the points.
  Mat3 intrinsics[2];
  double area_px = 1;  // area of image 1 or, uncalibrated, of the box around its points, px^2
};

size_t matches_bytes(int max_matches);

// Drops what is not finite or outside the lens model, sorts by (ratio, coordinates), and puts
// repeated matches last: a match that is given five times is evidence once, with the least sigmas
// that were given for it. Each Jacobian is multiplied by its pixel's sigma, so that every residual
// of the match, and all that is computed from residuals, is in units of its sigmas.
void prepare_matches(const TwoViewProblem& problem, Arena& arena, Matches* matches);

// The second derivative d^2 ray / d pixel^2 of the k-th match in a view of that camera, 3 x (xx,
// xy, yy), times the pixel's sigma as the Jacobian. False, and nothing is written, for a pinhole on
// the plane, where the derivative is 0.
bool ray_curvature(const TwoViewProblem& problem, const Matches& matches, const Camera& camera,
                   int view, int k, double curvature[9]);

// The means of s and s^2 over the different matches, s^2 = sigma_sq. The band or the disc in which
// a wrong match agrees with a model by chance is s times as wide as for sigmas of 1.
struct SigmaMeans {
  double s, s_sq;
};
SigmaMeans sigma_means(const Matches& matches);

// The camera of a view with its principal point moved by shift_px.
Camera moved_camera(const TwoViewProblem& problem, int view, const double shift_px[2]);

// Computes the rays again, for cameras whose principal points lie shift_px beside those of the
// problem. A match for which such a camera has no ray keeps its previous one.
void move_principal_points(const TwoViewProblem& problem, const double shift_px[2],
                           Matches* matches);

}  // namespace tv
