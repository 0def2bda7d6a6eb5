// The entry points of the dense cloud: they validate, and call the stages of lib/src/dense.
#include "twoview/dense.h"

#include <algorithm>
#include <cmath>

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "dense/fraction.h"
#include "dense/rectify.h"
#include "dense/sweep.h"
#include "geometry/essential.h"
#include "geometry/triangulation_frame.h"

namespace tv {
namespace {

constexpr int32_t kMaxSide = 16384;
constexpr tv_dense_options kDefaults = {sizeof(tv_dense_options), 400000, 128, 0, 0.0, 0.0, 0.05};

tv_status read_options(const tv_dense_options* given, tv_dense_options* options) {
  *options = kDefaults;
  const tv_status status = read_sized(given, options);
  if (status != TV_OK) return status;
  if (!is_finite(options->min_parallax_rad) || !is_finite(options->max_parallax_rad) ||
      !is_finite(options->max_relative_sigma)) {
    return TV_ERR_NOT_FINITE;
  }
  const bool valid =
      within(options->max_cells, 1024, 1 << 24) && within(options->max_steps, 16, 512) &&
      options->reserved == 0 && options->min_parallax_rad >= 0 &&
      options->max_parallax_rad <= kPi &&
      (options->max_parallax_rad == 0 || options->max_parallax_rad > options->min_parallax_rad) &&
      options->max_relative_sigma > 0 && options->max_relative_sigma <= 1;
  options->max_steps &= ~7;  // the matcher takes eight steps at a time
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_cameras(const tv_camera* camera0, const tv_camera* camera1) {
  for (const tv_camera* camera : {camera0, camera1}) {
    const tv_status status = tv_camera_check(camera);
    if (status != TV_OK) return status;
    if (camera->width > kMaxSide || camera->height > kMaxSide) return TV_ERR_CAMERA;
  }
  return TV_OK;
}

size_t dense_bytes(const tv_camera& camera0, const tv_camera& camera1, const tv_dense_options& o) {
  const size_t cells = static_cast<size_t>(o.max_cells);
  const size_t steps = static_cast<size_t>(o.max_steps);
  const size_t side = static_cast<size_t>(longest_side(o.max_cells));
  const size_t matching = match_rows_bytes(longest_side(o.max_cells), o.max_steps);
  return halved_bytes(camera0.width, camera0.height) + halved_bytes(camera1.width, camera1.height) +
         arena_bytes<uint8_t>(cells) + arena_bytes<uint8_t>(cells + side * steps) +
         2 * arena_bytes<int16_t>(cells) + arena_bytes<double>(2 * side) +
         arena_bytes<double>(2 * (side + steps)) + std::max(make_grid_bytes(), matching);
}

struct Scene {
  DenseGrid grid;
  DenseView views[2];
  RowPair rows;
  double max_relative_sigma;
};

// The point of a cell; false where there is none.
bool make_point(const Scene& scene, int32_t x, int32_t y, int32_t step, tv_dense_point* point) {
  const DenseGrid& grid = scene.grid;
  Refined refined;
  if (!refine_step(scene.rows, x, y, step, &refined)) return false;
  const double parallax = (grid.first_step + refined.step) * grid.step;
  const double sigma = refined.sigma * grid.step;
  const double angle = grid.first_angle + x * grid.step;
  if (!(parallax > 0 && angle + parallax < kPi)) return false;
  double sine, cosine, sine0, sine1;
  sincos(parallax, &sine, &cosine);
  sincos(angle, &sine0, &cosine);
  sincos(angle + parallax, &sine1, &cosine);
  // The sine rule in the triangle of the two centres and the point; its derivative by the parallax.
  const double distance = grid.length * sine1 / sine;
  const double distance_sigma = grid.length * sine0 / (sine * sine) * sigma;
  if (!(distance_sigma <= scene.max_relative_sigma * distance)) return false;
  const Vec3 ray0 = ray_at(grid, y, angle), ray1 = ray_at(grid, y, angle + parallax);
  Vec2 pixel[2];
  if (!pixel_at(scene.views[0], ray0, &pixel[0]) || !pixel_at(scene.views[1], ray1, &pixel[1])) {
    return false;
  }
  for (int i = 0; i < 3; ++i) point->position[i] = static_cast<float>(distance * ray0[i]);
  for (int i = 0; i < 2; ++i) {
    point->pixel0[i] = static_cast<float>(pixel[0][i]);
    point->pixel1[i] = static_cast<float>(pixel[1][i]);
  }
  point->sigma = static_cast<float>(distance_sigma);
  point->similarity = static_cast<float>(refined.similarity);
  return true;
}

}  // namespace
}  // namespace tv

void tv_dense_options_init_sized(tv_dense_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

tv_status tv_dense_size(const tv_camera* camera0, const tv_camera* camera1,
                        const tv_dense_options* options, size_t* size_bytes) {
  if (camera0 == nullptr || camera1 == nullptr || size_bytes == nullptr) return TV_ERR_NULL;
  tv_dense_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status == TV_OK) status = tv::check_cameras(camera0, camera1);
  if (status == TV_OK) *size_bytes = tv::dense_bytes(*camera0, *camera1, checked);
  return status;
}

tv_status tv_densify(const tv_image* image0, const tv_image* image1, const tv_camera* camera0,
                     const tv_camera* camera1, const double R[9], const double t[3],
                     const tv_point* sparse, int32_t num_sparse, const tv_dense_options* options,
                     void* memory, size_t size_bytes, tv_dense_point* points, int32_t cap_points,
                     int32_t* num_points) {
  if (image0 == nullptr || image1 == nullptr || camera0 == nullptr || camera1 == nullptr ||
      R == nullptr || t == nullptr || memory == nullptr || num_points == nullptr ||
      (sparse == nullptr && num_sparse > 0) || (points == nullptr && cap_points > 0)) {
    return TV_ERR_NULL;
  }
  tv_dense_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status == TV_OK) status = tv::check_cameras(camera0, camera1);
  if (status != TV_OK) return status;
  if (num_sparse < 0 || cap_points < 0) return TV_ERR_ARGUMENT;
  status = tv::check_camera_image(*camera0, *image0);
  if (status == TV_OK) status = tv::check_camera_image(*camera1, *image1);
  if (status != TV_OK) return status;
  if (!tv::all_finite(R, 9) || !tv::all_finite(t, 3)) return TV_ERR_NOT_FINITE;
  if (!tv::is_rotation(R) || (t[0] == 0.0 && t[1] == 0.0 && t[2] == 0.0)) return TV_ERR_ARGUMENT;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < tv::dense_bytes(*camera0, *camera1, checked)) return TV_ERR_MEMORY;
  const tv::Bytes arrays[6] = {{points, static_cast<size_t>(cap_points) * sizeof(tv_dense_point)},
                               {num_points, sizeof *num_points},
                               {memory, size_bytes},
                               {image0->data, tv::image_bytes(*image0)},
                               {image1->data, tv::image_bytes(*image1)},
                               {sparse, static_cast<size_t>(num_sparse) * sizeof(tv_point)}};
  if (tv::outputs_overlap(arrays, 3, 6)) return TV_ERR_OVERLAP;

  tv::Arena arena = tv::arena_over(memory, size_bytes);
  tv::Scene scene;
  scene.max_relative_sigma = checked.max_relative_sigma;
  tv::Mat3 rotation, none;
  for (int i = 0; i < 9; ++i) {
    rotation(i / 3, i % 3) = R[i];
    none(i / 3, i % 3) = i % 4 == 0 ? 1 : 0;
  }
  scene.views[0] = {tv::prepare_camera(*camera0), none, *image0, 0};
  scene.views[1] = {tv::prepare_camera(*camera1), rotation, *image1, 0};
  const tv::Camera& lens = scene.views[0].camera;
  const double pixel_angle = tv::pixel_angle_of(lens, scene.views[1].camera);
  tv::ParallaxRange range{0, (checked.max_steps - 2) * pixel_angle};
  if (checked.max_parallax_rad > 0) {
    range = {checked.min_parallax_rad, checked.max_parallax_rad};
  } else {
    tv::range_of_points(sparse, num_sparse, pixel_angle, arena, &range);
  }
  *num_points = 0;
  tv::DenseGrid& grid = scene.grid;
  if (!tv::make_grid(lens, rotation, tv::Vec3(t[0], t[1], t[2]), range, pixel_angle,
                     checked.max_cells, checked.max_steps, arena, &grid)) {
    return TV_OK;
  }
  for (tv::DenseView& view : scene.views) tv::halve(grid, pixel_angle, arena, &view);

  const size_t cells = static_cast<size_t>(grid.width) * static_cast<size_t>(grid.height);
  const int32_t columns1 = grid.width + grid.num_steps - 1;
  uint8_t* pixels0 = tv::arena_alloc<uint8_t>(arena, cells);
  uint8_t* pixels1 = tv::arena_alloc<uint8_t>(
      arena, static_cast<size_t>(columns1) * static_cast<size_t>(grid.height));
  double* sines0 = tv::arena_alloc<double>(arena, 2 * static_cast<size_t>(grid.width));
  double* sines1 = tv::arena_alloc<double>(arena, 2 * static_cast<size_t>(columns1));
  tv::tabulate(grid, 0, grid.width, sines0);
  tv::tabulate(grid, grid.first_step, columns1, sines1);
  tv::resample(grid, scene.views[0], sines0, grid.width, pixels0);
  tv::resample(grid, scene.views[1], sines1, columns1, pixels1);
  int16_t* found = tv::arena_alloc<int16_t>(arena, cells);
  int16_t* kept = tv::arena_alloc<int16_t>(arena, cells);
  scene.rows = {pixels0, pixels1, grid.width, grid.height, grid.num_steps};
  tv::match_rows(scene.rows, arena, found);
  tv::keep_supported(found, grid.width, grid.height, kept);

  if (cap_points > checked.max_cells) cap_points = checked.max_cells;
  // First the points are counted, then as many as there is room for are written. A cell counts as
  // much as it is wide in the image, which is less near an epipole.
  int64_t total = 0;
  int32_t count = 0;
  tv_dense_point point;
  const auto weight_of = [&](int32_t x) { return 1 + static_cast<int64_t>(sines0[2 * x] * 1000); };
  for (int32_t y = 0; y < grid.height; ++y) {
    for (int32_t x = 0; x < grid.width; ++x) {
      int16_t& step = kept[static_cast<ptrdiff_t>(y) * grid.width + x];
      if (step < 0) continue;
      if (!tv::make_point(scene, x, y, step, &point)) step = -1;
      if (step < 0) continue;
      total += weight_of(x);
      ++count;
    }
  }
  int64_t seen = 0;
  int32_t num = 0;
  for (int32_t y = 0; y < grid.height; ++y) {
    for (int32_t x = 0; x < grid.width; ++x) {
      const int16_t step = kept[static_cast<ptrdiff_t>(y) * grid.width + x];
      if (step < 0) continue;
      seen += weight_of(x);
      if (count > cap_points && (num >= cap_points || seen * cap_points < (num + 1) * total))
        continue;
      if (!tv::make_point(scene, x, y, step, &point)) continue;
      const int32_t u = static_cast<int32_t>(point.pixel0[0] + 0.5f);
      const int32_t v = static_cast<int32_t>(point.pixel0[1] + 0.5f);
      point.grey = image0->data[static_cast<int64_t>(v) * image0->stride_bytes + u];
      points[num++] = point;
    }
  }
  *num_points = num;
  return TV_OK;
}
