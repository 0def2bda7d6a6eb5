/* twoview: a dense cloud of two images whose motion is known.

   Both images are resampled along their common epipolar planes, semi-global matching finds the
   parallax of each cell of that grid, and least-squares matching refines it and tells its standard
   deviation. Sources: M. Pollefeys, R. Koch, L. Van Gool, "A simple and efficient rectification
   method for general motion", ICCV 1999; H. Hirschmueller, "Stereo processing by semiglobal
   matching and mutual information", PAMI 2008. Formulas and tests: docs/algorithms/dense.md.

   A library that was built with TWOVIEW_DENSE=OFF has none of these functions: the program does not
   link. */
#ifndef TWOVIEW_DENSE_H
#define TWOVIEW_DENSE_H

#include <stddef.h>
#include <stdint.h>

#include "twoview/camera.h"
#include "twoview/image.h"
#include "twoview/triangulate.h"

TV_BEGIN_DECLS

/* Options of tv_densify. Filled by tv_dense_options_init. Parallax is the angle, in radians,
   between the rays of both cameras to a point. */
typedef struct tv_dense_options {
  /* The caller's sizeof, set by tv_dense_options_init. */
  uint32_t struct_size;
  /* The most cells of the grid, [1024, 16777216], default 400000. A cell is as large as a pixel
     at the image's centre, or larger where the grid would have more cells. Time and memory grow in
     proportion. */
  int32_t max_cells;
  /* The most steps of parallax that are compared for a cell, [16, 512], default 256, rounded up
     to a multiple of 32. A step is as wide as a cell; where the range of parallax has more steps,
     all cells are larger. Time and memory grow in proportion. */
  int32_t max_steps;
  /* How many points `sparse` has, at least 0; default 0. */
  int32_t num_sparse;
  /* Points of the same cameras and motion, as tv_triangulate and tv_reconstruct give them: those of
     status TV_POINT_OK give the range of parallax. Null (default): none. They are read during the
     call only, and not by tv_dense_size. */
  const tv_point *sparse;
  /* The range of parallax that is searched, in radians, [0, pi]. With a max_parallax_rad of 0
     (default) the range comes from `sparse`; where that has no point of status TV_POINT_OK, the
     range begins at 0. */
  double min_parallax_rad, max_parallax_rad;
  /* The largest standard deviation of a point's distance, as a share of the distance, of a point
     that is returned; (0, 1], default 0.05. */
  double max_relative_sigma;
} tv_dense_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_dense_options_init. */
TV_API void tv_dense_options_init_sized(tv_dense_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_dense_options_init(options) tv_dense_options_init_sized((options), sizeof *(options))

/* A point of a dense cloud. */
typedef struct tv_dense_point {
  /* Position in the frame of camera 0, in the unit of t; in front of both cameras. */
  float position[3];
  /* Where image 0 and image 1 show it, in pixels, distorted as the images are. */
  float pixel0[2], pixel1[2];
  /* The standard deviation of the distance from camera 0, in the unit of t, that the noise of the
     matching causes. The error of the pose is not part of it. */
  float sigma;
  /* How alike the windows around both pixels are: their correlation, in (0, 1]. It is near 1
     where neither has texture: the parallax is then what the surroundings have, with a larger
     sigma. */
  float similarity;
  /* Image 0 at the nearest pixel, [0, 255]. */
  int32_t grey;
} tv_dense_point;

/* Writes to *size_bytes how much memory tv_densify needs for images of these sizes (width and
   height of each camera). options: null means the defaults. The number depends on the sizes, on the
   options and on the library's version alone: about 7 MB for the defaults and images of 640 x 480.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (an option), TV_ERR_NOT_FINITE (an
   option), TV_ERR_CAMERA. */
TV_API tv_status tv_dense_size(const tv_camera *camera0, const tv_camera *camera1,
                               const tv_dense_options *options, size_t *size_bytes);

/* Computes up to cap_points points that both images show.
   memory: starts at a multiple of TV_CONTEXT_ALIGNMENT and has at least the bytes of tv_dense_size.
   Its contents before and after the call do not matter.
   pair: the cameras, of any model, and the motion: with a result of tv_estimate_two_view or
   tv_reconstruct, the pair of tv_corrected_pair. Any motion will do, forward and backward, too;
   near an epipole, where there is no parallax, there are no points.
   images: image 0 and image 1, of the width and height of their cameras (else TV_ERR_CAMERA), at
   most 16384 a side.
   options: null means the defaults.
   points: room for cap_points. *num_points is how many were written; where more were found, those
   that are returned are spread evenly over them. The order is along the epipolar planes. Points and
   num_points overlap nothing else (TV_ERR_OVERLAP).
   A cell gives no point where the images do not overlap, where the winner of the matching is at an
   end of the range, is hardly better than another step, is not that of the opposite direction (from
   image 1 to image 0) or has few neighbours of like parallax, where the windows are not alike, or
   where the standard deviation is above max_relative_sigma. The result has the same bits on every
   CPU. Takes at most max_cells x max_steps steps; about 0.05 s for 370 000 cells and 96 steps on a
   desktop core. Needs no context. Thread-safe. Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE,
   TV_ERR_ARGUMENT (an option, a count, an image, R or t), TV_ERR_NOT_FINITE (an option, R or t),
   TV_ERR_CAMERA, TV_ERR_ALIGNMENT, TV_ERR_MEMORY, TV_ERR_OVERLAP. */
TV_API tv_status tv_densify(void *memory, size_t size_bytes, const tv_camera_pair *pair,
                            const tv_image images[2], const tv_dense_options *options,
                            tv_dense_point *points, int32_t cap_points, int32_t *num_points);

TV_END_DECLS

#endif
