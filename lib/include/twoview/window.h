/* twoview: bundle adjustment of a window, that is of several views and the points they see.

   B. Triggs, P. McLauchlan, R. Hartley, A. Fitzgibbon, "Bundle adjustment: a modern synthesis",
   1999. Formulas and tests: docs/algorithms/window.md. */
#ifndef TWOVIEW_WINDOW_H
#define TWOVIEW_WINDOW_H

#include <stddef.h>

#include "twoview/bundle.h"
#include "twoview/camera.h"

TV_BEGIN_DECLS

/* The most views of a window. */
#define TV_WINDOW_MAX_VIEWS 256
/* The most points of a window. */
#define TV_WINDOW_MAX_POINTS 1000000
/* The most observations of a window. */
#define TV_WINDOW_MAX_OBSERVATIONS 4000000

/* A view of a window: its pose is the start before the call and the result after it. */
typedef struct tv_window_view {
  /* cam_from_world: x = R X + t. R is a row-major rotation to within 1e-6. */
  double R[9];
  /* The translation of cam_from_world, in the unit of the points. */
  double t[3];
  /* The index of its camera in tv_window.cameras. */
  int32_t idx_camera;
  /* 1: the pose is held; 0: it is adjusted. */
  int32_t fixed;
} tv_window_view;

/* A pixel at which a view sees a point. */
typedef struct tv_observation {
  /* The indices of the view and of the point. */
  int32_t idx_view, idx_point;
  /* x and y in pixels, distorted as in the image. */
  double pixel[2];
  /* The standard deviation of the pixel relative to that of the most precise pixels, [0.01, 1000];
     0 means 1. The residual is divided by it. */
  float sigma;
  /* Must be 0. */
  int32_t reserved;
} tv_observation;

/* What is known of a view's pose, apart from the observations. With (w, v) such that R x0 is
   exp([w]x) R0 and t is exp([w]x) t0 + v, the cost grows by (w v)' information (w v). */
typedef struct tv_pose_prior {
  /* The index of the view. A view may have several priors. */
  int32_t idx_view;
  /* Must be 0. */
  int32_t reserved;
  /* The known cam_from_world: a row-major rotation to within 1e-6, and its translation. */
  double R[9], t[3];
  /* The inverse of the covariance of (w0 w1 w2 v0 v1 v2), row-major, symmetric and not negative; in
     1 / radians^2 and 1 / units^2. Rows of zeros leave a parameter free. */
  double information[36];
} tv_pose_prior;

/* The direction of gravity that was measured in a view. The cost grows by the squared difference of
   the two unit vectors R world_down and down, divided by sigma_rad^2. */
typedef struct tv_gravity_prior {
  /* The index of the view. */
  int32_t idx_view;
  /* Must be 0. */
  int32_t reserved;
  /* The direction of gravity in the frame of the camera, of any length but 0. */
  double down[3];
  /* The standard deviation of the direction about each axis across it, [1e-6, 10] radians. */
  double sigma_rad;
} tv_gravity_prior;

/* A known distance between the centres of two views: it gives the map its metric scale. */
typedef struct tv_distance_prior {
  /* The indices of two different views. */
  int32_t idx_view0, idx_view1;
  /* The distance, 0 or more, and its standard deviation, above 0, in the unit of the map. */
  double distance, sigma;
} tv_distance_prior;

/* A window: what is adjusted, and what is known. Filled by tv_window_init with zeros and world_down
   (0, 1, 0). The arrays are the caller's; those with a count of 0 may be null. */
typedef struct tv_window {
  /* The caller's sizeof, set by tv_window_init. */
  uint32_t struct_size;
  /* How many cameras there are, [0, TV_WINDOW_MAX_VIEWS]. */
  int32_t num_cameras;
  /* How many views there are, [0, TV_WINDOW_MAX_VIEWS]. */
  int32_t num_views;
  /* How many points there are, [0, TV_WINDOW_MAX_POINTS]. */
  int32_t num_points;
  /* How many observations there are, [0, TV_WINDOW_MAX_OBSERVATIONS]. */
  int32_t num_observations;
  /* How many priors of each kind there are, [0, 4 TV_WINDOW_MAX_VIEWS]. */
  int32_t num_pose_priors, num_gravity_priors, num_distance_priors;
  /* num_cameras cameras; views may share one. */
  const tv_camera *cameras;
  /* num_views views: start and result. */
  tv_window_view *views;
  /* num_points x 3, positions in the world's frame and in the unit of the map, which is that of the
     views' t: start and result. */
  double *points;
  /* num_observations observations, in any order: the result does not depend on the order, except
     where a view has several observations of the same point. */
  const tv_observation *observations;
  /* The priors; each array has the count above. */
  const tv_pose_prior *pose_priors;
  /* See num_gravity_priors. */
  const tv_gravity_prior *gravity_priors;
  /* See num_distance_priors. */
  const tv_distance_prior *distance_priors;
  /* The direction of gravity in the world's frame, of any length but 0; read where there are
     gravity priors. */
  double world_down[3];
} tv_window;

/* Writes the default values into a struct of struct_size bytes; null is allowed. Programs call
   tv_window_init. */
TV_API void tv_window_init_sized(tv_window *window, size_t struct_size);
/* Writes zeros, world_down and struct_size; null is allowed. */
#define tv_window_init(window) tv_window_init_sized((window), sizeof *(window))

/* Options of tv_adjust_window. Filled by tv_window_options_init. */
typedef struct tv_window_options {
  /* The caller's sizeof, set by tv_window_options_init. */
  uint32_t struct_size;
  /* A tv_loss, default TV_LOSS_CAUCHY. Here it is the loss of an observation: s is the squared
     distance in one image, in units of the observation's sigma. */
  int32_t loss;
  /* The scale c of the loss in pixels, [1e-6, 1e9], default 2. A smaller value reduces the
     influence of more observations. */
  double loss_scale_px;
  /* The standard deviation of an observation of sigma 1 along each axis, in pixels, (0, 1e9],
     default 1. It weighs the observations against the priors: the cost is in pixels^2, and the
     terms of the priors are multiplied by noise_px^2. */
  double noise_px;
  /* The adjustment ends where the gain that is left is at most this share of the cost, [0, 0.1],
     default 1e-6. That gain is estimated from the last two steps, whose gains are taken to go on
     falling by the same factor. */
  double tolerance;
  /* The most steps that are tried, [0, 1000], default 50; 0 only measures the cost. */
  int32_t max_iterations;
  /* Must be 0. */
  int32_t reserved;
} tv_window_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_window_options_init. */
TV_API void tv_window_options_init_sized(tv_window_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_window_options_init(options) tv_window_options_init_sized((options), sizeof *(options))

/* What tv_adjust_window did. */
typedef struct tv_window_result {
  /* The caller's sizeof, set by tv_window_result_init. */
  uint32_t struct_size;
  /* How many views were adjusted, and how many points took part. */
  int32_t num_views, num_points;
  /* How many observations took part. The counts from here to num_single add up to the window's. */
  int32_t num_observations;
  /* How many were discarded because the point lies behind the camera at the start, or at a
     right angle or more to the pixel's ray. */
  int32_t num_behind;
  /* How many were discarded because the pixel has no ray in the lens model, or because the pixel or
     the point is not finite. */
  int32_t num_invalid;
  /* How many were discarded because, of the observations that are left, only one view has one of
     the point. */
  int32_t num_single;
  /* How many steps were tried. */
  int32_t num_iterations;
  /* 1 where the gain that is left is at most `tolerance` of the cost, or where no step, however
     short, lowers it; else 0. */
  uint8_t converged;
  /* 1 where covariances were requested and computed; 0 where they were not, or where the window
     does not determine them. */
  uint8_t has_covariance;
  /* 1 where no view is fixed and no view has a pose prior or a gravity prior: the first view that
     takes part was then held. */
  uint8_t held_first_view;
  /* 1 where nothing determines the scale: there are no distance priors, and together fewer than two
     fixed views and pose priors. */
  uint8_t scale_is_free;
  /* Always 0. */
  uint8_t reserved[4];
  /* The sum of rho over the observations and of the terms of the priors, in pixels^2, before and
     after. */
  double initial_cost, final_cost;
  /* The root mean square, over the observations that took part, of the distance along one axis, in
     units of sigma and without the loss, before and after. */
  double initial_rms_px, rms_px;
  /* The standard deviation of an observation of sigma 1 along one axis, estimated from the
     residuals and robust as the loss is (Huber 1981), in pixels. 0 where the observations are too
     few, or where no covariances were requested. */
  double noise_px;
} tv_window_result;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_window_result_init. */
TV_API void tv_window_result_init_sized(tv_window_result *result, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_window_result_init(result) tv_window_result_init_sized((result), sizeof *(result))

/* Writes to *size_bytes how much memory tv_adjust_window needs for a window of these counts, and so
   for each one with no larger counts: about 250 bytes for each observation, 160 for each point, and
   144 for the square of the number of views. Only the counts are read, the arrays may be null.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (a count is out of its range). */
TV_API tv_status tv_adjust_window_size(const tv_window *window, size_t *size_bytes);

/* Minimises the sum of rho over the observations and of the terms of the priors, over the poses of
   the views that are not fixed and over the points, by the Levenberg-Marquardt method with the
   points eliminated (the Schur complement). A point whose rays diverge, so that no finite place
   fits, ends at 1e6 times the distance between the views that see it.
   The distance between a pixel and the image of its point is measured in pixels, with the lens
   model linearised at the pixel: exact for TV_CAMERA_PINHOLE, to first order in the distance for
   the other models.
   An observation takes part if its pixel has a ray, its point is finite and in front of the camera
   at the start, and another view has such an observation of the point. Points and views of which no
   observation takes part stay as they are; a view that has priors is adjusted to them.
   Where nothing determines the window's position and attitude, the first view is held
   (held_first_view). Where nothing determines the scale, or the heading of a window with gravity
   priors alone, the damping of the steps keeps them near the start.
   memory: at least as many bytes as tv_adjust_window_size reports, at a multiple of
   TV_CONTEXT_ALIGNMENT. Its contents before and after the call do not matter.
   window: what is adjusted, initialised by tv_window_init.
   options: null means the defaults.
   covariances: null, or room for num_views x 36, a row-major 6x6 for each view in the parameters
   (w, v) with x_true = exp([w]x) x + v for a point x in the frame of the camera, in radians and
   units of the map. They are marginal over all other views and points, scaled by the estimated
   noise, and zero for held views, for views that take no part, and where has_covariance is 0. Where
   nothing determines the window's position, they are relative to the first view that takes part,
   and where nothing determines its scale, to the distance from the first held view to the view that
   is farthest from it.
   errors_px: null, or room for num_observations: the distance in pixels of each observation that
   took part, after the adjustment, and -1 for each one that was discarded.
   result: null, or initialised by tv_window_result_init.
   No output overlaps another argument. Equal inputs give equal bytes on every CPU.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (a count, an index, a rotation, a prior,
   a sigma or an option is out of its range, or a field that must be 0 is not), TV_ERR_NOT_FINITE
   (a pose, a prior, a sigma, an option, or the cost at the start), TV_ERR_CAMERA, TV_ERR_OVERLAP,
   TV_ERR_ALIGNMENT, TV_ERR_MEMORY.
   Time: at most max_iterations steps, each at most in proportion to observations x views, plus
   views^3. Needs no context. Thread-safe: the memory is the only state. */
TV_API tv_status tv_adjust_window(void *memory, size_t size_bytes, const tv_window *window,
                                  const tv_window_options *options, double *covariances,
                                  float *errors_px, tv_window_result *result);

TV_END_DECLS

#endif
