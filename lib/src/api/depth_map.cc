// The entry points of the depth map: they validate, and call the stages of lib/src/dense.
#include "twoview/depth_map.h"

#include <algorithm>
#include <cmath>

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "dense/parallel_view.h"
#include "dense/plane_sweep.h"
#include "geometry/essential.h"
#include "triangulation/frame.h"

namespace tv {
namespace {

constexpr int32_t kMaxSide = 16384;
constexpr tv_depth_options kDefaults = {sizeof(tv_depth_options), 200000, 96, 5, 0.0, 0.0, 0.05};

// The options without the range.
tv_status read_options(const tv_depth_options* given, tv_depth_options* options) {
  *options = kDefaults;
  const tv_status status = read_sized(given, options);
  if (status != TV_OK) return status;
  if (!is_finite(options->near_depth) || !is_finite(options->far_depth) ||
      !is_finite(options->max_relative_sigma)) {
    return TV_ERR_NOT_FINITE;
  }
  const bool valid = within(options->max_pixels, 1024, 1 << 22) &&
                     within(options->max_planes, 16, 256) &&
                     within(options->max_views, 2, TV_DEPTH_MAX_VIEWS) &&
                     options->max_relative_sigma > 0 && options->max_relative_sigma <= 1;
  constexpr int32_t kBlock = TVK_DENSE_BLOCK;
  options->max_planes = (options->max_planes + kBlock - 1) / kBlock * kBlock;
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_reference(const tv_camera* camera) {
  const tv_status status = tv_camera_check(camera);
  if (status != TV_OK) return status;
  return camera->width > kMaxSide || camera->height > kMaxSide ? TV_ERR_CAMERA : TV_OK;
}

// How many times as far as through a pinhole of the camera's focal length things lie apart that the
// image shows at two opposite edges, in their middle or in the corners, [1, 2]: a lens that bends
// lines outwards sees more. Beyond twice, the middle of the map would become too coarse.
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

// The grid of at most max_pixels pixels that shows what the image shows, to its corners.
MapGrid grid_of(tv_camera camera, const tv_depth_options& options) {
  if (camera.model != TV_CAMERA_PINHOLE) {
    const Camera lens = prepare_camera(camera);
    const double across = field_of(lens, true), down = field_of(lens, false);
    camera.width = static_cast<int32_t>(camera.width * across);
    camera.height = static_cast<int32_t>(camera.height * down);
  }
  return map_grid_of(camera, options.max_pixels);
}

// The bytes of the stages for a view of this camera as the reference; other views may be up to
// kMaxSide pixels large, but only their reduced image takes memory, at most four times the
// samples of the view.
size_t depth_bytes(const tv_camera& camera, const tv_depth_options& options) {
  const MapGrid grid = grid_of(camera, options);
  ParallelView reference, other;
  size_parallel_view(grid, false, &reference);
  size_parallel_view(grid, true, &other);
  const size_t others = static_cast<size_t>(options.max_views) - 1;
  return parallel_view_bytes(reference) + others * parallel_view_bytes(other) +
         std::max(std::max(parallel_view_scratch_bytes(reference, camera, grid),
                           parallel_view_scratch_bytes(other, camera, grid)),
                  sweep_planes_bytes(grid, options.max_planes, options.max_views - 1));
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

tv_status check_view(const tv_depth_view& view) {
  if (view.camera == nullptr || view.image.data == nullptr) return TV_ERR_NULL;
  tv_status status = check_reference(view.camera);
  if (status == TV_OK) status = check_camera_image(*view.camera, view.image);
  if (status != TV_OK) return status;
  if (!all_finite(view.world_from_cam_R, 9) || !all_finite(view.world_from_cam_t, 3)) {
    return TV_ERR_NOT_FINITE;
  }
  return is_rotation(view.world_from_cam_R) ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_overlap(const tv_depth_view* views, int32_t num_views, size_t pixels,
                        const tv_depth_arrays& arrays, void* memory, size_t size_bytes) {
  Bytes bytes[5 + TV_DEPTH_MAX_VIEWS] = {{arrays.distance, pixels * sizeof(float)},
                                         {arrays.sigma, pixels * sizeof(float)},
                                         {arrays.witnesses, pixels},
                                         {arrays.grey, arrays.grey == nullptr ? 0 : pixels},
                                         {memory, size_bytes}};
  for (int32_t v = 0; v < num_views; ++v) {
    bytes[5 + v] = {views[v].image.data, image_bytes(views[v].image)};
  }
  return outputs_overlap(bytes, 5, 5 + num_views) ? TV_ERR_OVERLAP : TV_OK;
}

Mat3 rotation_of(const tv_depth_view& view) {
  Mat3 R;
  for (int i = 0; i < 9; ++i) R(i / 3, i % 3) = view.world_from_cam_R[i];
  return R;
}

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
}  // namespace tv

void tv_depth_options_init_sized(tv_depth_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

tv_status tv_depth_map_camera(const tv_camera* reference, const tv_depth_options* options,
                              tv_camera* map_camera) {
  if (reference == nullptr || map_camera == nullptr) return TV_ERR_NULL;
  tv_depth_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status == TV_OK) status = tv::check_reference(reference);
  if (status == TV_OK) {
    *map_camera = tv::map_camera_of(tv::grid_of(*reference, checked));
  }
  return status;
}

tv_status tv_depth_size(const tv_camera* reference, const tv_depth_options* options,
                        size_t* size_bytes) {
  if (reference == nullptr || size_bytes == nullptr) return TV_ERR_NULL;
  tv_depth_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status == TV_OK) status = tv::check_reference(reference);
  if (status == TV_OK) *size_bytes = tv::depth_bytes(*reference, checked);
  return status;
}

tv_status tv_sweep_depth(void* memory, size_t size_bytes, const tv_depth_view* views,
                         int32_t num_views, const tv_depth_options* options,
                         const tv_depth_arrays* arrays) {
  if (views == nullptr || options == nullptr || memory == nullptr || arrays == nullptr ||
      arrays->distance == nullptr || arrays->sigma == nullptr || arrays->witnesses == nullptr) {
    return TV_ERR_NULL;
  }
  tv_depth_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status != TV_OK) return status;
  if (!(checked.near_depth > 0 && checked.near_depth < checked.far_depth) ||
      !tv::within(num_views, 2, checked.max_views)) {
    return TV_ERR_ARGUMENT;
  }
  for (int32_t v = 0; v < num_views && status == TV_OK; ++v) status = tv::check_view(views[v]);
  if (status != TV_OK) return status;
  for (int32_t v = 1; v < num_views; ++v) {
    if (views[v].camera->width != views[0].camera->width ||
        views[v].camera->height != views[0].camera->height) {
      return TV_ERR_CAMERA;
    }
  }
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < tv::depth_bytes(*views[0].camera, checked)) return TV_ERR_MEMORY;
  const tv::MapGrid grid = tv::grid_of(*views[0].camera, checked);
  const size_t pixels = static_cast<size_t>(grid.width) * static_cast<size_t>(grid.height);
  status = tv::check_overlap(views, num_views, pixels, *arrays, memory, size_bytes);
  if (status != TV_OK) return status;

  const tvk_dense_table& kernels = *tvk_dense_of(tvk_select(TV_KERNELS_AUTO));
  tv::Arena arena = tv::arena_over(memory, size_bytes);
  const tv::Mat3 axes = tv::rotation_of(views[0]);
  tv::ParallelView reference;
  tv::SweptView others[TV_DEPTH_MAX_VIEWS - 1];
  double longest = 0;
  for (int32_t v = 0; v < num_views; ++v) {
    tv::ParallelView& view = v == 0 ? reference : others[v - 1].view;
    tv::size_parallel_view(grid, v > 0, &view);
    tv::make_parallel_view(views[v].image, tv::prepare_camera(*views[v].camera),
                           tv::transposed_times(tv::rotation_of(views[v]), axes), grid, kernels,
                           arena, &view);
    if (v == 0) continue;
    const tv::Vec3 shift = tv::shift_of(views[0], views[v]);
    others[v - 1].shift = shift;
    longest = std::max(longest, std::sqrt(tv::dot(shift, shift)));
  }
  tv::MapWriter writer = {arrays, grid, checked.max_relative_sigma};
  const tv::PlaneSweep sweep = {grid, tv::planes_of(checked, grid, longest), &reference, others,
                                num_views - 1};
  const tv::SweptRows rows = {&writer, tv::write_row};
  tv::sweep_planes(sweep, kernels, rows, arena);
  if (arrays->grey != nullptr) {
    for (int32_t y = 0; y < grid.height; ++y) {
      const uint8_t* const from = reference.grey + static_cast<ptrdiff_t>(2 * y) * reference.width;
      uint8_t* const to = arrays->grey + static_cast<ptrdiff_t>(y) * grid.width;
      for (int32_t x = 0; x < grid.width; ++x) to[x] = from[2 * x];
    }
  }
  return TV_OK;
}
