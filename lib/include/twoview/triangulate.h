/* twoview: the point that two pixels see.

   The methods of R. Hartley, P. Sturm, "Triangulation", CVIU 1997, which the FAST-SIFT paper
   compared. Formulas and tests: docs/algorithms/triangulation.md. */
#ifndef TWOVIEW_TRIANGULATE_H
#define TWOVIEW_TRIANGULATE_H

#include "twoview/camera.h"
#include "twoview/two_view.h"

TV_BEGIN_DECLS

/* A triangulation method: each one is named with the quantity that it minimises. Errors in pixels
   are measured on the undistorted image, where a pixel is 1/fx wide and 1/fy high; for
   TV_CAMERA_KANNALA_BRANDT, which sees more than a half space, on the plane that touches the
   viewing sphere at the ray of the match, where a pixel has the side 1 / sqrt(fx fy). For a pinhole
   these are the errors of the textbook. No method depends on the length of t. */
typedef enum tv_triangulation {
  /* The sum of the squared distances from both pixels to the images of the point. The global
     minimum, which is the most likely point if the noise is Gaussian. */
  TV_TRIANGULATION_POLY = 0,
  /* The sum of the distances instead of their squares. The global minimum. */
  TV_TRIANGULATION_POLY_ABS = 1,
  /* The residual of the four linear equations over unit vectors (X, W); the point is X / W in the
     frame of camera 0. */
  TV_TRIANGULATION_LINEAR_EIGEN = 2,
  /* The residual of the same equations with W = 1. */
  TV_TRIANGULATION_LINEAR_LS = 3,
  /* As LINEAR_EIGEN, with the equations of each camera divided by the depth of the point in it,
     repeated up to ten times. If that does not converge, the result is that of LINEAR_EIGEN. */
  TV_TRIANGULATION_ITERATIVE_EIGEN = 4,
  /* As LINEAR_LS, repeated in the same way. The paper's choice and the default of tv_reconstruct.
   */
  TV_TRIANGULATION_ITERATIVE_LS = 5,
  /* The distances from the point to both rays: the middle of their shortest connection. */
  TV_TRIANGULATION_MIDPOINT = 6
} tv_triangulation;

/* What the position of a tv_point means. */
typedef enum tv_point_status {
  /* The position is a point in front of both cameras. */
  TV_POINT_OK = 0,
  /* The rays are parallel to the precision of a double, or the method's result is at infinity. The
     position is the unit vector of the direction in the frame of camera 0. */
  TV_POINT_INFINITE = 1,
  /* The rays meet behind a camera. The position is where they meet. */
  TV_POINT_BEHIND = 2,
  /* There is no point: a pixel has no ray in the lens model, a number is not finite, or the two
     rays point at each other along the baseline. The position is zero. */
  TV_POINT_INVALID = 3
} tv_point_status;

/* The point that was triangulated from one match. */
typedef struct tv_point {
  /* Position in the frame of camera 0, in the unit of t; status tells what it means. It is never
     NaN. */
  double position[3];
  /* Angle between the two rays in radians; 0 if the point is invalid. */
  float angle_rad;
  /* Root mean square, over the two images, of the distance in pixels between the pixel and the
     projection of the point (of its direction, for a point at infinity); 0 if the point is
     invalid. */
  float error_px;
  /* A tv_point_status. */
  int32_t status;
  /* Always 0. */
  int32_t reserved;
} tv_point;

/* Triangulates matches.
   pair: the cameras and the motion.
   pixels: the matched pixels; ratios and sigmas are not read. A pixel that is not finite makes its
   point TV_POINT_INVALID and is no error.
   points: room for pixels->num; it overlaps no other argument.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (the method, the count, R or t),
   TV_ERR_NOT_FINITE (R or t), TV_ERR_CAMERA, TV_ERR_OVERLAP. Needs no context. Thread-safe. */
TV_API tv_status tv_triangulate(const tv_camera_pair *pair, const tv_pixel_pairs *pixels,
                                tv_triangulation method, tv_point *points);

/* Moves the pixels of each match as little as possible so that their rays meet. "As little" is the
   sum of the squared distances for cost TV_TRIANGULATION_POLY and the sum of the distances for
   TV_TRIANGULATION_POLY_ABS; other costs are TV_ERR_ARGUMENT. Distances are measured as documented
   at tv_triangulation; the pixels themselves are distorted, before and after. The rays may meet
   behind a camera, which tv_triangulate reports.
   pair, pixels: as for tv_triangulate.
   corrected0, corrected1: room for pixels->num x 2; they overlap no other argument.
   valid: room for pixels->num bytes. A byte is 1 where the match was corrected. It is 0, and both
   pixels are (0, 0), where a pixel has no ray or is not finite, or where a corrected pixel would
   lie outside the valid region of its lens. Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE,
   TV_ERR_ARGUMENT (the cost, the count, R or t), TV_ERR_NOT_FINITE (R or t), TV_ERR_CAMERA,
   TV_ERR_OVERLAP. Needs no context. Thread-safe. */
TV_API tv_status tv_correct_matches(const tv_camera_pair *pair, const tv_pixel_pairs *pixels,
                                    tv_triangulation cost, double *corrected0, double *corrected1,
                                    uint8_t *valid);

TV_END_DECLS

#endif
