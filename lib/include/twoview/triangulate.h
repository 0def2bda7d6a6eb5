/* twoview: points from two rays.

   The methods of R. Hartley, P. Sturm, "Triangulation", CVIU 1997, which the paper chose among.
   Formulas and tests: docs/algorithms/triangulation.md. */
#ifndef TWOVIEW_TRIANGULATE_H
#define TWOVIEW_TRIANGULATE_H

#include "twoview/camera.h"

TV_BEGIN_DECLS

/* What a method makes least. A pixel's error is measured on the undistorted image, where a pixel is
   1/fx by 1/fy; for TV_CAMERA_KANNALA_BRANDT, which sees beyond a half space, on the plane that
   touches the viewing sphere at the match's own ray, where a pixel is 1 / sqrt(fx fy). They
   are the textbook's pixels for a pinhole. Lengths are in units of |t|: no method depends on it. */
typedef enum tv_triangulation {
  TV_TRIANGULATION_POLY = 0,     /* squared distances from both pixels to the point's images: the
                                    global minimum, the most likely point under normal noise */
  TV_TRIANGULATION_POLY_ABS = 1, /* the distances instead of their squares, the global minimum */
  TV_TRIANGULATION_LINEAR_EIGEN = 2,    /* the four linear equations over unit vectors (X, W), X / W
                                           the point; counts from camera 0 */
  TV_TRIANGULATION_LINEAR_LS = 3,       /* the same equations with W = 1 */
  TV_TRIANGULATION_ITERATIVE_EIGEN = 4, /* LINEAR_EIGEN with each camera's equations divided by the
                                           point's depth in it, again up to ten times; the linear
                                           answer when that does not settle */
  TV_TRIANGULATION_ITERATIVE_LS = 5,    /* LINEAR_LS so repeated; the paper's choice, the default */
  TV_TRIANGULATION_MIDPOINT = 6         /* the distances from the point to both rays */
} tv_triangulation;

/* What a point's position is. */
typedef enum tv_point_status {
  TV_POINT_OK = 0,       /* in front of both cameras: position is the point */
  TV_POINT_INFINITE = 1, /* rays parallel within what a double can tell, or the method's answer at
                            infinity: position is the unit direction in camera 0 */
  TV_POINT_BEHIND = 2,   /* the rays meet behind a camera: position is where */
  TV_POINT_INVALID = 3   /* no ray (pixel outside the lens model), input not finite, or opposed rays
                            along the baseline: zeros */
} tv_point_status;

/* What is known of the point that one match sees. */
typedef struct tv_point {
  double position[3]; /* camera 0 frame, in units of |t|; never NaN */
  float angle_rad;    /* between the two rays; 0 if invalid */
  float error_px;     /* root mean square over the two images of the distance between the pixel and
                         the point's projection; for a point at infinity, of its direction's
                         projection; 0 if invalid */
  int32_t status;     /* a tv_point_status */
  int32_t reserved;   /* 0 */
} tv_point;

/* Triangulates num_points matches.
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

/* Moves the pixels of num_points matches to where their rays meet, by the least sum of squared
   distances (cost TV_TRIANGULATION_POLY) or of distances (TV_TRIANGULATION_POLY_ABS) that does it.
   Pixels are distorted, in and out; the distances are those described at tv_triangulation.
   Whether the rays then meet in front of the cameras is tv_triangulate's to say.
   Cameras, R, t and pixels as for tv_triangulate.
   corrected0, corrected1: num_points x 2; may not overlap anything else.
   valid: num_points bytes, 1 where the match was corrected; else 0 and both pixels are zeros (a
   pixel without a ray or not finite, or a correction that leaves the lens's valid region).
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (cost, count, R, t), TV_ERR_NOT_FINITE (R, t),
   TV_ERR_CAMERA, TV_ERR_OVERLAP. Needs no context; thread-safe. */
TV_API tv_status tv_correct_matches(tv_triangulation cost, const tv_camera *camera0,
                                    const tv_camera *camera1, const double R[9], const double t[3],
                                    const double *pixels0, const double *pixels1,
                                    int32_t num_points, double *corrected0, double *corrected1,
                                    uint8_t *valid);

TV_END_DECLS

#endif
