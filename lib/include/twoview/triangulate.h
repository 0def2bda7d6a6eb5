/* twoview: points from two rays.

   The methods of R. Hartley, P. Sturm, "Triangulation", CVIU 1997, which the paper chose among. */
#ifndef TWOVIEW_TRIANGULATE_H
#define TWOVIEW_TRIANGULATE_H

#include "twoview/camera.h"

TV_BEGIN_DECLS

typedef enum tv_triangulation {
  TV_TRIANGULATION_POLY = 0,
  TV_TRIANGULATION_POLY_ABS = 1,
  TV_TRIANGULATION_LINEAR_EIGEN = 2,
  TV_TRIANGULATION_LINEAR_LS = 3,
  TV_TRIANGULATION_ITERATIVE_EIGEN = 4,
  TV_TRIANGULATION_ITERATIVE_LS = 5, /* the paper's choice, and the default */
  TV_TRIANGULATION_MIDPOINT = 6
} tv_triangulation;

typedef enum tv_point_status {
  TV_POINT_OK = 0,
  TV_POINT_INFINITE = 1, /* rays parallel within what a double can tell: position is the unit
                            direction in camera 0 */
  TV_POINT_BEHIND = 2,   /* the rays meet behind a camera: position is where */
  TV_POINT_INVALID = 3   /* no ray (pixel outside the lens model), input not finite, or opposed rays
                            along the baseline: zeros */
} tv_point_status;

typedef struct tv_point {
  double position[3]; /* camera 0 frame, in units of |t|; never NaN */
  float angle_rad;    /* between the two rays; 0 if invalid */
  float error_px;     /* root mean square over the two images of the distance between the pixel and
                         the point's projection; for a point at infinity, of its direction's
                         projection; 0 if invalid */
  int32_t status;     /* a tv_point_status */
  int32_t reserved;   /* 0 */
} tv_point;

/* Triangulates num_points matches. This release has LINEAR_LS, ITERATIVE_LS and MIDPOINT.
   cam1_from_cam0: x1 = R x0 + t; R row-major 3x3, a rotation to 1e-6; t not zero.
   pixels0, pixels1: num_points x 2 (x, y), distorted pixels as the image has them.
   points: the caller's array of num_points; overlaps neither pixels0 nor pixels1.
   A pixel that is not finite makes its point TV_POINT_INVALID, not an error.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (method, count, R, t), TV_ERR_NOT_FINITE (R, t),
   TV_ERR_CAMERA, TV_ERR_OVERLAP. Needs no context; thread-safe. */
TV_API tv_status tv_triangulate(tv_triangulation method, const tv_camera *camera0,
                                const tv_camera *camera1, const double R[9], const double t[3],
                                const double *pixels0, const double *pixels1, int32_t num_points,
                                tv_point *points);

TV_END_DECLS

#endif
