/* twoview: camera models, from pixels to rays and back.

   D. C. Brown, "Close-range camera calibration", 1971; J. Kannala, S. Brandt, "A generic camera
   model and calibration method", PAMI 2006. Formulas and tests: docs/algorithms/camera.md. */
#ifndef TWOVIEW_CAMERA_H
#define TWOVIEW_CAMERA_H

#include <stdint.h>

#include "twoview/status.h"

TV_BEGIN_DECLS

/* The lens model. A point (X, Y, Z) of the camera frame has (x, y) = (X/Z, Y/Z); r is the length of
   (x, y), and theta is the angle off the optical axis, which is atan(r) in front of the camera. The
   model maps (x, y) to the distorted (x', y'), and the pixel is (fx x' + cx, fy y' + cy). */
typedef enum tv_camera_model {
  /* No distortion: x' = x, y' = y. The coefficients k are ignored. */
  TV_CAMERA_PINHOLE = 0,
  /* Radial and tangential distortion; k holds k1 k2 p1 p2 k3 [k4 k5 k6] in the order and with the
     formula of OpenCV. */
  TV_CAMERA_BROWN_CONRADY = 1,
  /* Fisheye; k holds k1 k2 k3 k4. The distorted point lies in the direction of (X, Y), at the
     radius theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8), as in OpenCV's fisheye
     module. */
  TV_CAMERA_KANNALA_BRANDT = 2
} tv_camera_model;

/* The intrinsics of a camera. Pixel (0, 0) is the centre of the top-left pixel, as in OpenCV, ROS
   and Kalibr. COLMAP's origin is the corner of that pixel: add 0.5 to cx and cy for COLMAP. */
typedef struct tv_camera {
  /* A tv_camera_model. */
  int32_t model;
  /* Width of the image in pixels, at least 1. The verdict of an estimate depends on it. */
  int32_t width;
  /* Height of the image in pixels, at least 1. */
  int32_t height;
  /* Must be 0. */
  int32_t reserved;
  /* Focal lengths along x and y in pixels, above 0. */
  double fx, fy;
  /* The principal point in pixels. */
  double cx, cy;
  /* The distortion coefficients, in the order that the model documents; the unused ones are 0. */
  double k[8];
} tv_camera;

/* What of a given camera may be refined: bits of a mask. A bit is a permission. A camera is changed
   only where the matches are evidence enough against it, by the rule of the call that takes the
   mask, and the result says by how much. */
typedef enum tv_refine {
  /* The camera stays as it was given. */
  TV_REFINE_NOTHING = 0,
  /* fx and fy, by one factor. */
  TV_REFINE_FOCAL_LENGTH = 1 << 0,
  /* cx and cy. */
  TV_REFINE_PRINCIPAL_POINT = 1 << 1
} tv_refine;

/* How uncertain the calibration of a camera is, and what of it may be refined. Zeros: the camera is
   exact. The covariance of a pose contains what these standard deviations make of the pose, to
   first order; of what was refined, it contains what the matches leave. */
typedef struct tv_calibration {
  /* The standard deviation of fx and fy, one factor for both, relative to them, [0, 0.5]. 0.005
     suits a calibration of unknown quality, 0.1 a focal length from a data sheet. */
  double focal_sigma;
  /* The standard deviation of cx and of cy, in focal lengths, [0, 0.5]; at most 0.1 where the
     principal point may be refined. 0.005 suits a calibration of unknown quality. */
  double center_sigma;
  /* TV_REFINE_ bits. What has a standard deviation of 0 is exact, and is not refined. */
  uint32_t refine;
  /* Must be 0. */
  uint32_t reserved;
} tv_calibration;

/* Two cameras and the motion between them: all that a point's two pixels depend on. It holds its
   values and points to nothing, so that it may be kept and copied. tv_corrected_pair makes it from
   the result of an estimate; with a known motion, the caller fills every field. */
typedef struct tv_camera_pair {
  /* The cameras of image 0 and of image 1; any models. */
  tv_camera camera0, camera1;
  /* The motion: x1 = R x0 + t. R is a row-major 3x3 rotation to within 1e-6; t is not zero, and its
     unit is that of all points that are computed with it. */
  double cam1_from_cam0_R[9], cam1_from_cam0_t[3];
} tv_camera_pair;

/* Returns TV_OK where the camera is valid, else TV_ERR_NULL or TV_ERR_CAMERA. Every function that
   takes a camera checks it like this, except for tv_corrected_pair.
   The functions below compute the valid region of the lens model anew at each call, which takes
   about 10 microseconds for a distorted camera on a desktop core. Those that take many points do it
   once for all of them. Thread-safe, as all functions of this header. */
TV_API tv_status tv_camera_check(const tv_camera *camera);

/* Writes to *angle_rad the angle off the optical axis, in radians, up to which the lens model is
   used. It ends where the distortion stops being monotonic (the first zero of its derivative) or
   where Newton's method in 64 bits stops inverting it. The angle is in [0, pi/2], and in [0, pi]
   for Kannala-Brandt; 0 means that the distortion is so strong that no ray is valid. Returns
   TV_ERR_NULL, TV_ERR_CAMERA. */
TV_API tv_status tv_camera_valid_angle(const tv_camera *camera, double *angle_rad);

/* Writes to `pixel` the image of a point (or of a ray) of the camera frame: x right, y down, z
   forward. The unit of `point` does not matter.
   jacobian: null, or 6 numbers, the row-major 2x3 derivative of the pixel by the point.
   Returns TV_ERR_NULL, TV_ERR_CAMERA, TV_ERR_NOT_FINITE, TV_ERR_OUTSIDE (the point lies behind the
   camera or beyond the valid angle, or the result is too large for a double). */
TV_API tv_status tv_camera_project(const tv_camera *camera, const double point[3], double pixel[2],
                                   double *jacobian);

/* Projects many points and computes the valid region only once.
   points: num_points x 3; pixels: room for num_points x 2.
   inside: room for num_points bytes. A byte is 1 where the point has a pixel; else it is 0 and the
   pixel is (0, 0), because the point lies behind the camera, lies beyond the valid angle or is not
   finite.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (num_points below 0), TV_ERR_CAMERA, TV_ERR_OVERLAP. */
TV_API tv_status tv_camera_project_points(const tv_camera *camera, const double *points,
                                          int32_t num_points, double *pixels, uint8_t *inside);

/* Writes to `ray` the unit vector from the camera's centre through a pixel, in the camera frame,
   found by Newton's method on the distortion.
   jacobian: null, or 6 numbers, the row-major 3x2 derivative of the ray by the pixel.
   Returns TV_ERR_NULL, TV_ERR_CAMERA, TV_ERR_NOT_FINITE, TV_ERR_OUTSIDE (no ray within the valid
   angle meets the pixel). */
TV_API tv_status tv_camera_unproject(const tv_camera *camera, const double pixel[2], double ray[3],
                                     double *jacobian);

/* Writes the unit rays of many pixels and computes the valid region only once.
   pixels: num_pixels x 2; rays: room for num_pixels x 3.
   inside: room for num_pixels bytes. A byte is 1 where the pixel has a ray; else it is 0 and the
   ray is (0, 0, 0). Returns TV_ERR_NULL, TV_ERR_ARGUMENT (num_pixels below 0), TV_ERR_CAMERA,
   TV_ERR_OVERLAP. */
TV_API tv_status tv_camera_unproject_points(const tv_camera *camera, const double *pixels,
                                            int32_t num_pixels, double *rays, uint8_t *inside);

/* Writes to `undistorted` the pixel at which a camera without distortion, with the same fx, fy, cx
   and cy, would see what this camera sees at `pixel`.
   Returns the statuses as tv_camera_unproject does; TV_ERR_OUTSIDE also for a ray that is 90
   degrees or more off the optical axis. */
TV_API tv_status tv_camera_undistort(const tv_camera *camera, const double pixel[2],
                                     double undistorted[2]);

/* Writes to `scaled` the camera of an image that was resized by the factor `scale` in (0, 16]: f' =
   scale f, c' = scale (c + 0.5) - 0.5; width and height are rounded to the nearest, and at least 1.
   `scaled` may be the camera itself.
   Returns TV_ERR_NULL, TV_ERR_CAMERA, TV_ERR_NOT_FINITE, TV_ERR_ARGUMENT (the scale is out of
   range, or the result is no valid camera). */
TV_API tv_status tv_camera_scale(const tv_camera *camera, double scale, tv_camera *scaled);

TV_END_DECLS

#endif
