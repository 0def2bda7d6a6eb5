#include "dense/plane_sweep.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace tv {
namespace {

constexpr int32_t kPaths = 8;
// A view is a witness where at most so many of 31 bits differ: by chance 8 per cent of the places
// have so few.
constexpr int32_t kWitnessBits = 11;
// The standard deviation in planes: a floor, and what follows from the margin, by which the sum of
// the best plane is below that of any plane that is not near it, in half bits a path. Fitted to
// the 68 per cent quantiles of the errors in a rendered flight and judged on others
// (docs/algorithms/depth_map.md).
constexpr double kSigmaFloor = 0.15, kSigmaMargin = 10, kMarginOffset = 1.2;

// The bytes of an array of a row: kernels read and write whole blocks, and their neighbours.
constexpr size_t kFrame = TVK_DENSE_BLOCK;
size_t row_bytes(int32_t width) { return static_cast<size_t>(width) + 2 * kFrame; }

// Where the planes put a pixel in a view: element scale * pixel + (x, y), rounded down.
struct PlanePlaces {
  float *scale, *x, *y;
  int32_t* row;  // the element at which a row's line begins
};

// What the paths from the row before brought to a row.
struct PathLines {
  uint8_t *costs[3], *least[3];
};

PathLines make_lines(int32_t width, int32_t count, Arena& arena) {
  const size_t columns = static_cast<size_t>(width);
  PathLines lines;
  for (int p = 0; p < 3; ++p) {
    lines.costs[p] = arena_alloc<uint8_t>(arena, columns * static_cast<size_t>(count));
    lines.least[p] = arena_alloc<uint8_t>(arena, columns);
  }
  return lines;
}

class Sweep {
 public:
  Sweep(const PlaneSweep& sweep, const tvk_dense_table& kernels, Arena& arena);
  void go(bool forward, const SweptRows* rows);

 private:
  void place_planes();
  void place_row(int32_t y);
  void read_row(int32_t y, uint8_t* grey) const;
  SweptPixel pixel_of(int32_t x, const uint8_t* sums, int32_t best, int32_t margin,
                      uint32_t census) const;
  const uint32_t* census_of(int32_t y) const {
    return s_.reference->census + static_cast<ptrdiff_t>(2 * y) * s_.reference->width;
  }

  const PlaneSweep& s_;
  const tvk_dense_table& kernels_;
  const int32_t width_, height_, count_;
  uint8_t *costs_, *sums_;  // of all pixels and planes
  PlanePlaces places_[8];
  tvk_swept_view views_[8];
  PathLines before_, after_;
  uint8_t *grey_, *grey_before_, *across_, *large_[3], *scratch_, *margin_;
  int16_t* best_;
  SweptPixel* row_;
};

Sweep::Sweep(const PlaneSweep& sweep, const tvk_dense_table& kernels, Arena& arena)
    : s_(sweep),
      kernels_(kernels),
      width_(sweep.grid.width),
      height_(sweep.grid.height),
      count_(sweep.planes.count) {
  const size_t width = static_cast<size_t>(width_), planes = static_cast<size_t>(count_);
  const size_t volume = width * static_cast<size_t>(height_) * planes;
  costs_ = arena_alloc<uint8_t>(arena, volume);
  sums_ = arena_alloc<uint8_t>(arena, volume);
  for (int32_t v = 0; v < s_.num_views; ++v) {
    PlanePlaces& places = places_[v];
    places = {arena_alloc<float>(arena, planes), arena_alloc<float>(arena, planes),
              arena_alloc<float>(arena, planes), arena_alloc<int32_t>(arena, planes)};
    const ParallelView& view = s_.views[v].view;
    views_[v] = {view.census, places.scale, places.x, places.row, view.width - 1, 0};
  }
  before_ = make_lines(width_, count_, arena);
  after_ = make_lines(width_, count_, arena);
  const auto row_of = [&] { return arena_alloc<uint8_t>(arena, row_bytes(width_)) + kFrame; };
  grey_ = row_of();
  grey_before_ = row_of();
  across_ = row_of();
  for (uint8_t*& large : large_) large = row_of();
  margin_ = row_of();
  scratch_ = arena_alloc<uint8_t>(arena, 2 * planes);
  best_ = arena_alloc<int16_t>(arena, width);
  row_ = arena_alloc<SweptPixel>(arena, width);
  place_planes();
}

// A point at the inverse depth q over the pixel x lies in the other view at
// ((x - centre) + focal q shift_x) / (1 + q shift_z) + centre, a scale and a shift for each plane.
void Sweep::place_planes() {
  const double centre_x = (width_ - 1) * 0.5, centre_y = (height_ - 1) * 0.5;
  for (int32_t v = 0; v < s_.num_views; ++v) {
    const SweptView& other = s_.views[v];
    for (int32_t k = 0; k < count_; ++k) {
      const double q = s_.planes.first + k * s_.planes.step;
      const double ahead = 1 + q * other.shift[2];
      const double scale = ahead > 0.1 ? 1 / ahead : 0;
      const double along = s_.grid.focal * q;
      const double x = scale * (along * other.shift[0] - centre_x) + centre_x;
      const double y = scale * (along * other.shift[1] - centre_y) + centre_y;
      // A half more rounds to the nearest; what is behind the view is put outside it.
      places_[v].scale[k] = static_cast<float>(2 * scale);
      places_[v].x[k] = static_cast<float>(scale > 0 ? 2 * (x + other.view.margin_x) + 0.5 : -1);
      places_[v].y[k] = static_cast<float>(scale > 0 ? 2 * (y + other.view.margin_y) + 0.5 : -1);
    }
  }
}

// The lines of the views in which the planes put a row.
void Sweep::place_row(int32_t y) {
  for (int32_t v = 0; v < s_.num_views; ++v) {
    const ParallelView& view = s_.views[v].view;
    const PlanePlaces& places = places_[v];
    const float last = static_cast<float>(view.height - 1);
    for (int32_t k = 0; k < count_; ++k) {
      const float at = places.scale[k] * static_cast<float>(y) + places.y[k];
      places.row[k] = static_cast<int32_t>(std::min(std::max(at, 0.0f), last)) * view.width;
    }
  }
}

// The grey levels of a row of the map, with its first and last repeated beyond it.
void Sweep::read_row(int32_t y, uint8_t* grey) const {
  const uint8_t* const from =
      s_.reference->grey + static_cast<ptrdiff_t>(2 * y) * s_.reference->width;
  for (int32_t x = 0; x < width_; ++x) grey[x] = from[2 * x];
  grey[-1] = grey[0];
  grey[width_] = grey[width_ - 1];
}

SweptPixel Sweep::pixel_of(int32_t x, const uint8_t* sums, int32_t best, int32_t margin,
                           uint32_t census) const {
  if (census == kNoCensus || best == 0 || best == count_ - 1) return {0, 0, 0};
  const int32_t before = sums[best - 1] - sums[best], after = sums[best + 1] - sums[best];
  // Two straight lines of equal slope through the three sums.
  const int32_t higher = std::max(before, after);
  const double fraction = higher > 0 ? (before - after) / (2.0 * higher) : 0.0;
  const double part = kSigmaMargin / (margin * (2.0 / kPaths) + kMarginOffset);
  SweptPixel pixel;
  pixel.inverse_depth = s_.planes.first + (best + fraction) * s_.planes.step;
  pixel.sigma = std::sqrt(kSigmaFloor * kSigmaFloor + part * part) * s_.planes.step;
  pixel.witnesses = 0;
  for (int32_t v = 0; v < s_.num_views; ++v) {
    const tvk_swept_view& view = views_[v];
    const float at = view.scale[best] * static_cast<float>(x) + view.shift[best];
    const float last = static_cast<float>(view.last);
    const uint32_t other =
        view.census[view.row[best] + static_cast<int32_t>(std::min(std::max(at, 0.0f), last))];
    if (other == kNoCensus) continue;
    pixel.witnesses += __builtin_popcount(census ^ other) <= kWitnessBits ? 1 : 0;
  }
  return pixel;
}

// Four paths: along the row and from the row before, or behind where it goes backward; the sums of
// the way forward are added to on the way back, and each row is handed over.
void Sweep::go(bool forward, const SweptRows* rows) {
  const int32_t step = forward ? 1 : -1, first = forward ? 0 : height_ - 1;
  const size_t planes = static_cast<size_t>(count_);
  const size_t row_size = static_cast<size_t>(width_) * planes;
  for (int p = 0; p < 3; ++p) {
    std::memset(before_.least[p], 0, static_cast<size_t>(width_));
    std::memset(before_.costs[p], 0, row_size);
  }
  read_row(first, grey_before_);
  for (int32_t j = 0, y = first; j < height_; ++j, y += step) {
    uint8_t* const costs = costs_ + static_cast<size_t>(y) * row_size;
    uint8_t* const sums = sums_ + static_cast<size_t>(y) * row_size;
    const uint32_t* const census = census_of(y);
    place_row(y);
    if (forward) {
      kernels_.plane_costs(views_, s_.num_views, census, width_, count_, costs);
      std::memset(sums, 0, row_size);
    }
    read_row(y, grey_);
    for (int p = 0; p < 3; ++p) {
      kernels_.edge_costs(grey_, grey_before_ + p - 1, width_, large_[p], across_);
    }
    across_[width_] = TVK_DENSE_LARGE;
    const tvk_swept_row row = {width_,
                               count_,
                               step,
                               0,
                               costs,
                               sums,
                               across_,
                               {large_[0], large_[1], large_[2]},
                               {before_.costs[0], before_.costs[1], before_.costs[2]},
                               {after_.costs[0], after_.costs[1], after_.costs[2]},
                               {before_.least[0], before_.least[1], before_.least[2]},
                               {after_.least[0], after_.least[1], after_.least[2]},
                               scratch_};
    kernels_.sum_planes(&row);
    std::swap(before_, after_);
    std::swap(grey_, grey_before_);
    if (forward) continue;
    kernels_.choose_planes(sums, width_, count_, best_, margin_);
    for (int32_t x = 0; x < width_; ++x) {
      row_[x] =
          pixel_of(x, sums + static_cast<size_t>(x) * planes, best_[x], margin_[x], census[2 * x]);
    }
    rows->take(rows->user, y, row_);
  }
}

}  // namespace

size_t sweep_planes_bytes(const MapGrid& grid, int32_t max_planes, int32_t num_views) {
  const size_t width = static_cast<size_t>(grid.width), planes = static_cast<size_t>(max_planes);
  const size_t volume = width * static_cast<size_t>(grid.height) * planes;
  const size_t views = static_cast<size_t>(num_views);
  return 2 * arena_bytes<uint8_t>(volume) + 4 * views * arena_bytes<float>(planes) +
         6 * (arena_bytes<uint8_t>(width * planes) + arena_bytes<uint8_t>(width)) +
         7 * arena_bytes<uint8_t>(row_bytes(grid.width)) + arena_bytes<uint8_t>(2 * planes) +
         arena_bytes<int16_t>(width) + arena_bytes<SweptPixel>(width);
}

void sweep_planes(const PlaneSweep& sweep, const tvk_dense_table& kernels, const SweptRows& rows,
                  Arena& arena) {
  const ArenaScope scope(arena);
  Sweep work(sweep, kernels, arena);
  work.go(true, nullptr);
  work.go(false, &rows);
}

}  // namespace tv
