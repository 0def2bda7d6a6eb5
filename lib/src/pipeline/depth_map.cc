#include "pipeline/depth_map.h"

#include <algorithm>
#include <cmath>

#include "dense/plane_sweep.h"
#include "triangulation/frame.h"
#include "twoview/context.h"

namespace tv {
namespace {

// How much wider the image's field is than that of a pinhole of the same focal length: the larger
// of the ratios in the middle and at the edges of the picture, [1, 2]. A lens that compresses the
// outer picture sees more. Beyond 2 the middle of the map would become too coarse.
double field_of(const Camera& lens, bool across) {
  constexpr double kMost = 2;
  const tv_camera& camera = lens.model;
  const double right = camera.width - 1, low = camera.height - 1;
  const double of_pinhole = across ? right / camera.fx : low / camera.fy;
  const double middle = across ? camera.cy : camera.cx, end = across ? low : right;
  double most = of_pinhole;
  for (int k = 0; k < 3; ++k) {
    const double along = k == 0 ? middle : k == 1 ? 0 : end;
    const Vec2 first = across ? Vec2(0, along) : Vec2(along, 0);
    const Vec2 last = across ? Vec2(right, along) : Vec2(along, low);
    Vec3 a, b;
    const int axis = across ? 0 : 1;
    if (!unproject(lens, first, &a, nullptr) || !unproject(lens, last, &b, nullptr) ||
        !(a[2] > 0 && b[2] > 0)) {
      if (k == 0) return kMost;
      continue;  // a corner beyond the lens's valid angle
    }
    most = std::max(most, b[axis] / b[2] - a[axis] / a[2]);
  }
  return std::min(most / of_pinhole, kMost);
}

Mat3 rotation_of(const tv_depth_view& view) { return matrix_of(view.world_from_cam_R); }

// R0' R1 for two rotations, row by row in a fixed order.
Mat3 transposed_times(const Mat3& a, const Mat3& b) {
  Mat3 product;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      product(r, c) = a(0, r) * b(0, c) + a(1, r) * b(1, c) + a(2, r) * b(2, c);
    }
  }
  return product;
}

// The centre of the reference minus that of the view, along the axes of the reference.
Vec3 shift_of(const tv_depth_view& reference, const tv_depth_view& view) {
  const Mat3 R = rotation_of(reference);
  double between[3];
  for (int i = 0; i < 3; ++i) {
    between[i] = reference.world_from_cam_t[i] - view.world_from_cam_t[i];
  }
  Vec3 shift;
  for (int c = 0; c < 3; ++c) {
    shift[c] = R(0, c) * between[0] + R(1, c) * between[1] + R(2, c) * between[2];
  }
  return shift;
}

Planes planes_of(const tv_depth_options& options, const MapGrid& grid, double longest) {
  const double first = 1 / options.far_depth, range = 1 / options.near_depth - first;
  const double pixels = std::min(range * grid.focal * longest, 1e6);
  constexpr int32_t kBlock = TVK_DENSE_BLOCK;
  const int32_t wanted = (static_cast<int32_t>(pixels) + 1 + kBlock) / kBlock * kBlock;
  const int32_t count = std::min(wanted, options.max_planes);
  return {first, range / (count - 1), count};
}

struct MapWriter {
  const tv_depth_arrays* arrays;
  MapGrid grid;
  double max_relative_sigma;
};

void write_row(void* user, int32_t y, const SweptPixel* row) {
  const MapWriter& writer = *static_cast<const MapWriter*>(user);
  const MapGrid& grid = writer.grid;
  const double v = (y - (grid.height - 1) * 0.5) / grid.focal;
  for (int32_t x = 0; x < grid.width; ++x) {
    const ptrdiff_t at = static_cast<ptrdiff_t>(y) * grid.width + x;
    const SweptPixel& pixel = row[x];
    const bool known =
        pixel.inverse_depth > 0 && pixel.sigma <= writer.max_relative_sigma * pixel.inverse_depth;
    const double u = (x - (grid.width - 1) * 0.5) / grid.focal;
    const double distance = known ? std::sqrt(u * u + v * v + 1) / pixel.inverse_depth : 0;
    writer.arrays->distance[at] = static_cast<float>(distance);
    writer.arrays->sigma[at] =
        static_cast<float>(known ? distance * (pixel.sigma / pixel.inverse_depth) : 0);
    writer.arrays->witnesses[at] = static_cast<uint8_t>(known ? pixel.witnesses : 0);
  }
}

}  // namespace

MapGrid depth_grid(const tv_camera& reference, const tv_depth_options& options) {
  tv_camera camera = reference;
  if (camera.model != TV_CAMERA_PINHOLE) {
    const Camera lens = prepare_camera(camera);
    const double across = field_of(lens, true), down = field_of(lens, false);
    camera.width = static_cast<int32_t>(camera.width * across);
    camera.height = static_cast<int32_t>(camera.height * down);
  }
  return map_grid_of(camera, options.max_pixels);
}

tv_camera map_camera_of(const MapGrid& grid) {
  tv_camera camera = {};
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = grid.width;
  camera.height = grid.height;
  camera.fx = camera.fy = grid.focal;
  camera.cx = (grid.width - 1) * 0.5;
  camera.cy = (grid.height - 1) * 0.5;
  return camera;
}

// Other views may be of any size, but only their reduced image takes memory, at most four times the
// samples of the view.
size_t sweep_depth_bytes(const tv_camera& camera, const tv_depth_options& options) {
  const MapGrid grid = depth_grid(camera, options);
  ParallelView reference, other;
  size_parallel_view(grid, false, &reference);
  size_parallel_view(grid, true, &other);
  const size_t others = static_cast<size_t>(options.max_views) - 1;
  return parallel_view_bytes(reference) + others * parallel_view_bytes(other) +
         std::max(std::max(parallel_view_scratch_bytes(reference, camera, grid),
                           parallel_view_scratch_bytes(other, camera, grid)),
                  sweep_planes_bytes(grid, options.max_planes, options.max_views - 1));
}

void sweep_depth(const tv_depth_view* views, int32_t num_views, const tv_depth_options& options,
                 Arena& arena, const tv_depth_arrays& arrays) {
  const MapGrid grid = depth_grid(*views[0].camera, options);
  const tvk_dense_table& kernels = *tvk_dense_of(tvk_select(TV_KERNELS_AUTO));
  const Mat3 axes = rotation_of(views[0]);
  ParallelView reference;
  SweptView others[TV_DEPTH_MAX_VIEWS - 1];
  double longest = 0;
  for (int32_t v = 0; v < num_views; ++v) {
    ParallelView& view = v == 0 ? reference : others[v - 1].view;
    size_parallel_view(grid, v > 0, &view);
    make_parallel_view(views[v].image, prepare_camera(*views[v].camera),
                       transposed_times(rotation_of(views[v]), axes), grid, kernels, arena, &view);
    if (v == 0) continue;
    const Vec3 shift = shift_of(views[0], views[v]);
    others[v - 1].shift = shift;
    longest = std::max(longest, std::sqrt(dot(shift, shift)));
  }
  MapWriter writer = {&arrays, grid, options.max_relative_sigma};
  const PlaneSweep sweep = {grid, planes_of(options, grid, longest), &reference, others,
                            num_views - 1};
  const SweptRows rows = {&writer, write_row};
  sweep_planes(sweep, kernels, rows, arena);
  if (arrays.grey != nullptr) {
    for (int32_t y = 0; y < grid.height; ++y) {
      const uint8_t* const from = reference.grey + static_cast<ptrdiff_t>(2 * y) * reference.width;
      uint8_t* const to = arrays.grey + static_cast<ptrdiff_t>(y) * grid.width;
      for (int32_t x = 0; x < grid.width; ++x) to[x] = from[2 * x];
    }
  }
}

}  // namespace tv
