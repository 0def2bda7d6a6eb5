/* twoview: bundle adjustment of two views, and the covariances of its points.

   N. Demmel et al., "Square root bundle adjustment for large-scale reconstruction", CVPR 2021;
   P. J. Huber, "Robust Statistics", 1981. Formulas and tests: docs/algorithms/bundle.md. */
#ifndef TWOVIEW_BUNDLE_H
#define TWOVIEW_BUNDLE_H

#include "twoview/camera.h"
#include "twoview/context.h"
#include "twoview/triangulate.h"
#include "twoview/two_view.h"

TV_BEGIN_DECLS

/* The loss rho(s) of a match, where s = |e0|^2 + |e1|^2 is the sum of its squared distances in the
   two images, and c is loss_scale_px. There is one loss for a match and not one for each image,
   because a match is correct or wrong as a whole. For a given pose the best point then does not
   depend on the loss. */
typedef enum tv_loss {
  /* rho(s) = s: least squares. */
  TV_LOSS_NONE = 0,
  /* rho(s) = s up to c^2, beyond that 2 c sqrt(s) - c^2. */
  TV_LOSS_HUBER = 1,
  /* rho(s) = c^2 log(1 + s / c^2): for matches of which some are wrong. */
  TV_LOSS_CAUCHY = 2
} tv_loss;

/* Options of bundle adjustment. Filled by tv_bundle_options_init. */
typedef struct tv_bundle_options {
  /* The caller's sizeof, set by tv_bundle_options_init. */
  uint32_t struct_size;
  /* A tv_loss, default TV_LOSS_CAUCHY. */
  int32_t loss;
  /* The scale c of the loss in pixels, (0, 1e9], default 1. A smaller value reduces the influence
     of more matches. With a scale of at least twice the noise of a pixel, correct matches keep most
     of their influence. */
  double loss_scale_px;
  /* The most steps that are tried, [0, 1000], default 50; 0 only measures the cost. */
  int32_t max_iterations;
  /* 1: R and t are kept, and each point moves to its smallest error; 0 (default): all are
     adjusted. */
  int32_t hold_pose;
} tv_bundle_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_bundle_options_init. */
TV_API void tv_bundle_options_init_sized(tv_bundle_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_bundle_options_init(options) tv_bundle_options_init_sized((options), sizeof *(options))

/* What tv_adjust_two_view did, and how accurate the pose is. */
typedef struct tv_bundle_result {
  /* The caller's sizeof, set by tv_bundle_result_init. */
  uint32_t struct_size;
  /* How many points took part. */
  int32_t num_points;
  /* How many steps were tried. */
  int32_t num_iterations;
  /* 1 where the last step changed the cost by at most 1e-10 of it, or where no step, however short,
     lowers it; else 0. */
  uint8_t converged;
  /* 1 where `covariance` was computed; 0 where the pose was held, or where the matches do not
     determine its five parameters. */
  uint8_t has_covariance;
  /* Always 0. */
  uint8_t reserved[2];
  /* The sum of rho over the points that took part, in pixels^2, before and after. */
  double initial_cost, final_cost;
  /* The root mean square of |e0| and |e1| over these points, without the loss, before and after. */
  double initial_rms_px, rms_px;
  /* The covariance of the pose, 5x5 row-major, in radians^2, in the order (w0 w1 w2 a b): R_true =
     exp([w]x) R, t_true / |t| = normalise(u + a b1 + b b2), u = t / |t|, b1 = normalise(e_k x u),
     b2 = u x b1, where k is the index of the smallest |u_k| (the lowest one on a tie). It is
     proportional to noise_px^2. Zeros where has_covariance is 0. */
  double covariance[25];
  /* The standard deviation of a pixel along one axis, estimated from the residuals: for
     TV_LOSS_NONE the usual estimate, for the other losses the one with which `covariance` is the
     asymptotic covariance of the robust estimate (Huber 1981). 0 where has_covariance is 0. */
  double noise_px;
} tv_bundle_result;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_bundle_result_init. */
TV_API void tv_bundle_result_init_sized(tv_bundle_result *result, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_bundle_result_init(result) tv_bundle_result_init_sized((result), sizeof *(result))

/* Minimises the sum of rho over the matches, over the pose (R and the direction of t; the length of
   t is kept) and the points, by the Levenberg-Marquardt method.
   pixels: the matched pixels, one pair for each point; ratios are not read. Where they have sigmas,
   e0 and e1 are divided by them, and all that the result states in pixels is in units of sigma.
   error_px of a point is in pixels of the images.
   options: null means the defaults.
   pair: the cameras, which stay as they are, and the motion: the start before the call, the result
   after it.
   points: pixels->num points, for example of tv_triangulate; the start before the call, the result
   after it (position, angle, error and status). A point takes part if its status is TV_POINT_OK or
   TV_POINT_INFINITE, both lenses can see it, both pixels are finite and within a million pixels,
   and it is farther from camera 0 than a millionth of |t|. All other points stay as they are: set a
   point's status to TV_POINT_INVALID to exclude its match. A point may be at infinity and may pass
   through it; a point whose rays diverge receives the status TV_POINT_BEHIND.
   result: null, or initialised by tv_bundle_result_init.
   No output overlaps another argument. Equal inputs give equal bytes on every CPU; the order of the
   matches is the order in which sums are formed.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (the count, R, t, an option or a sigma),
   TV_ERR_NOT_FINITE (R, t, an option or a sigma), TV_ERR_CAMERA, TV_ERR_LIMITS (more points than
   the context's max_matches, or a context without TV_PURPOSE_ADJUST), TV_ERR_OVERLAP.
   Time: at most max_iterations passes over the points. Memory: from the context. */
TV_API tv_status tv_adjust_two_view(tv_context *context, const tv_pixel_pairs *pixels,
                                    const tv_bundle_options *options, tv_camera_pair *pair,
                                    tv_point *points, tv_bundle_result *result);

/* Computes the covariance of each point's position to first order.
   pair: the cameras and the motion, as for tv_triangulate.
   points: num_points. The result is exact to first order for points of the smallest error, as
   tv_adjust_two_view computes them, and nearly so for others.
   noise_px: the standard deviation of both pixels of a match along each axis, [0, 1e9]; the noise
   is taken as independent. For a match whose pixels have the sigma s (tv_pixel_pairs), give s times
   the noise of an estimate.
   pose_covariance: that of the motion, 25 numbers in the parameters of tv_bundle_result, in
   radians^2; null means that the motion is exact. With that of a bundle adjustment, the result is
   the point's own block of the joint covariance.
   covariances: room for num_points x 9, a row-major symmetric 3x3 each, in the frame of camera 0
   and in the squared unit of t. A covariance is zero where it is not known: the point is not
   TV_POINT_OK, a lens cannot see it, or it lies on the baseline and its depth is undetermined. The
   first order is accurate where the depth is known to within a few percent. Beyond that, the true
   uncertainty is longer on the far side than on the near side.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (the count, R, t or the noise), TV_ERR_NOT_FINITE (R, t, the
   noise or pose_covariance), TV_ERR_CAMERA, TV_ERR_OVERLAP. Needs no context. Thread-safe. */
TV_API tv_status tv_point_covariances(const tv_camera_pair *pair, const tv_point *points,
                                      int32_t num_points, double noise_px,
                                      const double *pose_covariance, double *covariances);

TV_END_DECLS

#endif
