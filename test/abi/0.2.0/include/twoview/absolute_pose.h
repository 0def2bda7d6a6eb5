/* twoview: the absolute pose of a camera from pixels and the points in space that they see.

   Y. Ding et al., "Revisiting the P3P problem", CVPR 2023; P. J. Huber, "Robust Statistics", 1981.
   Formulas, the rules of the verdict, and tests: docs/algorithms/absolute_pose.md. */
#ifndef TWOVIEW_ABSOLUTE_POSE_H
#define TWOVIEW_ABSOLUTE_POSE_H

#include "twoview/camera.h"
#include "twoview/context.h"
#include "twoview/two_view.h"

TV_BEGIN_DECLS

/* Matches of pixels and points: pixel i is the image of point i. Filled by tv_pixel_points_init
   with zeros; the arrays are the caller's and are read during the call only. */
typedef struct tv_pixel_points {
  /* The caller's sizeof, set by tv_pixel_points_init. */
  uint32_t struct_size;
  /* How many matches there are, [0, the context's max_matches]. */
  int32_t num;
  /* num x 2 (x, y), in pixels, distorted as in the image. */
  const double *pixels;
  /* num x 3 (X, Y, Z), in the world's frame, in any unit. */
  const double *points;
  /* Null, or `num` values, of which a lower one marks a more certain match: more certain matches
     are sampled first. */
  const float *ratios;
  /* Null (1 for all), or `num` values, [0.01, 1000]: the standard deviation of the pixel relative
     to that of the most precise ones, with what the point's own error adds to it. A match of the
     sigma s is an inlier up to s max_error_px, and has 1 / s^2 times the weight in the pose. */
  const float *sigmas;
} tv_pixel_points;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_pixel_points_init. */
TV_API void tv_pixel_points_init_sized(tv_pixel_points *matches, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_pixel_points_init(matches) tv_pixel_points_init_sized((matches), sizeof *(matches))

/* Options of the absolute pose. Filled by tv_absolute_pose_options_init. */
typedef struct tv_absolute_pose_options {
  /* The caller's sizeof, set by tv_absolute_pose_options_init. */
  uint32_t struct_size;
  /* The most samples that are drawn, [1, 1000000], default 10000. It bounds the time. Not more are
     drawn than there are different samples of three matches. */
  int32_t max_iterations;
  /* 0 (default): the search stops as confidence determines. Otherwise exactly this many samples are
     drawn, up to 1000000, and the time is nearly constant. */
  int32_t fixed_iterations;
  /* Must be 0. */
  int32_t reserved;
  /* The inlier threshold: the largest distance in pixels between the pixel of an inlier and the
     image of its point, (0, 1e9], default 4. A bigger value accepts noisier matches and more wrong
     ones. It holds for pixels of sigma 1, and in proportion for others. */
  double max_error_px;
  /* The search stops when the probability of having missed a better pose is below 1 - confidence;
     [0, 1), default 0.9999. A bigger value draws more samples. */
  double confidence;
  /* The seed of the sampler. Its default is constant and never the time of day: equal inputs give
     equal results. */
  uint64_t seed;
  /* The direction of gravity ("down") in the frame of the world and in that of the camera, of any
     length above 0. Read only when gravity_sigma_rad is above 0. */
  double gravity_in_world[3], gravity_in_camera[3];
  /* The standard deviation in radians of the direction in the camera's frame about each axis across
     it, [0, pi]; 0 (default) means that gravity is not known. The pose is refined with gravity as a
     prior; a direction that contradicts the matches counts less. */
  double gravity_sigma_rad;
} tv_absolute_pose_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_absolute_pose_options_init. */
TV_API void tv_absolute_pose_options_init_sized(tv_absolute_pose_options *options,
                                                size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_absolute_pose_options_init(options) \
  tv_absolute_pose_options_init_sized((options), sizeof *(options))

/* The result of tv_estimate_absolute_pose. Matrices are row-major. What a has_ flag of 0 belongs to
   holds zeros. */
typedef struct tv_absolute_pose {
  /* The caller's sizeof, set by tv_absolute_pose_init. */
  uint32_t struct_size;
  /* A tv_verdict. Refused: has_pose is 0, because no pose has more inliers than chance explains, or
     because the matches do not determine one: they are too few, or their points lie on a line. */
  int32_t verdict;
  /* The tv_reason bits; 0 if the verdict is "ok".
     TV_REASON_TOO_FEW_MATCHES: fewer than 15 distinct matches are inliers.
     TV_REASON_LOW_INLIER_RATIO: fewer than 25 % of the matches are inliers, or noise_px is above
     0.7 max_error_px. TV_REASON_LOW_PARALLAX: the pose is poorly determined: the standard deviation
     of the rotation exceeds 1.25 degrees, or that of the position 2.2 % of the distance of the
     points. TV_REASON_CROWDED_MATCHES: the inliers cover fewer than 5 of the 64 cells of an 8x8
     grid over the image, or their points lie on a line, to 3 max_error_px as seen from their
     distance. TV_REASON_TWO_PLANAR_SOLUTIONS: the points lie on a plane, and two poses explain the
     pixels about equally well. Both are in the result. */
  uint32_t reasons;
  /* How many matches were given. */
  int32_t num_matches;
  /* How many of them are inliers of the pose. */
  int32_t num_inliers;
  /* How many samples were drawn. */
  int32_t num_iterations;
  /* Each is 1 where the member of that name was estimated, else 0; has_pose is that of R and t, and
     has_alternative that of alternative_R and alternative_t. */
  uint8_t has_pose, has_covariance, has_alternative;
  /* Always 0. */
  uint8_t reserved[5];
  /* The pose cam_from_world: x = R X + t; t has the unit of the points. */
  double R[9], t[3];
  /* The second pose that explains points on a plane, in the form and the units of R and t. */
  double alternative_R[9], alternative_t[3];
  /* The covariance of the pose, 6x6, in the order (w0 w1 w2 d0 d1 d2), in radians and in the unit
     of the points: x_true = exp([w]x) x + d in the camera's frame, so that R_true = exp([w]x) R,
     t_true = exp([w]x) t + d. */
  double covariance[36];
  /* The share of the cells of an 8x8 grid over the image that hold an inlier, [0, 1]. */
  double coverage;
  /* The root mean square of the inliers' distances in pixels; where the matches have sigmas, in
     units of them. */
  double rms_error_px;
  /* The standard deviation of a pixel of sigma 1 along one axis, in pixels, estimated from the
     residuals; 0 without a covariance. */
  double noise_px;
  /* The seed that was used. */
  uint64_t seed;
} tv_absolute_pose;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_absolute_pose_init. */
TV_API void tv_absolute_pose_init_sized(tv_absolute_pose *result, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_absolute_pose_init(result) tv_absolute_pose_init_sized((result), sizeof *(result))

/* Estimates the pose of a camera from pixels and points in space, some of the matches wrong.
   camera: of any model.
   matches: their order has no influence on the result. A match that is given more than once counts
   once, with the least of its sigmas. A match is never an inlier if its pixel lies outside the
   lens's valid region or beyond a million pixels, if its point is farther than 1e9 times the median
   distance of the points from their middle, or if either is not finite.
   options: null means the defaults.
   result: initialised by tv_absolute_pose_init. That there is no pose is TV_OK, and reported in
   verdict and reasons.
   inlier_mask: null, or room for matches->num bytes; a byte is 1 where the match is an inlier.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS (more matches than the
   context's max_matches, or a context without TV_PURPOSE_ABSOLUTE_POSE), TV_ERR_CAMERA,
   TV_ERR_NOT_FINITE (an option or a sigma), TV_ERR_OVERLAP.
   Time: at most max_iterations samples, of at most 4 poses each, which are scored on all matches.
   Memory: from the context. */
TV_API tv_status tv_estimate_absolute_pose(tv_context *context, const tv_camera *camera,
                                           const tv_pixel_points *matches,
                                           const tv_absolute_pose_options *options,
                                           tv_absolute_pose *result, uint8_t *inlier_mask);

TV_END_DECLS

#endif
