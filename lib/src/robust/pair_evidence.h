// What was measured of a pair: all that the verdict and the probability of a wrong pose are decided
// from. robust/evidence.h measures it.
#pragma once

#include "base/math.h"
#include "twoview/two_view.h"

namespace tv {

inline constexpr double kUnknown = __builtin_inf();

// What was measured of a pair. An array of two has one entry a view.
struct Evidence {
  tv_kind kind = TV_KIND_DEGENERATE;
  double threshold_px = 0;
  int num_trials = 1;  // attempts at this pair, this one included
  // Usable matches and inliers; `different` ones do not count the repeats of a match.
  int num_matches = 0, num_inliers = 0, num_different = 0, num_different_inliers = 0;
  double coverage[2] = {0, 0};  // share of an 8x8 grid on the image that holds an inlier
  int num_places[2] = {0, 0};   // cells of about 32 pixels that hold an inlier
  double agreement = 0;         // share of the matches that are inliers, weighted by (1 - ratio)^2
  // Calibrated kinds but the degenerate one. Whether matches far from the pair's model have a model
  // of their own (second_model.h), and how far the points lie as on a lattice (lattice.h).
  bool has_second_model = false;
  bool has_opposite_motion = false;  // matches agree on the opposite direction (a full pose)
  double lattice_share[2] = {0, 0}, lattice_sigmas[2] = {0, 0};
  // The fields from here on are measured of a full pose (calibrated or planar).
  bool has_alternative = false;  // whether a second motion of the plane fits
  double noise_px = 0;           // noise of a matched pixel; 0 where there is no covariance
  double sigma_rad = kUnknown;   // the largest standard deviation of rotation and direction
  // The stated standard deviation of the direction, without what the calibration adds to it.
  double direction_sigma_rad = kUnknown;
  // By how much the direction would move with cameras that the matches do not contradict; 0 where
  // they do not contradict the given ones (camera_misfit.h).
  double misfit_direction_rad = 0;
  double median_parallax_rad = 0;  // median parallax of the inliers
  double pixel_angle_rad = 0;      // the parallax that a pixel of noise in both images makes
  // By how much the rotation turns when the inliers of one region are left out; at most kPi.
  double region_shift_rad = kPi;
  // For each image, the root mean square distance in pixels of the inliers from the one line that
  // is fitted to all of them (in rays: from a plane through the camera's centre).
  double line_distance_px[2] = {kUnknown, kUnknown};
};

}  // namespace tv
