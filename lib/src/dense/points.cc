#include "dense/points.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "triangulation/frame.h"

namespace tv {
namespace {

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

// The cells that have a point, where there may not be room for all of them.
struct Share {
  int64_t total;  // the sum of their weights
  int32_t count;
};

// A cell, its distance from camera 0 and the standard deviation.
struct Measured {
  double steps, distance, sigma;
  Vec3 ray;
};

// The points are made one by one, so all that a point takes is in line with the loop over a row.
class PointMaker {
 public:
  PointMaker(const DensePair& pair, double most_sigma, Arena& arena);
  TVK_NOINLINE Share count_cells() const;
  void go_to_row(int32_t y);
  // Writes the points of the row, to which `seen` of the share's weight have gone before.
  int32_t make_row(const tv_image& image0, const Share& share, int32_t cap_points, int64_t* seen,
                   int32_t num, tv_dense_point* points) const;

 private:
  TVK_NOINLINE bool sines_of(int32_t x, double steps, double* sine1, double* sine) const;
  inline bool is_precise(int32_t x, ptrdiff_t cell) const;
  inline bool measure(int32_t x, Measured* measured) const;
  inline bool make(int32_t x, const tv_image& image0, tv_dense_point* point) const;
  // A cell counts as much as it is wide in the image, which is less near an epipole.
  int64_t weight_of(int32_t x) const {
    return 1 + static_cast<int64_t>((grid_.is_flat ? 1 : sines0_[2 * x]) * 1000);
  }

  const DenseGrid grid_;
  const DenseCells cells_;
  const double most_sigma_, last_column1_;
  Track track0_, track1_;
  // Sine and cosine of the columns of both images and of the steps of parallax, for a grid of
  // angles.
  double *sines0_, *sines1_, *parallaxes_;
  Vec3 across_;
  double across_sq_;
  ptrdiff_t first_;  // cell of the row
};

PointMaker::PointMaker(const DensePair& pair, double most_sigma, Arena& arena)
    : grid_(pair.grid),
      cells_(pair.cells),
      most_sigma_(most_sigma),
      last_column1_(pair.grid.columns1() - 1),
      track0_(pair.grid, pair.views[0], 0, pair.grid.width, arena),
      track1_(pair.grid, pair.views[1], pair.grid.first_step, pair.grid.columns1(), arena),
      sines0_(nullptr) {
  if (grid_.is_flat) return;
  sines0_ = arena_alloc<double>(arena, 2 * static_cast<size_t>(grid_.width));
  sines1_ = arena_alloc<double>(arena, 2 * static_cast<size_t>(grid_.columns1()));
  parallaxes_ = arena_alloc<double>(arena, 2 * static_cast<size_t>(grid_.num_steps));
  tabulate(grid_.first_column, grid_.step, grid_.width, sines0_);
  tabulate(grid_.column(grid_.first_step), grid_.step, grid_.columns1(), sines1_);
  tabulate(grid_.first_step * grid_.step, grid_.step, grid_.num_steps, parallaxes_);
}

void PointMaker::go_to_row(int32_t y) {
  first_ = static_cast<ptrdiff_t>(y) * grid_.width;
  track0_.go_to_row(y);
  track1_.go_to_row(y);
  const double v = grid_.row(y);
  if (grid_.is_flat) {
    across_ = combine(1, grid_.side, v, grid_.up);
  } else {
    double sine, cosine;
    sincos(v, &sine, &cosine);
    across_ = combine(cosine, grid_.side, sine, grid_.up);
  }
  across_sq_ = dot(across_, across_);
}

// Sines of the angle in camera 1 and of the parallax, for a grid of angles; false beyond an
// epipole.
bool PointMaker::sines_of(int32_t x, double steps, double* sine1, double* sine) const {
  if (!(grid_.column(x) + (grid_.first_step + steps) * grid_.step < kPi)) return false;
  const int32_t step =
      std::min(std::max(static_cast<int32_t>(steps + 0.5), 0), grid_.num_steps - 1);
  const double more = (steps - step) * grid_.step;
  *sine = sine_near(parallaxes_ + 2 * step, more);
  *sine1 = sine_near(sines1_ + 2 * (x + step), more);
  return *sine > 0 && *sine1 > 0;
}

// Whether a cell has a distance whose standard deviation is small enough.
bool PointMaker::is_precise(int32_t x, ptrdiff_t cell) const {
  const double steps = static_cast<double>(cells_.parallax[cell]);
  if (!(steps >= 0 && grid_.first_step + steps > 0)) return false;
  const double sigma = static_cast<double>(cells_.sigma[cell]);
  if (grid_.is_flat) return sigma <= most_sigma_ * (grid_.first_step + steps);
  double sine1, sine;
  return sines_of(x, steps, &sine1, &sine) &&
         sines0_[2 * x] * sigma * grid_.step <= most_sigma_ * sine1 * sine;
}

// Measures a precise cell of the row.
bool PointMaker::measure(int32_t x, Measured* m) const {
  m->steps = static_cast<double>(cells_.parallax[first_ + x]);
  const double parallax_sigma = static_cast<double>(cells_.sigma[first_ + x]) * grid_.step;
  if (grid_.is_flat) {
    const double c = grid_.column(x), inverse = 1 / ((grid_.first_step + m->steps) * grid_.step);
    // |ray|^2: the grid's axes are orthogonal.
    const double size = std::sqrt(c * c + across_sq_), scale = 1 / size;
    m->distance = grid_.length * size * inverse;
    m->sigma = m->distance * parallax_sigma * inverse;
    m->ray = combine(-c * scale, grid_.baseline, scale, across_);
    return true;
  }
  // The sine rule in the triangle of the two centres and the point; its derivative by the parallax.
  double sine1, sine;
  if (!sines_of(x, m->steps, &sine1, &sine)) return false;
  m->distance = grid_.length * sine1 / sine;
  m->sigma = grid_.length * sines0_[2 * x] / (sine * sine) * parallax_sigma;
  m->ray = combine(sines0_[2 * x + 1], grid_.baseline, sines0_[2 * x], across_);
  return true;
}

// Makes the point of a precise cell. Returns false for one that an image does not show.
bool PointMaker::make(int32_t x, const tv_image& image0, tv_dense_point* point) const {
  Measured m;
  if (!measure(x, &m)) return false;
  const Place at0 = track0_.place_at(x);
  const Place at1 = track1_.place_at(std::min(x + m.steps, last_column1_));
  if (!at0.is_seen || !at1.is_seen) return false;
  point->pixel0[0] = static_cast<float>(at0.u);
  point->pixel0[1] = static_cast<float>(at0.v);
  point->pixel1[0] = static_cast<float>(at1.u);
  point->pixel1[1] = static_cast<float>(at1.v);
  point->position[0] = static_cast<float>(m.distance * m.ray[0]);
  point->position[1] = static_cast<float>(m.distance * m.ray[1]);
  point->position[2] = static_cast<float>(m.distance * m.ray[2]);
  point->sigma = static_cast<float>(m.sigma);
  point->similarity = static_cast<float>(cells_.similarity[first_ + x]) * (1.0f / 255.0f);
  const int32_t column = static_cast<int32_t>(static_cast<float>(at0.u) + 0.5f);
  const int32_t row = static_cast<int32_t>(static_cast<float>(at0.v) + 0.5f);
  point->grey = image0.data[static_cast<int64_t>(row) * image0.stride_bytes + column];
  return true;
}

Share PointMaker::count_cells() const {
  Share share{0, 0};
  ptrdiff_t cell = 0;
  for (int32_t y = 0; y < grid_.height; ++y) {
    for (int32_t x = 0; x < grid_.width; ++x, ++cell) {
      if (!is_precise(x, cell)) continue;
      share.total += weight_of(x);
      ++share.count;
    }
  }
  return share;
}

int32_t PointMaker::make_row(const tv_image& image0, const Share& share, int32_t cap_points,
                             int64_t* seen, int32_t num, tv_dense_point* points) const {
  for (int32_t x = 0; x < grid_.width; ++x) {
    if (!is_precise(x, first_ + x)) continue;
    if (share.count > cap_points) {
      *seen += weight_of(x);
      if (num >= cap_points || *seen * cap_points < (num + 1) * share.total) continue;
    }
    num += make(x, image0, points + num) ? 1 : 0;
  }
  return num;
}

}  // namespace

size_t make_points_bytes(int32_t columns, int32_t steps) {
  const size_t n = static_cast<size_t>(columns), k = static_cast<size_t>(steps);
  return track_bytes(columns) + track_bytes(columns + steps) + arena_bytes<double>(2 * n) +
         arena_bytes<double>(2 * (n + k)) + arena_bytes<double>(2 * k);
}

int32_t make_points(const DensePair& pair, const tv_image& image0, double max_relative_sigma,
                    Arena& arena, tv_dense_point* points, int32_t cap_points) {
  const ArenaScope scope(arena);
  const DenseGrid& grid = pair.grid;
  PointMaker maker(pair, max_relative_sigma, arena);
  Share share{0, 0};
  if (cap_points < grid.width * grid.height) share = maker.count_cells();
  int64_t seen = 0;
  int32_t num = 0;
  for (int32_t y = 0; y < grid.height; ++y) {
    maker.go_to_row(y);
    num = maker.make_row(image0, share, cap_points, &seen, num, points);
  }
  return num;
}

}  // namespace tv
