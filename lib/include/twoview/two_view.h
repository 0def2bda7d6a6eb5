/* twoview: the geometry of two views from matched pixels.

   Formulas, papers, rules of the verdict, tests: docs/algorithms/two_view.md, docs/algorithms/gravity.md,
   docs/algorithms/principal_point.md. */
#ifndef TWOVIEW_TWO_VIEW_H
#define TWOVIEW_TWO_VIEW_H

#include "twoview/camera.h"
#include "twoview/context.h"

TV_BEGIN_DECLS

/* The minimal solver that the robust loop samples with. */
typedef enum tv_solver {
  /* The default: five-point with cameras, eight-point without. */
  TV_SOLVER_AUTO = 0,
  TV_SOLVER_FIVE_POINT = 1,  /* Nister, "An efficient solution to the five-point relative pose
                                problem", PAMI 2004; cameras needed */
  TV_SOLVER_EIGHT_POINT = 2, /* Hartley, "In defense of the eight-point algorithm", PAMI 1997: the
                                paper's path */
  TV_SOLVER_SEVEN_POINT = 3, /* Hartley, Zisserman, "Multiple View Geometry", 11.1.2: smaller samples,
                                where many matches are wrong */
  TV_SOLVER_UPRIGHT = 4      /* three points and gravity; cameras and gravity needed */
} tv_solver;

/* COLMAP's kinds of two-view geometry, and no-motion. */
typedef enum tv_kind {
  TV_KIND_DEGENERATE = 0,         /* no model explains the matches */
  TV_KIND_CALIBRATED = 1,         /* essential matrix: R, t */
  TV_KIND_UNCALIBRATED = 2,       /* fundamental matrix: F only */
  TV_KIND_PLANAR = 3,             /* homography of a plane: R, t and perhaps an alternative */
  TV_KIND_PANORAMIC = 4,          /* pure rotation: R only */
  TV_KIND_PLANAR_OR_PANORAMIC = 5, /* homography, uncalibrated: H only */
  TV_KIND_NO_MOTION = 6           /* the camera did not move: R = I */
} tv_kind;

/* Whether to believe the pose. docs/algorithms/two_view.md has the rules. */
typedef enum tv_verdict {
  TV_VERDICT_REFUSED = 0,  /* there is no full pose */
  TV_VERDICT_DOUBTFUL = 1, /* there is one, and a reason against it */
  TV_VERDICT_OK = 2        /* no reason against it */
} tv_verdict;

/* Why a verdict is not "ok": bits of tv_two_view.reasons. */
typedef enum tv_reason {
  TV_REASON_TOO_FEW_MATCHES = 1 << 0,   /* fewer than 15 different ones agree */
  TV_REASON_LOW_INLIER_RATIO = 1 << 1,  /* fewer than a quarter agree, or what they leave is spread
                                           over the whole threshold as chance would have it */
  TV_REASON_LOW_PARALLAX = 1 << 2,      /* a median parallax below 3 max_error_px or 10 times the
                                           noise, or a pose whose standard deviation is above 1.25
                                           degrees: t is little known */
  TV_REASON_TWO_PLANAR_SOLUTIONS = 1 << 3, /* a plane's two motions explain the matches alike */
  TV_REASON_PURE_ROTATION = 1 << 4,     /* refused: there is no t */
  TV_REASON_NO_MOTION = 1 << 5,         /* refused: there is no t */
  TV_REASON_SECOND_MOTION = 1 << 6,     /* matches far from this pose agree on another, at least 15
                                           per cent as many: something moved by itself, or which of
                                           the two the scene was is open */
  TV_REASON_CROWDED_MATCHES = 1 << 7,   /* the inliers lie in less than 5 of 64 cells of
                                           each image, or on a line in one of them */
  TV_REASON_REPEATED_STRUCTURE = 1 << 8 /* the same, or most of the inliers, and the points of both images
                                           lie as on a lattice: matched one period off, perhaps */
} tv_reason;

/* "calibrated", "planar_or_panoramic" ...; "unknown" for any other number. Static storage. */
TV_API const char *tv_kind_string(tv_kind kind);
/* "ok", "doubtful", "refused"; "unknown" for any other number. Static storage. */
TV_API const char *tv_verdict_string(tv_verdict verdict);
/* "low_parallax" ...; "unknown" for anything but one of the bits. Static storage. */
TV_API const char *tv_reason_string(tv_reason reason);

/* Filled by tv_estimate_options_init. */
typedef struct tv_estimate_options {
  uint32_t struct_size;     /* set by tv_estimate_options_init */
  int32_t method;           /* a tv_solver; default TV_SOLVER_AUTO */
  double max_error_px;      /* inlier threshold: Sampson distance in pixels of the images as given,
                               the same for every lens; (0, 1e9], default 1.0 */
  double confidence;        /* stop when a better model is this unlikely to have been missed;
                               [0, 1), default 0.9999 */
  int32_t max_iterations;   /* hard bound on samples, [1, 10^6], default 10000 */
  int32_t fixed_iterations; /* 0 (default): adaptive stop. N: exactly N samples, near constant time */
  uint64_t seed;            /* of the sampler; default constant, never the clock */
  double gravity0[3], gravity1[3]; /* the direction of gravity ("down") in each camera's frame, of any
                                      length above 0; read when gravity_sigma_rad > 0 */
  double gravity_sigma_rad; /* standard deviation of each direction about each axis across it,
                               [0, pi]; 0 (default): gravity is not known */
  double principal_point_sigma; /* how far from cx, cy the principal point may be: a standard deviation in
                               focal lengths, [0, 0.1], default 0.01; 0: exactly there. Read where
                               camera0 and camera1 are equal; it then stays where it is unless the
                               matches speak against that at one in a thousand */
} tv_estimate_options;

/* Writes the defaults, and struct_size; null is allowed. */
TV_API void tv_estimate_options_init(tv_estimate_options *options);

/* Everything that was found. Matrices are row-major; those whose has_ flag is 0 hold zeros. */
typedef struct tv_two_view {
  uint32_t struct_size; /* set by tv_two_view_init */
  int32_t kind;         /* a tv_kind */
  int32_t verdict;      /* a tv_verdict */
  uint32_t reasons;     /* tv_reason bits */
  int32_t num_matches;  /* as given */
  int32_t num_inliers;  /* of the model that kind names */
  uint8_t has_R, has_t, has_E, has_F, has_H, has_alternative, has_covariance,
      has_alternative_covariance; /* 1: the member of that name was estimated */
  int32_t num_iterations; /* samples drawn */
  double R[9], t[3];      /* cam1_from_cam0: x1 = R x0 + t, |t| = 1 */
  double E[9];            /* [t]x R, Frobenius norm 1, the sign that this gives */
  double F[9];            /* K1^-T E K0^-1, Frobenius norm 1; of undistorted pixels */
  double H[9];            /* undistorted pixels of image 0 to image 1; H[8] = 1 where finite */
  double alternative_R[9], alternative_t[3]; /* the second pose of a plane, |t| = 1 */
  double covariance[25]; /* radians^2, order (w0 w1 w2 a b): R_true = exp([w]x) R,
                            t_true = normalise(t + a b1 + b b2), b1 = normalise(e_k x t), k the index
                            of the smallest |t_k| (the lowest on a tie), b2 = t x b1 */
  double alternative_covariance[25]; /* radians^2, the same around the alternative pose */
  int32_t essential_inliers, fundamental_inliers, homography_inliers,
      rotation_inliers;       /* evidence: inliers of each model, -1 where it was not estimated */
  double coverage;            /* share of an 8x8 grid on the image that holds an inlier, [0, 1]:
                                 the larger of the two images' */
  double median_parallax_rad; /* of the inliers' rays, rotation removed */
  double rms_error_px;        /* Sampson distance over the inliers */
  double noise_px;            /* standard deviation of a matched pixel along one axis, as the
                                 residuals of a full pose tell it; 0 without one */
  uint64_t seed;              /* as used */
  double principal_point_shift[2]; /* pixels: what the matches want added to cx and cy of both cameras
                                 (tv_estimate_options.principal_point_sigma); all above is of the
                                 cameras with it (tv_corrected_camera); nearly always 0, 0 */
} tv_two_view;

/* Writes zeros, and struct_size; null is allowed. */
TV_API void tv_two_view_init(tv_two_view *result);

/* Writes to `corrected` the camera that the result is of: cx and cy plus principal_point_shift. For what
   follows the estimate: triangulation, guided matching, bundle adjustment. It may be the camera itself.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE. */
TV_API tv_status tv_corrected_camera(const tv_two_view *result, const tv_camera *camera,
                                     tv_camera *corrected);

/* Estimates the two-view geometry of num_matches matched pixels.
   camera0, camera1: both given, or both null (uncalibrated: F and H only, methods auto,
   eight-point and seven-point; otherwise TV_ERR_ARGUMENT).
   pixels0, pixels1: num_matches x 2 (x, y), as the images have them (distorted).
   ratios: null, or num_matches values, lower more certain (tv_correspondence.ratio): surer matches
   are sampled first.
   inlier_mask: null, or num_matches bytes, 1 for each inlier of the model that kind names.
   result: initialised by tv_two_view_init.
   A match outside its lens's valid region, not finite, or with coordinates that add up to a million
   pixels and more, is never an inlier.
   "No geometry" is TV_OK with kind, verdict and reasons. The matches' order does not matter, and
   swapped views give the inverse: R the transpose, bit for bit, and t = -R^T t.
   options: null means the defaults.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS, TV_ERR_CAMERA,
   TV_ERR_NOT_FINITE (options only). TV_ERR_LIMITS is returned for more matches than the context's
   max_matches: which of them to leave out is the caller's choice, for ratios may be null and
   inlier_mask speaks of all matches. tv_reconstruct leaves out those of the highest ratio.
   Time: at most max_iterations samples, each of at most 10 models scored on num_matches. */
TV_API tv_status tv_estimate_two_view(tv_context *context, const tv_camera *camera0,
                                      const tv_camera *camera1, const double *pixels0,
                                      const double *pixels1, const float *ratios,
                                      int32_t num_matches, const tv_estimate_options *options,
                                      tv_two_view *result, uint8_t *inlier_mask);

TV_END_DECLS

#endif
