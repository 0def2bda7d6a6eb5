// What was measured of a pose: all that the verdict and the probability of a wrong pose are decided
// from. Of a pair robust/evidence.h measures it, and the descriptors of its matches add to it
// (pipeline/rung.h); of a camera before known points pose/absolute_pose.h does.
#pragma once

#include "base/math.h"
#include "twoview/two_view.h"

namespace tv {

inline constexpr double kUnknown = __builtin_inf();

// What a pose stands on, whether a pair's or that of a camera before known points.
struct Support {
  double threshold_px = 0;
  double noise_px = 0;          // noise of a matched pixel; of a pair 0 without a covariance
  double sigma_rad = kUnknown;  // the largest standard deviation of the pose
  // Usable matches and inliers; `different` ones do not count the repeats of a match.
  int num_matches = 0, num_inliers = 0, num_different = 0, num_different_inliers = 0;
  bool has_alternative = false;  // whether a second pose fits about equally well
};

// What the matches say against the cameras as they were given (camera_misfit.h).
struct CameraMisfit {
  double chi2 = 0;  // 0 where it was not tested
  // By how much the pose would turn, and its direction move, with cameras that the matches do not
  // contradict; 0 where they do not contradict the given ones.
  double turn_rad = 0, direction_rad = 0;
  // The largest standard deviation of the rotation about an axis before the misfit was added to the
  // covariance; 0 where that function was not called.
  double given_turn_sigma_rad = 0;
};

// The test of a principal point that is where the calibration has it, and the shift with which the
// matches' residuals are least (principal_point.h); zeros where they do not determine it. Pixels.
struct PrincipalPointTest {
  double chi2 = 0;  // of two degrees of freedom: -2 log of the probability of as much evidence
  double asked_px[2] = {0, 0};
  double covariance[3] = {0, 0, 0};  // of asked_px: xx, xy, yy
};

// What was measured of a pair. An array of two has one entry a view. All of it is the same when the
// views are exchanged, but for the order of these entries.
struct Evidence : Support {
  tv_kind kind = TV_KIND_DEGENERATE;
  int num_trials = 1;           // attempts at this pair, this one included
  double coverage[2] = {0, 0};  // share of an 8x8 grid on the image that holds an inlier
  int num_places[2] = {0, 0};   // cells of about 32 pixels that hold an inlier
  double agreement = 0;         // share of the matches that are inliers, weighted by (1 - ratio)^2
  // The different inliers of each model; -1 where it was not estimated. They decide the kind.
  int essential_inliers = -1, fundamental_inliers = -1, homography_inliers = -1,
      rotation_inliers = -1;
  PrincipalPointTest principal_point;  // of one camera that saw both views
  // Calibrated kinds but the degenerate one. Whether matches far from the pair's model have a model
  // of their own (second_model.h), and how far the points lie as on a lattice (lattice.h).
  bool has_second_model = false;
  bool has_opposite_motion = false;  // matches agree on the opposite direction (a full pose)
  double lattice_share[2] = {0, 0}, lattice_sigmas[2] = {0, 0};
  // What the descriptors of the keypoints are evidence for, where they were examined: most inliers
  // have a second place that looks the same; and, measured only of a pair with nothing else against
  // it, more keypoints match when one picture is mirrored.
  bool looks_repeated = false, looks_mirrored = false;
  // The fields from here on are measured of a full pose (calibrated or planar), as are noise,
  // standard deviation and alternative, a second motion of the plane.
  // The stated standard deviation of the direction, without what the calibration adds to it.
  double direction_sigma_rad = kUnknown;
  CameraMisfit misfit;
  bool is_camera_assumed = false;  // its focal length is uncertain: nobody calibrated it
  // The relative standard deviation that is left of the focal length, of two cameras the larger
  // one.
  double focal_sigma = 0;
  double median_parallax_rad = 0;  // median parallax of the inliers
  double pixel_angle_rad = 0;      // the parallax that a pixel of noise in both images makes
  // By how much the rotation turns when the inliers of one region are left out; at most kPi.
  double region_shift_rad = kPi;
  // For each image, the root mean square distance in pixels of the inliers from the one line that
  // is fitted to all of them (in rays: from a plane through the camera's centre).
  double line_distance_px[2] = {kUnknown, kUnknown};
};

inline bool has_full_pose(const Evidence& e) {
  return e.kind == TV_KIND_CALIBRATED || e.kind == TV_KIND_PLANAR;
}

// What was measured of one camera's pose from points whose places are known.
struct AbsoluteEvidence : Support {
  bool has_pose = false;  // a pose has more inliers than chance explains
  // Of an attempt without a pose: the points of all matches lie on a line.
  bool is_on_line = false;
  double coverage = 0;  // share of an 8x8 grid on the image that holds an inlier
  double width_px = 0;  // root mean square width of the inliers' points, seen at their distance
};

}  // namespace tv
