#include "dense/pair.h"

#include <algorithm>

#include "twoview/context.h"

namespace tv {
namespace {

// Resamples a view over the grid's rows, at `columns` columns from `first` on.
void resample(const DensePair& pair, int view, double first, int32_t columns,
              const tvk_dense_table& kernels, Arena& arena, uint8_t* pixels) {
  const ArenaScope scope(arena);
  Track track(pair.grid, pair.views[view], first, columns, arena);
  for (int32_t y = 0; y < pair.grid.height; ++y) {
    track.go_to_row(y);
    track.sample(kernels, pixels + static_cast<ptrdiff_t>(y) * columns);
  }
}

}  // namespace

size_t match_pair_bytes(const tv_camera& camera0, const tv_camera& camera1,
                        const DenseLimits& limits, size_t beside) {
  const int32_t side = longest_side(limits.max_cells), steps = limits.max_steps;
  const size_t cells = static_cast<size_t>(limits.max_cells);
  const size_t cells1 = cells + static_cast<size_t>(side) * static_cast<size_t>(steps);
  const size_t preparing = std::max(make_grid_bytes(), track_bytes(side + steps));
  const size_t matching = match_rows_bytes(side, steps, cells);
  const size_t entries = cells_entries(cells);
  const size_t found = 2 * arena_bytes<float>(entries) + arena_bytes<uint8_t>(entries) +
                       std::max(refine_rows_bytes(side), beside);
  return halved_bytes(camera0.width, camera0.height) + halved_bytes(camera1.width, camera1.height) +
         pixels_bytes(cells) + pixels_bytes(cells1) +
         arena_bytes<int16_t>(steps_entries(limits.max_cells, side)) +
         std::max(preparing, std::max(matching, found));
}

bool match_pair(const tv_camera& camera0, const tv_camera& camera1, const tv_image& image0,
                const tv_image& image1, const Mat3& R, const Vec3& t, const ParallaxHint& hint,
                const DenseLimits& limits, Arena& arena, DensePair* pair) {
  const tvk_dense_table& kernels = *tvk_dense_of(tvk_select(TV_KERNELS_AUTO));
  pair->views[0] = {prepare_camera(camera0), Mat3::Identity(), image0, 0};
  pair->views[1] = {prepare_camera(camera1), R, image1, 0};
  const double pixel_angle = pixel_angle_of(pair->views[0].camera, pair->views[1].camera);
  DenseGrid& grid = pair->grid;
  if (!make_grid(pair->views[0].camera, R, t, hint, pixel_angle, limits.max_cells, limits.max_steps,
                 arena, &grid)) {
    return false;
  }
  for (DenseView& view : pair->views) halve(grid, pixel_angle, arena, &view);
  const size_t height = static_cast<size_t>(grid.height);
  const size_t num = static_cast<size_t>(grid.width) * height;
  uint8_t* const pixels0 = pixels_alloc(num, arena);
  uint8_t* const pixels1 = pixels_alloc(static_cast<size_t>(grid.columns1()) * height, arena);
  resample(*pair, 0, 0, grid.width, kernels, arena, pixels0);
  resample(*pair, 1, grid.first_step, grid.columns1(), kernels, arena, pixels1);
  pair->rows = {pixels0, pixels1, grid.width, grid.height, grid.num_steps, grid.range_steps};
  Steps steps{nullptr, grid.width, grid.height};
  steps.data = arena_alloc<int16_t>(
      arena, static_cast<size_t>(steps.pitch()) * (height + 2 * TVK_DENSE_REACH));
  match_rows(pair->rows, kernels, arena, steps);
  pair->cells.parallax = arena_alloc<float>(arena, cells_entries(num));
  pair->cells.sigma = arena_alloc<float>(arena, cells_entries(num));
  pair->cells.similarity = arena_alloc<uint8_t>(arena, cells_entries(num));
  refine_rows(pair->rows, steps, kernels, arena, pair->cells);
  return true;
}

}  // namespace tv
