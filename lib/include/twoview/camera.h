/* twoview: camera models, from pixels to rays and back.

   D. C. Brown, "Close-range camera calibration", 1971; J. Kannala, S. Brandt, "A generic camera model and
   calibration method", PAMI 2006. Formulas and tests: docs/algorithms/camera.md. */
#ifndef TWOVIEW_CAMERA_H
#define TWOVIEW_CAMERA_H

#include <stdint.h>

#include "twoview/status.h"

TV_BEGIN_DECLS

/* With (x, y) = (X/Z, Y/Z), r the length of (x, y), theta = atan(r), s the Brown-Conrady factor:
   the distorted (x', y') is mapped to pixels (fx x' + cx, fy y' + cy). */
typedef enum tv_camera_model {
  TV_CAMERA_PINHOLE = 0,       /* no distortion; k is ignored */
  TV_CAMERA_BROWN_CONRADY = 1, /* k = k1 k2 p1 p2 k3 [k4 k5 k6], OpenCV's order and formula */
  TV_CAMERA_KANNALA_BRANDT = 2 /* k = k1..k4: theta (1 + k1 theta^2 + .. + k4 theta^8), OpenCV fisheye */
} tv_camera_model;

/* Pixel (0,0) is the centre of the top-left pixel (OpenCV, ROS, Kalibr; COLMAP's origin is half a
   pixel up and left: its cx, cy are ours + 0.5). */
typedef struct tv_camera {
  int32_t model;         /* a tv_camera_model */
  int32_t width, height; /* of the image, pixels, >= 1; the verdict needs them, too */
  int32_t reserved;      /* 0 */
  double fx, fy;         /* focal lengths, pixels, > 0 */
  double cx, cy;         /* principal point, pixels */
  double k[8];           /* distortion, as the model says; unused ones 0 */
} tv_camera;

/* TV_OK, or TV_ERR_NULL, or TV_ERR_CAMERA: unknown model, size below 1, fx or fy not above 0, a
   number that is not finite.
   The functions below find the valid region anew at each call (about 10 microseconds with
   distortion on a desktop core); those that take many points find it once. */
TV_API tv_status tv_camera_check(const tv_camera *camera);

/* The model is used only where its distortion is monotonic: up to this angle (radians) off the
   optical axis, found from the derivative's first zero, and bounded by what 64-bit Newton can
   invert. Writes *angle_rad in [0, pi/2] (pi for Kannala-Brandt); 0 for a
   distortion so strong that no ray is left. Returns TV_ERR_NULL, TV_ERR_CAMERA. */
TV_API tv_status tv_camera_valid_angle(const tv_camera *camera, double *angle_rad);

/* Pixel of a point (or ray) in the camera frame (x right, y down, z forward).
   jacobian: null, or 2x3 row-major d pixel / d point.
   Returns TV_ERR_CAMERA, TV_ERR_NOT_FINITE, TV_ERR_OUTSIDE (behind the camera, beyond the valid angle,
   or a result that is too large for a double). */
TV_API tv_status tv_camera_project(const tv_camera *camera, const double point[3], double pixel[2],
                                   double *jacobian);

/* The pixels of many points, the valid region found once: num_points x 3 in, num_points x 2 out.
   inside: num_points bytes, 1 where the point has a pixel; else 0 and the pixel is zeros (behind the
   camera, beyond the valid angle, or not finite).
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (num_points below 0), TV_ERR_CAMERA, TV_ERR_OVERLAP. */
TV_API tv_status tv_camera_project_points(const tv_camera *camera, const double *points,
                                          int32_t num_points, double *pixels, uint8_t *inside);

/* Unit ray through a pixel, by Newton's method on the distortion.
   jacobian: null, or 3x2 row-major d ray / d pixel.
   Returns TV_ERR_CAMERA, TV_ERR_NOT_FINITE, TV_ERR_OUTSIDE (no ray within the valid angle meets the
   pixel). */
TV_API tv_status tv_camera_unproject(const tv_camera *camera, const double pixel[2], double ray[3],
                                     double *jacobian);

/* The unit rays of many pixels, the valid region found once: num_pixels x 2 in, num_pixels x 3 out.
   inside: num_pixels bytes, 1 where the pixel has a ray; else 0 and the ray is zeros.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (num_pixels below 0), TV_ERR_CAMERA, TV_ERR_OVERLAP. */
TV_API tv_status tv_camera_unproject_points(const tv_camera *camera, const double *pixels,
                                            int32_t num_pixels, double *rays, uint8_t *inside);

/* undistorted: the pixel where a camera without distortion and with the same fx fy cx cy would see what
   this one sees at `pixel`. Returns as tv_camera_unproject; TV_ERR_OUTSIDE also for rays at 90 degrees and
   more. */
TV_API tv_status tv_camera_undistort(const tv_camera *camera, const double pixel[2],
                                     double undistorted[2]);

/* The camera of an image that was scaled by `scale` in (0, 16]: f' = s f, c' = s (c + 0.5) - 0.5,
   width and height rounded to the nearest, at least 1.
   Returns TV_ERR_NULL, TV_ERR_CAMERA, TV_ERR_NOT_FINITE, TV_ERR_ARGUMENT (scale, or a result that no camera has). */
TV_API tv_status tv_camera_scale(const tv_camera *camera, double scale, tv_camera *scaled);

TV_END_DECLS

#endif
