// The depth map of a view from several: the grid of the map, the views resampled to it
// (dense/parallel_view.h), and the planes that are swept (dense/plane_sweep.h).
#pragma once

#include "dense/parallel_view.h"
#include "twoview/depth_map.h"

namespace tv {

// The grid of at most max_pixels pixels that shows what the image shows, to its corners.
MapGrid depth_grid(const tv_camera& reference, const tv_depth_options& options);

// The pinhole camera of a map.
tv_camera map_camera_of(const MapGrid& grid);

// Bytes of arena that sweep_depth takes with this camera's view as the reference.
size_t sweep_depth_bytes(const tv_camera& reference, const tv_depth_options& options);

// Fills the arrays. All arguments are checked; options.max_planes is a multiple of TVK_DENSE_BLOCK.
void sweep_depth(const tv_depth_view* views, int32_t num_views, const tv_depth_options& options,
                 Arena& arena, const tv_depth_arrays& arrays);

}  // namespace tv
