// Images resampled to cameras whose axes are parallel to those of the reference, and their census:
// between parallel cameras a plane of equal depth is a shift and a scale of the picture.
// docs/algorithms/depth_map.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "geometry/camera.h"
#include "kernels/dense.h"
#include "twoview/image.h"

namespace tv {

// The pinhole of a depth map, square pixels, with the optical axis in the middle.
struct MapGrid {
  int32_t width, height;
  double focal;  // pixels
};

// The grid of at most max_pixels pixels that covers the middle of what the camera sees.
MapGrid map_grid_of(const tv_camera& camera, int32_t max_pixels);

inline constexpr uint32_t kNoCensus = TVK_SWEEP_NONE;

// A view at twice the resolution of the map and with a margin around it. The element (x, y) belongs
// to the pixel (x / 2 - margin_x, y / 2 - margin_y) of the map; each is the mean of 2 x 2 samples,
// so that it is as sharp as a pixel of the map.
struct ParallelView {
  int32_t width, height, margin_x, margin_y;
  uint8_t* grey;     // 0: no pixel; others are at least 1
  uint32_t* census;  // kNoCensus where the window is not wholly inside; has room for a block more
};

// The size of a view of the grid; with_margin: a quarter of the map on each side.
void size_parallel_view(const MapGrid& grid, bool with_margin, ParallelView* view);

// Bytes of arena that make_parallel_view takes for good, and besides while it runs.
size_t parallel_view_bytes(const ParallelView& view);
size_t parallel_view_scratch_bytes(const ParallelView& view, const tv_camera& camera,
                                   const MapGrid& grid);

// Resamples the image. cam_from_map: the rotation from the axes of the map to those of the camera.
void make_parallel_view(const tv_image& image, const Camera& camera, const Mat3& cam_from_map,
                        const MapGrid& grid, const tvk_dense_table& kernels, Arena& arena,
                        ParallelView* view);

}  // namespace tv
