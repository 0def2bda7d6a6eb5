#include "dense/pair.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "triangulation/frame.h"
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

// Writes sine and cosine of `count` angles.
void tabulate(double first, double step, int32_t count, double* sines) {
  for (int32_t k = 0; k < count; ++k) sincos(first + k * step, sines + 2 * k, sines + 2 * k + 1);
}

// The sine of an angle that is a little larger than one of known sine and cosine.
double sine_near(const double sine_and_cosine[2], double more) {
  const double sq = more * more;
  return sine_and_cosine[0] * (1 - sq / 2 * (1 - sq / 12)) +
         sine_and_cosine[1] * (more * (1 - sq / 6 * (1 - sq / 20)));
}

}  // namespace

size_t match_pair_bytes(const tv_camera& camera0, const tv_camera& camera1,
                        const DenseLimits& limits) {
  const int32_t side = longest_side(limits.max_cells), steps = limits.max_steps;
  const size_t cells = static_cast<size_t>(limits.max_cells);
  const size_t cells1 = cells + static_cast<size_t>(side) * static_cast<size_t>(steps);
  const size_t preparing = std::max(make_grid_bytes(), track_bytes(side + steps));
  const size_t matching = match_rows_bytes(side, steps, cells);
  const size_t entries = cells_entries(cells);
  const size_t found = 2 * arena_bytes<float>(entries) + arena_bytes<uint8_t>(entries) +
                       std::max(refine_rows_bytes(side), PointMaker::bytes(side, steps));
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

size_t PointMaker::bytes(int32_t columns, int32_t steps) {
  const size_t n = static_cast<size_t>(columns), k = static_cast<size_t>(steps);
  return track_bytes(columns) + track_bytes(columns + steps) + arena_bytes<double>(2 * n) +
         arena_bytes<double>(2 * (n + k)) + arena_bytes<double>(2 * k);
}

PointMaker::PointMaker(const DensePair& pair, Arena& arena)
    : pair_(pair),
      track0_(pair.grid, pair.views[0], 0, pair.grid.width, arena),
      track1_(pair.grid, pair.views[1], pair.grid.first_step, pair.grid.columns1(), arena),
      sines0_(nullptr) {
  const DenseGrid& grid = pair.grid;
  if (grid.is_flat) return;
  sines0_ = arena_alloc<double>(arena, 2 * static_cast<size_t>(grid.width));
  sines1_ = arena_alloc<double>(arena, 2 * static_cast<size_t>(grid.columns1()));
  parallaxes_ = arena_alloc<double>(arena, 2 * static_cast<size_t>(grid.num_steps));
  tabulate(grid.first_column, grid.step, grid.width, sines0_);
  tabulate(grid.column(grid.first_step), grid.step, grid.columns1(), sines1_);
  tabulate(grid.first_step * grid.step, grid.step, grid.num_steps, parallaxes_);
}

void PointMaker::go_to_row(int32_t y) {
  const DenseGrid& grid = pair_.grid;
  first_ = static_cast<ptrdiff_t>(y) * grid.width;
  track0_.go_to_row(y);
  track1_.go_to_row(y);
  const double v = grid.row(y);
  if (grid.is_flat) {
    across_ = combine(1, grid.side, v, grid.up);
  } else {
    double sine, cosine;
    sincos(v, &sine, &cosine);
    across_ = combine(cosine, grid.side, sine, grid.up);
  }
  across_sq_ = dot(across_, across_);
}

bool PointMaker::sines_of(int32_t x, double steps, double* sine1, double* sine) const {
  const DenseGrid& grid = pair_.grid;
  if (!(grid.column(x) + (grid.first_step + steps) * grid.step < kPi)) return false;
  const int32_t step = std::min(std::max(static_cast<int32_t>(steps + 0.5), 0), grid.num_steps - 1);
  const double more = (steps - step) * grid.step;
  *sine = sine_near(parallaxes_ + 2 * step, more);
  *sine1 = sine_near(sines1_ + 2 * (x + step), more);
  return *sine > 0 && *sine1 > 0;
}

bool PointMaker::is_precise(int32_t x, int32_t y, double max_relative_sigma) const {
  const DenseGrid& grid = pair_.grid;
  const ptrdiff_t at = static_cast<ptrdiff_t>(y) * grid.width + x;
  const double steps = static_cast<double>(pair_.cells.parallax[at]);
  const double sigma = static_cast<double>(pair_.cells.sigma[at]);
  if (!(steps >= 0 && grid.first_step + steps > 0)) return false;
  if (grid.is_flat) return sigma <= max_relative_sigma * (grid.first_step + steps);
  double sine1, sine;
  return sines_of(x, steps, &sine1, &sine) &&
         sines0_[2 * x] * sigma * grid.step <= max_relative_sigma * sine1 * sine;
}

bool PointMaker::distance(int32_t x, double* distance, double* sigma, Vec3* ray) const {
  const DenseGrid& grid = pair_.grid;
  const double steps = static_cast<double>(pair_.cells.parallax[first_ + x]);
  const double parallax_sigma = static_cast<double>(pair_.cells.sigma[first_ + x]) * grid.step;
  if (!(steps >= 0 && grid.first_step + steps > 0)) return false;
  if (grid.is_flat) {
    const double c = grid.column(x), inverse = 1 / ((grid.first_step + steps) * grid.step);
    // |ray|^2: the grid's axes are orthogonal.
    const double size = std::sqrt(c * c + across_sq_), scale = 1 / size;
    *distance = grid.length * size * inverse;
    *sigma = *distance * parallax_sigma * inverse;
    *ray = combine(-c * scale, grid.baseline, scale, across_);
    return true;
  }
  // The sine rule in the triangle of the two centres and the point; its derivative by the parallax.
  double sine1, sine;
  if (!sines_of(x, steps, &sine1, &sine)) return false;
  *distance = grid.length * sine1 / sine;
  *sigma = grid.length * sines0_[2 * x] / (sine * sine) * parallax_sigma;
  *ray = combine(sines0_[2 * x + 1], grid.baseline, sines0_[2 * x], across_);
  return true;
}

bool PointMaker::point(int32_t x, tv_dense_point* point) const {
  double range, sigma, u0, v0, u1, v1;
  Vec3 ray;
  if (!distance(x, &range, &sigma, &ray)) return false;
  const double last = pair_.grid.columns1() - 1;
  const double x1 = std::min(x + static_cast<double>(pair_.cells.parallax[first_ + x]), last);
  if (!track0_.pixel_at(x, &u0, &v0) || !track1_.pixel_at(x1, &u1, &v1)) return false;
  for (int i = 0; i < 3; ++i) point->position[i] = static_cast<float>(range * ray[i]);
  point->pixel0[0] = static_cast<float>(u0);
  point->pixel0[1] = static_cast<float>(v0);
  point->pixel1[0] = static_cast<float>(u1);
  point->pixel1[1] = static_cast<float>(v1);
  point->sigma = static_cast<float>(sigma);
  point->similarity = static_cast<float>(pair_.cells.similarity[first_ + x]) * (1.0f / 255.0f);
  return true;
}

double PointMaker::weight(int32_t x) const { return pair_.grid.is_flat ? 1 : sines0_[2 * x]; }

}  // namespace tv
