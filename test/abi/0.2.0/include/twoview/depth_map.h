/* twoview: the depth map of an image, from two to seven images whose poses are known.

   A plane of constant inverse depth is swept through the scene: for each pixel and each plane, the
   images are compared where they would show that pixel, semi-global matching chooses the plane, and
   how much better it is than the others tells the standard deviation. Sources: R. T. Collins, "A
   space-sweep approach to true multi-image matching", CVPR 1996; H. Hirschmueller, "Stereo
   processing by semiglobal matching and mutual information", PAMI 2008. Formulas and tests:
   docs/algorithms/depth_map.md.

   A library that was built with TWOVIEW_DENSE=OFF has none of these functions: the program does not
   link. */
#ifndef TWOVIEW_DEPTH_MAP_H
#define TWOVIEW_DEPTH_MAP_H

#include <stddef.h>
#include <stdint.h>

#include "twoview/camera.h"
#include "twoview/image.h"

TV_BEGIN_DECLS

/* The most views of tv_sweep_depth, the reference included. */
#define TV_DEPTH_MAX_VIEWS 7

/* Options of tv_sweep_depth. Filled by tv_depth_options_init. */
typedef struct tv_depth_options {
  /* The caller's sizeof, set by tv_depth_options_init. */
  uint32_t struct_size;
  /* The most pixels of the map, [1024, 4194304], default 200000. The map is as large as the
     reference image (tv_depth_map_camera), or reduced to so many pixels. Time and memory grow in
     proportion. */
  int32_t max_pixels;
  /* The most planes, [16, 256], default 96, rounded up to a multiple of 32. Two neighbouring
     planes are at most a pixel of the map apart in the image with the longest baseline, or farther
     where that would take more planes. Time and memory grow in proportion. */
  int32_t max_planes;
  /* The most views, [2, TV_DEPTH_MAX_VIEWS], default 5, the reference included. Memory and time
     grow in proportion. */
  int32_t max_views;
  /* The range of depth that is searched, along the optical axis of the reference, in the unit of
     the poses: 0 < near_depth < far_depth. No default: both are 0, which is refused. */
  double near_depth, far_depth;
  /* The largest standard deviation of a distance, as a share of the distance, of a pixel that is
     known; (0, 1], default 0.05. */
  double max_relative_sigma;
} tv_depth_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_depth_options_init. */
TV_API void tv_depth_options_init_sized(tv_depth_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_depth_options_init(options) tv_depth_options_init_sized((options), sizeof *(options))

/* An image with its camera and its pose. */
typedef struct tv_depth_view {
  /* The image, of the camera's size. Its pixels are read during the call only. */
  tv_image image;
  /* Any model; read during the call only. */
  const tv_camera *camera;
  /* The pose world_from_cam: x_world = R x_cam + t; R is a row-major 3x3 rotation to within 1e-6.
   */
  double world_from_cam_R[9], world_from_cam_t[3];
} tv_depth_view;

/* Where tv_sweep_depth writes. Each array has room for the pixels of the map (width x height of
   tv_depth_map_camera), row by row without gaps. */
typedef struct tv_depth_arrays {
  /* The distance from the camera's centre along the pixel's ray, in the unit of the poses; 0 where
     it is not known. */
  float *distance;
  /* The standard deviation of that distance, from the matching alone: the error of the poses is not
     part of it. 0 where the distance is not known. */
  float *sigma;
  /* How many of the other views show there what the reference shows. 0 where the distance is not
     known, or where it follows from its surroundings alone, as on a plain wall. */
  uint8_t *witnesses;
  /* The reference image as the map's camera would see it; 0 beyond its edges and nowhere else.
     Null: not wanted. */
  uint8_t *grey;
} tv_depth_arrays;

/* Writes the camera of the map to *map_camera: a pinhole with the reference's optical axis in the
   middle, of its aspect ratio and focal length but for the reduction. Where the lens bends lines
   outwards, the map is larger across, down or both by what the lens sees more than a pinhole at the
   image's edges, corners included, at most twice, before it is reduced. options: null means the
   defaults; near_depth and far_depth are not read. Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE,
   TV_ERR_ARGUMENT (an option), TV_ERR_NOT_FINITE (an option), TV_ERR_CAMERA. */
TV_API tv_status tv_depth_map_camera(const tv_camera *reference, const tv_depth_options *options,
                                     tv_camera *map_camera);

/* Writes to *size_bytes how much memory tv_sweep_depth needs for this reference and these options:
   75 MiB for the defaults and an image of 640 x 480. Statuses as tv_depth_map_camera. */
TV_API tv_status tv_depth_size(const tv_camera *reference, const tv_depth_options *options,
                               size_t *size_bytes);

/* Computes the depth of views[0] from all views. They should look at the same scene from centres
   that are 5 to 30 per cent of its depth away, best in different directions, and be turned by at
   most 20 degrees. A view from the same centre contributes nothing.
   memory: starts at a multiple of TV_CONTEXT_ALIGNMENT and has at least the bytes of tv_depth_size.
   Its contents before and after the call do not matter.
   views: num_views of them, [2, options->max_views]. options: not null, because of the range.
   arrays: what is written; nothing of it overlaps anything else (TV_ERR_OVERLAP).
   A pixel is unknown where fewer than two views show it, where the best plane is the first or the
   last one, and where the standard deviation is above max_relative_sigma.
   The result has the same bits on every CPU. Takes pixels x planes x views steps; 0.2 s for the
   defaults on a desktop core. Needs no context. Thread-safe.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (an option, the range, num_views, an
   image, R), TV_ERR_NOT_FINITE (an option, R or t), TV_ERR_CAMERA, TV_ERR_ALIGNMENT,
   TV_ERR_MEMORY, TV_ERR_OVERLAP. */
TV_API tv_status tv_sweep_depth(void *memory, size_t size_bytes, const tv_depth_view *views,
                                int32_t num_views, const tv_depth_options *options,
                                const tv_depth_arrays *arrays);

TV_END_DECLS

#endif
