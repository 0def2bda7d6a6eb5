/* twoview: bundle adjustment of two views, and how sure its points are.

   N. Demmel et al., "Square root bundle adjustment", CVPR 2021; P. J. Huber, "Robust Statistics", 1981. Formulas
   and tests: docs/algorithms/bundle.md. */
#ifndef TWOVIEW_BUNDLE_H
#define TWOVIEW_BUNDLE_H

#include "twoview/camera.h"
#include "twoview/context.h"
#include "twoview/triangulate.h"

TV_BEGIN_DECLS

/* rho(s) of a match, s = |e0|^2 + |e1|^2 the sum of its squared distances in the two images, c the
   loss's scale. One loss a match, not one an image: a match is right or wrong as a whole, and given
   the pose, its best point is then the same whatever the loss. */
typedef enum tv_loss {
  TV_LOSS_NONE = 0,  /* s: least squares */
  TV_LOSS_HUBER = 1, /* s up to c^2, then 2 c sqrt(s) - c^2 */
  TV_LOSS_CAUCHY = 2 /* c^2 log(1 + s / c^2): for matches of which some are wrong */
} tv_loss;

/* Filled by tv_bundle_options_init. */
typedef struct tv_bundle_options {
  uint32_t struct_size;   /* set by tv_bundle_options_init */
  int32_t loss;           /* a tv_loss, default TV_LOSS_CAUCHY */
  double loss_scale_px;   /* c; (0, 1e9], default 1. Smaller trusts fewer matches; twice the noise of
                             a pixel or more loses little of what good matches tell */
  int32_t max_iterations; /* bound on steps tried, [0, 1000], default 50; 0 only measures */
  int32_t hold_pose;      /* 1: R and t stay, each point goes to its least error; default 0 */
} tv_bundle_options;

/* Writes the defaults, and struct_size; null is allowed. */
TV_API void tv_bundle_options_init(tv_bundle_options *options);

/* What tv_adjust_two_view did, and how sure the pose is. */
typedef struct tv_bundle_result {
  uint32_t struct_size; /* set by tv_bundle_result_init */
  int32_t num_points;   /* that took part */
  int32_t num_iterations; /* steps tried */
  uint8_t converged;      /* 1: the last step changed the cost by at most 1e-10 of it, or none,
                             however short, lowers it */
  uint8_t has_covariance; /* 0: five parameters are not determined, or the pose was held */
  uint8_t reserved[2];    /* 0 */
  double initial_cost, final_cost; /* sum of rho over the points that took part, px^2 */
  double initial_rms_px, rms_px;   /* root mean square of |e0| and |e1| over them, without rho */
  double covariance[25]; /* of the pose, radians^2, order (w0 w1 w2 a b): R_true = exp([w]x) R,
                            t_true / |t| = normalise(u + a b1 + b b2), u = t / |t|, b1 =
                            normalise(e_k x u), k the index of the smallest |u_k| (the lowest on a
                            tie), b2 = u x b1. Proportional to noise_px^2 */
  double noise_px;       /* standard deviation of a pixel along one axis, as the residuals tell it:
                            for TV_LOSS_NONE the usual one; for the others the one with which
                            `covariance` is the loss's own asymptotic covariance (Huber 1981) */
} tv_bundle_result;

/* Writes zeros, and struct_size; null is allowed. */
TV_API void tv_bundle_result_init(tv_bundle_result *result);

/* Minimises the sum over matches of rho over the pose (R, and the direction of t; |t| stays) and
   the points, by Levenberg-Marquardt.
   R, t: in the start, out the answer. cam1_from_cam0: x1 = R x0 + t; R row-major 3x3, a rotation to
   1e-6; t not zero.
   pixels0, pixels1: num_points x 2 (x, y), distorted pixels as the images have them.
   points: num_points, in the start (of tv_triangulate, for one), out the answer: position, angle,
   error and status. Points that are TV_POINT_OK or TV_POINT_INFINITE take part, but for those that
   their lens cannot see, whose pixel is not finite or beyond a million pixels, or that lie nearer
   to camera 0 than a millionth of |t|; all others are left as they are, so a match is excluded by
   giving its point TV_POINT_INVALID. Points may be at infinity and pass through it: one whose rays
   diverge comes back as TV_POINT_BEHIND.
   options: null means the defaults. result: null, or initialised by tv_bundle_result_init.
   Outputs do not overlap other arguments.
   Same input, same bytes, on every CPU; the matches' order is the order of sums.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (count, R, t, options),
   TV_ERR_NOT_FINITE (R, t, options), TV_ERR_CAMERA, TV_ERR_LIMITS (num_points is above the
   context's max_matches), TV_ERR_OVERLAP.
   Time: at most max_iterations passes over the points; memory from the context. */
TV_API tv_status tv_adjust_two_view(tv_context *context, const tv_camera *camera0,
                                    const tv_camera *camera1, const double *pixels0,
                                    const double *pixels1, int32_t num_points,
                                    const tv_bundle_options *options, double R[9], double t[3],
                                    tv_point *points, tv_bundle_result *result);

/* Writes the covariance of each point's position, to first order, for independent noise of noise_px
   (standard deviation along each axis, [0, 1e9]) in both pixels of a match whose point has the
   least error (tv_adjust_two_view), nearly so for other points.
   pose_covariance: of R and t as they are, in the parameters of tv_bundle_result, radians^2; with
   that of a bundle adjustment the sum is the points' own block of the joint covariance. Null: the
   pose is exact.
   covariances: num_points x 9, row-major 3x3, camera 0 frame, the unit of t squared; symmetric.
   Zeros where it is not known: points that are not TV_POINT_OK, that a lens cannot see, or whose
   depth is open (on the baseline).
   First order asks for a depth that is known to a few per cent; of points beyond, the far end of
   the interval is longer than the near one.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (count, R, t, noise), TV_ERR_NOT_FINITE (R, t, noise,
   pose_covariance), TV_ERR_CAMERA, TV_ERR_OVERLAP. Needs no context; thread-safe. */
TV_API tv_status tv_point_covariances(const tv_camera *camera0, const tv_camera *camera1,
                                      const double R[9], const double t[3],
                                      const double *pose_covariance, double noise_px,
                                      const tv_point *points, int32_t num_points,
                                      double *covariances);

TV_END_DECLS

#endif
