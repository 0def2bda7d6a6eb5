/* twoview: the geometry of two views from matched pixels.

   Formulas, papers, the rules of the verdict, and tests: docs/algorithms/two_view.md,
   docs/algorithms/gravity.md, docs/algorithms/principal_point.md, docs/algorithms/camera_misfit.md,
   docs/algorithms/covariance.md. */
#ifndef TWOVIEW_TWO_VIEW_H
#define TWOVIEW_TWO_VIEW_H

#include "twoview/camera.h"
#include "twoview/context.h"

TV_BEGIN_DECLS

/* Matched pixels: pixel i of image 0 and pixel i of image 1 show the same point. Filled by
   tv_pixel_pairs_init with zeros; the arrays are the caller's and are read during the call only. */
typedef struct tv_pixel_pairs {
  /* The caller's sizeof, set by tv_pixel_pairs_init. */
  uint32_t struct_size;
  /* How many pairs there are, at least 0; for a call with a context at most its max_matches. */
  int32_t num;
  /* num x 2 (x, y) each, in pixels, distorted as in the images. */
  const double *pixels0, *pixels1;
  /* Null, or `num` values, of which a lower one marks a more certain match
     (tv_correspondence.ratio): more certain matches are sampled first. */
  const float *ratios;
  /* Null (1 for all), or `num` values each, [0.01, 1000]: the standard deviation of the pixel in
     image 0 and in image 1, relative to that of the most precise pixels. A residual is divided by
     the standard deviation that both sigmas give it: a match whose two pixels have the sigma s is
     an inlier up to s max_error_px, and has 1 / s^2 times the weight in the pose.
     tv_keypoint_sigmas computes sigmas from the sizes of keypoints. */
  const float *sigmas0, *sigmas1;
} tv_pixel_pairs;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_pixel_pairs_init. */
TV_API void tv_pixel_pairs_init_sized(tv_pixel_pairs *pairs, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_pixel_pairs_init(pairs) tv_pixel_pairs_init_sized((pairs), sizeof *(pairs))

/* The minimal solver that computes a model from each random sample. */
typedef enum tv_solver {
  /* The default: five-point with cameras, eight-point without. */
  TV_SOLVER_AUTO = 0,
  /* Five matches; cameras are required. D. Nister, "An efficient solution to the five-point
     relative pose problem", PAMI 2004. */
  TV_SOLVER_FIVE_POINT = 1,
  /* Eight matches; the method of the FAST-SIFT paper. R. Hartley, "In defense of the eight-point
     algorithm", PAMI 1997. */
  TV_SOLVER_EIGHT_POINT = 2,
  /* Seven matches: fewer iterations than eight-point where many matches are wrong. R. Hartley,
     A. Zisserman, "Multiple View Geometry", 11.1.2. */
  TV_SOLVER_SEVEN_POINT = 3,
  /* Three matches and the direction of gravity; cameras and gravity are required. */
  TV_SOLVER_UPRIGHT = 4
} tv_solver;

/* The kind of geometry that explains the matches: the kinds of COLMAP, and no-motion. */
typedef enum tv_kind {
  /* No model explains the matches. */
  TV_KIND_DEGENERATE = 0,
  /* An essential matrix: R and t are known, t up to its length. */
  TV_KIND_CALIBRATED = 1,
  /* A fundamental matrix: only F is known, because no cameras were given. */
  TV_KIND_UNCALIBRATED = 2,
  /* The homography of a plane: R and t are known, and perhaps an alternative pose. */
  TV_KIND_PLANAR = 3,
  /* A pure rotation: R is known, t is not. */
  TV_KIND_PANORAMIC = 4,
  /* A homography, of a plane or of a rotation: only H is known, because no cameras were given. */
  TV_KIND_PLANAR_OR_PANORAMIC = 5,
  /* The camera did not move: with cameras, R is the identity; t is not known. */
  TV_KIND_NO_MOTION = 6
} tv_kind;

/* Whether the result can be relied on. docs/algorithms/two_view.md has the rules. */
typedef enum tv_verdict {
  /* No model explains the matches, or the camera only rotated or did not move: the translation is
     not known. */
  TV_VERDICT_REFUSED = 0,
  /* There is a model that the kind names, and at least one reason why it may be wrong. */
  TV_VERDICT_DOUBTFUL = 1,
  /* There is such a model, and no reason against it. Without cameras it is F or H and no pose: test
     has_R and has_t before using R and t. */
  TV_VERDICT_OK = 2
} tv_verdict;

/* Why a verdict is not "ok". The values are bits of tv_two_view.reasons. */
typedef enum tv_reason {
  /* Fewer than 15 different matches are inliers (of a degenerate pair: were given). Or the pose is
     too probably wrong (probability_wrong), and what raises that most is that the inliers lie in
     few places: cells of 32 pixels, or of a 16th of the longer side where it is smaller than 512, a
     64th where it is larger than 2048. */
  TV_REASON_TOO_FEW_MATCHES = 1 << 0,
  /* The pose is too probably wrong, and what raises that most is that certain matches are no
     inliers, or the residuals are large. Without a full pose: fewer than 25 % of the matches are
     inliers, or the residuals are uniform over the threshold, as random matches' are. Matches that
     can never be inliers (tv_estimate_two_view) are not counted. Of tv_reconstruct also: the two
     images match better when one of them is mirrored. */
  TV_REASON_LOW_INLIER_RATIO = 1 << 1,
  /* The direction of t is poorly determined: the median parallax is below 3 max_error_px or below
     10 times the noise, or the largest standard deviation of the pose exceeds 1.25 degrees by the
     noise alone, or that of the direction 13.5 degrees with the errors that matches share. With two
     cameras of uncertain focal length (above 0.02), with all that the covariance states. Or the
     relative standard deviation that is left of the focal length exceeds 0.125. */
  TV_REASON_LOW_PARALLAX = 1 << 2,
  /* The matches lie on a plane, and two different poses explain them equally well. Both are in the
     result. */
  TV_REASON_TWO_PLANAR_SOLUTIONS = 1 << 3,
  /* The camera only rotated: t cannot be determined. The verdict is "refused". */
  TV_REASON_PURE_ROTATION = 1 << 4,
  /* The camera did not move: t cannot be determined. The verdict is "refused". */
  TV_REASON_NO_MOTION = 1 << 5,
  /* Matches far from this pose agree on another one, and are at least 15 % as many as its inliers.
     Something in the scene moves by itself, or this pose is that of the moving object. */
  TV_REASON_SECOND_MOTION = 1 << 6,
  /* The inliers cover fewer than 5 of the 64 cells of an 8x8 grid over each of the two images, or
     lie on a line in one of them. Or the pose is too probably wrong, and what raises that most is
     that it depends on the inliers of one region of an image. */
  TV_REASON_CROWDED_MATCHES = 1 << 7,
  /* The matched pixels of both images lie on a regular lattice, and either most inliers do, too, or
     a second model fits the other matches: the pose may be wrong by one period of a repeated
     structure. Or matches agree on the opposite direction, at least 4 and a tenth as many as the
     inliers of a clear depth, with more than twice their parallax. tv_reconstruct gives it, too,
     where most inliers have a second place that looks the same. */
  TV_REASON_REPEATED_STRUCTURE = 1 << 8,
  /* The matches contradict the cameras as they were given: the rows of a picture were exposed one
     after another while the camera turned (a rolling shutter), or its principal point or lens is
     another one. With cameras that the matches do not contradict, the direction would be another
     one by more than 10 degrees (tv_evidence.camera_direction_rad), or, where the focal length is
     uncertain (above 0.02), by anything: such a camera is assumed, and so is its lens. */
  TV_REASON_CAMERA_CONTRADICTED = 1 << 9
} tv_reason;

/* Returns the name of a kind, such as "calibrated" or "planar_or_panoramic", or "unknown" for any
   other number. The string is constant and never freed. Thread-safe. */
TV_API const char *tv_kind_string(tv_kind kind);
/* Returns "ok", "doubtful" or "refused", or "unknown" for any other number. The string is constant
   and never freed. Thread-safe. */
TV_API const char *tv_verdict_string(tv_verdict verdict);
/* Returns the name of one reason, such as "low_parallax", or "unknown" for anything but exactly one
   of the bits. The string is constant and never freed. Thread-safe. */
TV_API const char *tv_reason_string(tv_reason reason);

/* Options of the estimate. Filled by tv_estimate_options_init. */
typedef struct tv_estimate_options {
  /* The caller's sizeof, set by tv_estimate_options_init. */
  uint32_t struct_size;
  /* A tv_solver, default TV_SOLVER_AUTO. */
  int32_t method;
  /* The inlier threshold: the largest Sampson distance of an inlier, in pixels of the images as
     given, for every lens alike; (0, 1e9], default 1. The residual of a homography or a rotation
     has two dimensions; its threshold is 1.25 times as large. A bigger value accepts noisier
     matches and more wrong ones. It holds for pixels of sigma 1 (tv_pixel_pairs), and in proportion
     for others. */
  double max_error_px;
  /* The search stops when the probability of having missed a better model is below 1 - confidence;
     [0, 1), default 0.9999. A bigger value draws more samples. */
  double confidence;
  /* The most samples that are drawn, [1, 1000000], default 10000. It bounds the time. */
  int32_t max_iterations;
  /* 0 (default): the search stops as confidence determines. Otherwise exactly this many samples are
     drawn, up to 1000000, and the time is nearly constant. */
  int32_t fixed_iterations;
  /* The seed of the sampler. Its default is constant and never the time of day: equal inputs give
     equal results. */
  uint64_t seed;
  /* The direction of gravity ("down") in the frame of each camera, of any length above 0. Read only
     when gravity_sigma_rad is above 0. */
  double gravity0[3], gravity1[3];
  /* The standard deviation in radians of each direction of gravity about each axis across it,
     [0, pi]; 0 (default) means that gravity is not known. With every solver, a pose is refined with
     gravity as a prior; a direction that contradicts the matches counts less. */
  double gravity_sigma_rad;
  /* How uncertain the calibrations of camera0 and camera1 are; zeros (default): both are exact.
     Where camera0 and camera1 are equal, they are one camera with one error: the larger standard
     deviations count, and what either allows may be refined. Only such a camera is refined. Above
     a focal_sigma of 0.02, that is its focal length, together with the pose and with focal_sigma as
     a prior (focal_scale of the result); up to 0.02 it is its principal point, where the matches
     contradict (cx, cy) at a significance of 0.001, with center_sigma as a prior
     (principal_point_shift of the result). */
  tv_calibration calibration0, calibration1;
  /* How far a camera may turn while the sensor reads the rows of a picture, one after another: the
     standard deviation about each axis, in radians, [0, 0.5]; default 0.02, which is 50 degrees a
     second in 23 ms. Where the matches contradict cameras that stood still
     (tv_evidence.camera_chi2), the covariance grows by what such a turn, and another principal
     point, make of the pose, and a pose that would be another one is given
     TV_REASON_CAMERA_CONTRADICTED. Nothing is corrected. The rows are those of the image as given:
     of a picture that was turned since, or of a sensor that exposes all rows at once (global
     shutter), 0 may be stated, which leaves the test out. */
  double readout_turn_sigma_rad;
  /* Which attempt at these two images this is, [0, 10000]; 0 (default) means the first. Whoever
     tries again until the verdict is "ok" gives accident as many chances as there are attempts: the
     test against chance therefore counts so many times as many models, and the odds that the pose
     is wrong are so many times as high. tv_reconstruct adds the rungs of effort that it climbed. */
  int32_t num_trials;
  /* Must be 0. */
  int32_t reserved;
} tv_estimate_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_estimate_options_init. */
TV_API void tv_estimate_options_init_sized(tv_estimate_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_estimate_options_init(options) \
  tv_estimate_options_init_sized((options), sizeof *(options))

/* The result of an estimate: what a program acts on. What it was decided from is in tv_evidence.
   Matrices are row-major. A matrix or vector whose has_ flag is 0 holds zeros. */
typedef struct tv_two_view {
  /* The caller's sizeof, set by tv_two_view_init. */
  uint32_t struct_size;
  /* A tv_kind. */
  int32_t kind;
  /* A tv_verdict. */
  int32_t verdict;
  /* The tv_reason bits; 0 if the verdict is "ok". */
  uint32_t reasons;
  /* How many matches were given. */
  int32_t num_matches;
  /* How many of them are inliers of the model that `kind` names. */
  int32_t num_inliers;
  /* Each is 1 where the member of that name was estimated, else 0. */
  uint8_t has_R, has_t, has_E, has_F, has_H, has_alternative, has_covariance,
      has_alternative_covariance;
  /* How many samples were drawn. */
  int32_t num_iterations;
  /* How many of the matches stand still: they keep their pixel, to within twice max_error_px (times
     the sigma) and at least 2 pixels, while the rest of the picture moves, and no point of the
     scene can be there at any distance: on-screen text, a frame, a watermark, the vehicle's own
     legs. They are left out of the estimate and are no inliers. 0 where there are none, without
     cameras, and where the images differ in size. docs/algorithms/two_view.md, what stands still.
   */
  int32_t num_still;
  /* The pose cam1_from_cam0: x1 = R x0 + t, where R is a rotation matrix and |t| = 1. */
  double R[9], t[3];
  /* The essential matrix [t]x R, scaled to Frobenius norm 1. */
  double E[9];
  /* The fundamental matrix, scaled to Frobenius norm 1: K1^-T E K0^-1, of undistorted pixels; or,
     without cameras, of the pixels as given. */
  double F[9];
  /* The homography from undistorted pixels of image 0 to undistorted pixels of image 1 (without
     cameras, pixels as given), scaled so that H[8] = 1, or to Frobenius norm 1 where H[8] is nearly
     0. */
  double H[9];
  /* The second pose that explains a plane, in the form of R and t, |t| = 1. */
  double alternative_R[9], alternative_t[3];
  /* The covariance of the pose, 5x5, in radians^2, in the order (w0 w1 w2 a b): R_true =
     exp([w]x) R, t_true = normalise(t + a b1 + b b2), b1 = normalise(e_k x t), b2 = t x b1, where k
     is the index of the smallest |t_k| (the lowest one on a tie). It grows where more than 30 per
     cent of the matches are no inliers (docs/algorithms/covariance.md). */
  double covariance[25];
  /* The covariance of the alternative pose, in radians^2 and in the same parameters. */
  double alternative_covariance[25];
  /* The median, over the inliers, of the angle in radians between the two rays of a match after the
     rotation was removed; 0 without a full pose. */
  double median_parallax_rad;
  /* The root mean square of the inliers' residuals, in pixels: Sampson distances, or, where the
     kind is panoramic, planar-or-panoramic or no-motion, transfer errors. Where the matches have
     sigmas, each residual is in units of its sigma: the value is that of matches of sigma 1. */
  double rms_error_px;
  /* The standard deviation of a matched pixel along one axis, in pixels, estimated from the
     residuals of a full pose; 0 without one. Where the matches have sigmas, it is that of a pixel
     of sigma 1, and sigma times as much for any other. */
  double noise_px;
  /* The seed that was used. */
  uint64_t seed;
  /* What the estimate adds to (cx, cy) of both cameras, in pixels: (0, 0) unless the options allow
     to refine the principal point. All of the result refers to the cameras with it, which
     tv_corrected_pair computes. */
  double principal_point_shift[2];
  /* The probability that the pose is wrong, [0, 1]. It is calibrated on real pairs for one event:
     the rotation is off by more than 5 degrees (docs/verdict.md has the figures). The direction is
     wrong more often; the covariance says how uncertain both are where the pose is right. 1 where
     there is no full pose R and t: without cameras, and for the kinds degenerate, panoramic and
     no-motion. It is at least 0.5 where tv_reconstruct finds a reason in the descriptors: a
     mirrored image, or a second place that looks the same. What it is computed from is in
     tv_evidence, with noise_px and has_alternative. */
  double probability_wrong;
  /* The factor, without a unit, by which the estimate multiplies fx and fy of both cameras, where
     the focal length was refined with the pose: all of the result refers to the cameras with it,
     which tv_corrected_pair computes. 0 where the focal length is as given. */
  double focal_scale;
  /* The relative standard deviation of the focal length (of camera0's, where the cameras differ)
     that the covariance contains: what the matches leave of the given one where the focal length
     was refined, else the given one. 0 where it is taken as exact, or there is no covariance.
     Bundle adjustment in tv_reconstruct leaves it, and the covariance that contains it, as the
     estimate has them. */
  double focal_sigma;
} tv_two_view;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_two_view_init. */
TV_API void tv_two_view_init_sized(tv_two_view *result, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_two_view_init(result) tv_two_view_init_sized((result), sizeof *(result))

/* What kind, verdict and probability_wrong of a result were decided from, for whoever wants to know
   why: diagnostics, statistics over many pairs, other thresholds. It is the same for swapped
   images. The functions that take it write it where it is asked for, and decide nothing by that. */
typedef struct tv_evidence {
  /* The caller's sizeof, set by tv_evidence_init. */
  uint32_t struct_size;
  /* How many cells of 32 pixels hold an inlier, in the image where fewer do (at most 64 cells, at
     least 16, along the longer side). */
  int32_t num_places;
  /* How many inliers each model has, repeated matches counted once; -1 where that model was not
     estimated. */
  int32_t essential_inliers, fundamental_inliers, homography_inliers, rotation_inliers;
  /* The share of the cells of an 8x8 grid over an image that hold an inlier, [0, 1]: the larger of
     the two images' shares. */
  double coverage;
  /* The share of the different matches that are inliers, each weighted by (1 - ratio)^2, [0, 1]:
     the matches with the most certain descriptors count most. */
  double agreement;
  /* By how many radians the rotation turns, to first order, when the inliers of one sixteenth of an
     image are left out: of the part that turns it most, the mean of both images; [0, pi]. 0 without
     a full pose. */
  double region_shift_rad;
  /* Evidence against (cx, cy) as they were given, whatever may be refined: chi-square
     with two degrees of freedom where they are right, so that it exceeds 13.8 in one pair of a
     thousand. This field and the next two are 0 where the evidence is not known: where camera0 and
     camera1 differ, the kind is not TV_KIND_CALIBRATED, or the matches do not determine a shift.
     Wrong matches and repeated structure are evidence, too: only a shift that many pairs agree on
     is that of the camera. */
  double principal_point_chi2;
  /* The shift of (cx, cy), in pixels, with which the matches' residuals are least, without a
     prior. It is not applied. */
  double principal_point_asked_px[2];
  /* The covariance of principal_point_asked_px, in pixels^2: of x, of x and y, of y. */
  double principal_point_asked_covariance[3];
  /* Evidence of the matches against the cameras as they were given (readout_turn_sigma_rad), or 0
     where it was not tested: where there is no pose, or it was fitted together with a plane that
     explains nearly all matches. Above 26.1 (22.5 where camera0 and camera1 differ) the cameras
     count as contradicted: chi-square with eight (six) degrees of freedom exceeds it in one of a
     thousand cases, and matches count as a quarter as many, since they share errors. */
  double camera_chi2;
  /* The angle in radians by which the rotation would move with cameras that the matches do not
     contradict; 0 where they do not contradict the given ones. The covariance contains it. */
  double camera_turn_rad;
  /* The same of the direction (of t or of the inverse pose's, whichever moves more). */
  double camera_direction_rad;
} tv_evidence;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_evidence_init. */
TV_API void tv_evidence_init_sized(tv_evidence *evidence, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_evidence_init(evidence) tv_evidence_init_sized((evidence), sizeof *(evidence))

/* Writes to *pair the cameras and the motion that the result refers to, for what follows the
   estimate: triangulation, guided matching, bundle adjustment and the dense cloud. Each camera is
   the given one with the result's principal_point_shift added to cx and cy, and with fx and fy
   multiplied by its focal_scale where that is above 0. The motion is R and t of the result: zeros
   where it has none (has_R, has_t), which the functions that need a motion refuse.
   camera0, camera1: those of the estimate. They may be members of *pair.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE. Thread-safe. */
TV_API tv_status tv_corrected_pair(const tv_two_view *result, const tv_camera *camera0,
                                   const tv_camera *camera1, tv_camera_pair *pair);

/* Estimates the two-view geometry of matched pixels.
   camera0, camera1: both cameras; or both null, which gives F and H only and requires the solver
   eight-point, seven-point or TV_SOLVER_AUTO.
   pairs: the matched pixels. The order of the matches has no influence on the result. A match that
   is given more than once counts once, with the least sum of its sigmas. A match is
   never an inlier if a pixel lies outside its lens's valid region or is not finite, or if the
   absolute values of its four coordinates add up to a million pixels or more.
   options: null means the defaults.
   result: initialised by tv_two_view_init. That no geometry was found is TV_OK, and reported in
   kind, verdict and reasons. With both views exchanged, R is the transpose bit for bit, and t is
   -R^T t.
   evidence: null, or initialised by tv_evidence_init.
   inlier_mask: null, or room for pairs->num bytes; a byte is 1 where the match is an inlier of the
   model that the kind names.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS, TV_ERR_CAMERA,
   TV_ERR_NOT_FINITE (an option or a sigma), TV_ERR_OVERLAP. More matches than the context's
   max_matches are TV_ERR_LIMITS: which of them to leave out is the caller's choice here
   (tv_reconstruct leaves out those of the highest ratio).
   Time: at most max_iterations samples, of at most 10 models each, which are scored on all
   matches. */
TV_API tv_status tv_estimate_two_view(tv_context *context, const tv_camera *camera0,
                                      const tv_camera *camera1, const tv_pixel_pairs *pairs,
                                      const tv_estimate_options *options, tv_two_view *result,
                                      tv_evidence *evidence, uint8_t *inlier_mask);

TV_END_DECLS

#endif
