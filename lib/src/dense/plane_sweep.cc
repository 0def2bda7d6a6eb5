#include "dense/plane_sweep.h"

#include <algorithm>
#include <cmath>

namespace tv {
namespace {

// Costs are half bits: twice the mean number of bits in which two censuses differ.
constexpr uint8_t kNoViewCost = 31;  // as much as chance gives, where no view shows the place
constexpr uint8_t kAbsent = 255;     // of a view that does not show the place
// The cost of a change by one plane along a path, and of a larger one between pixels of equal grey.
// Twice or half of both changes the share of wrong depths by less than a tenth.
constexpr int32_t kSmall = 12, kLarge = 60;
constexpr int32_t kEdgeGrey = 12;  // the difference of grey levels that halves kLarge
constexpr int16_t kNever = 16000;
constexpr int32_t kPaths = 8;
constexpr int32_t kBlock = 8;  // a loop of known length becomes vector code in any build
// A view is a witness where at most so many of 31 bits differ: by chance 8 per cent of the places
// have so few.
constexpr int32_t kWitnessBits = 11;
// The standard deviation in planes: a floor, and what follows from the margin, by which the sum of
// the best plane is below that of any plane that is not its neighbour, in half bits a path. Fitted
// to the 68 per cent quantiles of the errors in a rendered flight and judged on others
// (docs/algorithms/depth_map.md).
constexpr double kSigmaFloor = 0.15, kSigmaMargin = 10, kMarginOffset = 1.2;

// A line of `count` sums for each pixel of a row, with an entry of kNever before and behind each.
struct Lines {
  int16_t* data;
  ptrdiff_t pitch;
  int16_t* at(int32_t x) const { return data + x * pitch + kBlock; }
};

Lines make_lines(int32_t num, int32_t count, Arena& arena) {
  const ptrdiff_t pitch = count + 2 * kBlock;
  Lines lines{arena_alloc<int16_t>(arena, static_cast<size_t>(num * pitch)), pitch};
  for (int32_t x = 0; x < num; ++x) {
    int16_t* const line = lines.at(x);
    for (int32_t k = 0; k < count; ++k) line[k] = 0;
    line[-1] = line[count] = kNever;
  }
  return lines;
}

// One step of a path. Returns the least of `after`.
int16_t follow(const uint8_t* cost, const int16_t* before, int16_t least_before, int32_t large,
               int32_t count, int16_t* __restrict after, int16_t* __restrict sums) {
  const int16_t jump = static_cast<int16_t>(least_before + large);
  int16_t least[kBlock];
  for (int16_t& value : least) value = kNever;
  for (int32_t k = 0; k < count; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      const int16_t left = before[k + i - 1], right = before[k + i + 1], same = before[k + i];
      int16_t way = left < right ? left : right;
      way = static_cast<int16_t>(way + kSmall);
      way = same < way ? same : way;
      way = jump < way ? jump : way;
      way = static_cast<int16_t>(way - least_before + cost[k + i]);
      after[k + i] = way;
      sums[k + i] = static_cast<int16_t>(sums[k + i] + way);
      least[i] = way < least[i] ? way : least[i];
    }
  }
  int16_t of_all = least[0];
  for (int32_t i = 1; i < kBlock; ++i) of_all = least[i] < of_all ? least[i] : of_all;
  return of_all;
}

int32_t large_cost(int32_t grey, int32_t other) {
  return std::max(kSmall + 4, kLarge * kEdgeGrey / (kEdgeGrey + std::abs(grey - other)));
}

// Where the planes put a pixel in a view: element scale * pixel + (x, y), rounded down.
struct PlanePlaces {
  float *scale, *x, *y;
};

class Sweep {
 public:
  Sweep(const PlaneSweep& sweep, Arena& arena);
  void fill_costs();
  void go(bool forward, const SweptRows* rows);

 private:
  uint8_t* costs_at(int32_t x, int32_t y) const {
    return costs_ + (static_cast<ptrdiff_t>(y) * width_ + x) * count_;
  }
  int32_t grey_at(int32_t x, int32_t y) const {
    return s_.reference->grey[static_cast<ptrdiff_t>(2 * y) * s_.reference->width + 2 * x];
  }
  uint32_t census_at(int32_t x, int32_t y) const {
    return s_.reference->census[static_cast<ptrdiff_t>(2 * y) * s_.reference->width + 2 * x];
  }
  void place_planes();
  void differing_bits(int32_t view, int32_t x, int32_t y, uint32_t census, int32_t first,
                      int32_t last, uint8_t* bits);
  void costs_of(int32_t x, int32_t y);
  void keep_sums(int32_t y);
  SweptPixel choose(int32_t x, int32_t y);

  const PlaneSweep& s_;
  const int32_t width_, height_, count_;
  uint8_t *costs_, *kept_;  // of all pixels and planes; the sums of the paths that go forward
  PlanePlaces places_[8];
  uint32_t* gathered_;
  uint8_t* bits_;  // of each view
  Lines sums_, along_, before_[3], after_[3];
  int16_t *least_before_[3], *least_after_[3];
  SweptPixel* row_;
};

Sweep::Sweep(const PlaneSweep& sweep, Arena& arena)
    : s_(sweep), width_(sweep.grid.width), height_(sweep.grid.height), count_(sweep.planes.count) {
  const size_t pixels = static_cast<size_t>(width_) * static_cast<size_t>(height_);
  const size_t planes = static_cast<size_t>(count_);
  costs_ = arena_alloc<uint8_t>(arena, pixels * planes);
  kept_ = arena_alloc<uint8_t>(arena, pixels * planes);
  for (int32_t v = 0; v < s_.num_views; ++v) {
    places_[v] = {arena_alloc<float>(arena, planes), arena_alloc<float>(arena, planes),
                  arena_alloc<float>(arena, planes)};
  }
  gathered_ = arena_alloc<uint32_t>(arena, planes);
  bits_ = arena_alloc<uint8_t>(arena, planes * static_cast<size_t>(s_.num_views));
  sums_ = make_lines(width_, count_, arena);
  along_ = make_lines(2, count_, arena);
  for (int p = 0; p < 3; ++p) {
    before_[p] = make_lines(width_, count_, arena);
    after_[p] = make_lines(width_, count_, arena);
    least_before_[p] = arena_alloc<int16_t>(arena, static_cast<size_t>(width_));
    least_after_[p] = arena_alloc<int16_t>(arena, static_cast<size_t>(width_));
  }
  row_ = arena_alloc<SweptPixel>(arena, static_cast<size_t>(width_));
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

// How many bits of the census of a view differ, for the planes [first, last), whole blocks; kAbsent
// where it shows nothing.
void Sweep::differing_bits(int32_t v, int32_t x, int32_t y, uint32_t census, int32_t first,
                           int32_t last, uint8_t* bits) {
  const ParallelView& view = s_.views[v].view;
  const PlanePlaces& places = places_[v];
  // The edge of a view has no census, so that places beyond it may stand for its edge.
  const float last_x = static_cast<float>(view.width - 1);
  const float last_y = static_cast<float>(view.height - 1);
  const float fx = static_cast<float>(x), fy = static_cast<float>(y);
  for (int32_t k = first; k < last; k += kBlock) {
    int32_t at[kBlock];
    for (int32_t i = 0; i < kBlock; ++i) {
      float u = places.scale[k + i] * fx + places.x[k + i];
      float w = places.scale[k + i] * fy + places.y[k + i];
      u = u > 0 ? u : 0;
      w = w > 0 ? w : 0;
      u = u < last_x ? u : last_x;
      w = w < last_y ? w : last_y;
      at[i] = static_cast<int32_t>(w) * view.width + static_cast<int32_t>(u);
    }
    for (int32_t i = 0; i < kBlock; ++i) gathered_[k + i] = view.census[at[i]];
  }
  for (int32_t k = first; k < last; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      const uint32_t other = gathered_[k + i];
      uint32_t n = census ^ other;
      n = n - (n >> 1 & 0x55555555u);
      n = (n & 0x33333333u) + (n >> 2 & 0x33333333u);
      n = (n + (n >> 4)) & 0x0f0f0f0fu;
      n = n + (n >> 8);
      n = (n + (n >> 16)) & 63u;
      bits[k + i] = static_cast<uint8_t>(other == kNoCensus ? kAbsent : n);
    }
  }
}

// The costs of a pixel: the mean over the views that show the place, without the worst of them, in
// which it may be hidden.
void Sweep::costs_of(int32_t x, int32_t y) {
  // 512 over the number of views that are left, by how many show the place.
  static constexpr int32_t kShare[8] = {0, 512, 512, 256, 171, 128, 102, 85};
  uint8_t* const costs = costs_at(x, y);
  const uint32_t census = census_at(x, y);
  if (census == kNoCensus) {
    for (int32_t k = 0; k < count_; ++k) costs[k] = 0;
    return;
  }
  for (int32_t v = 0; v < s_.num_views; ++v) {
    differing_bits(v, x, y, census, 0, count_, bits_ + static_cast<ptrdiff_t>(v) * count_);
  }
  for (int32_t k = 0; k < count_; k += kBlock) {
    int16_t sum[kBlock] = {}, most[kBlock] = {}, num[kBlock] = {};
    for (int32_t v = 0; v < s_.num_views; ++v) {
      const uint8_t* const bits = bits_ + static_cast<ptrdiff_t>(v) * count_ + k;
      for (int32_t i = 0; i < kBlock; ++i) {
        const int16_t n = bits[i] == kAbsent ? 0 : bits[i];
        num[i] = static_cast<int16_t>(num[i] + (bits[i] == kAbsent ? 0 : 1));
        sum[i] = static_cast<int16_t>(sum[i] + n);
        most[i] = n > most[i] ? n : most[i];
      }
    }
    for (int32_t i = 0; i < kBlock; ++i) {
      const int32_t left = num[i] > 1 ? sum[i] - most[i] : sum[i];
      costs[k + i] = static_cast<uint8_t>(num[i] == 0 ? kNoViewCost : left * kShare[num[i]] >> 8);
    }
  }
}

void Sweep::fill_costs() {
  for (int32_t y = 0; y < height_; ++y) {
    for (int32_t x = 0; x < width_; ++x) costs_of(x, y);
  }
}

// Keeps the sums of a row relative to the least of each pixel; a plane that is 255 worse along half
// of the paths is never chosen.
void Sweep::keep_sums(int32_t y) {
  for (int32_t x = 0; x < width_; ++x) {
    const int16_t* const sums = sums_.at(x);
    uint8_t* const kept = kept_ + (static_cast<ptrdiff_t>(y) * width_ + x) * count_;
    int16_t least = kNever;
    for (int32_t k = 0; k < count_; ++k) least = std::min(least, sums[k]);
    for (int32_t k = 0; k < count_; ++k) {
      kept[k] = static_cast<uint8_t>(std::min(sums[k] - least, 255));
    }
  }
}

SweptPixel Sweep::choose(int32_t x, int32_t y) {
  const int16_t* const sums = sums_.at(x);
  int32_t best = 0;
  for (int32_t k = 1; k < count_; ++k) best = sums[k] < sums[best] ? k : best;
  if (census_at(x, y) == kNoCensus || best == 0 || best == count_ - 1) return {0, 0, 0};
  int32_t next = kNever;
  for (int32_t k = 0; k < best - 2; ++k) next = std::min<int32_t>(next, sums[k]);
  for (int32_t k = best + 3; k < count_; ++k) next = std::min<int32_t>(next, sums[k]);
  const int32_t before = sums[best - 1] - sums[best], after = sums[best + 1] - sums[best];
  // Two straight lines of equal slope through the three sums.
  const int32_t higher = std::max(before, after);
  const double fraction = higher > 0 ? (before - after) / (2.0 * higher) : 0.0;
  const double margin = static_cast<double>(next - sums[best]) / kPaths;
  const double part = kSigmaMargin / (margin + kMarginOffset);
  SweptPixel pixel;
  pixel.inverse_depth = s_.planes.first + (best + fraction) * s_.planes.step;
  pixel.sigma = std::sqrt(kSigmaFloor * kSigmaFloor + part * part) * s_.planes.step;
  pixel.witnesses = 0;
  const int32_t block = best / kBlock * kBlock;
  for (int32_t v = 0; v < s_.num_views; ++v) {
    differing_bits(v, x, y, census_at(x, y), block, block + kBlock, bits_);
    pixel.witnesses += bits_[best] <= kWitnessBits ? 1 : 0;
  }
  return pixel;
}

// Four paths: along the row and from the row before, or behind where it goes backward; kept sums
// are added on the way back, and each row is handed over.
void Sweep::go(bool forward, const SweptRows* rows) {
  const int32_t step = forward ? 1 : -1;
  const int32_t first_x = forward ? 0 : width_ - 1, first_y = forward ? 0 : height_ - 1;
  for (int p = 0; p < 3; ++p) {
    for (int32_t x = 0; x < width_; ++x) {
      least_before_[p][x] = 0;
      for (int32_t k = 0; k < count_; ++k) before_[p].at(x)[k] = 0;
    }
  }
  for (int32_t j = 0, y = first_y; j < height_; ++j, y += step) {
    int16_t least = 0;
    for (int32_t k = 0; k < count_; ++k) along_.at(1)[k] = 0;
    for (int32_t i = 0, x = first_x; i < width_; ++i, x += step) {
      const uint8_t* const cost = costs_at(x, y);
      const uint8_t* const kept = kept_ + (static_cast<ptrdiff_t>(y) * width_ + x) * count_;
      int16_t* const sums = sums_.at(x);
      for (int32_t k = 0; k < count_; ++k) sums[k] = forward ? 0 : kept[k];
      const int32_t grey = grey_at(x, y);
      const int32_t large = i > 0 ? large_cost(grey, grey_at(x - step, y)) : kLarge;
      least = follow(cost, along_.at(1 - (i & 1)), least, large, count_, along_.at(i & 1), sums);
      for (int p = 0; p < 3; ++p) {
        const int32_t from = std::min(std::max(x + p - 1, 0), width_ - 1);
        const int32_t down = j > 0 ? large_cost(grey, grey_at(from, y - step)) : kLarge;
        least_after_[p][x] = follow(cost, before_[p].at(from), least_before_[p][from], down, count_,
                                    after_[p].at(x), sums);
      }
    }
    for (int p = 0; p < 3; ++p) {
      std::swap(before_[p], after_[p]);
      std::swap(least_before_[p], least_after_[p]);
    }
    if (forward) {
      keep_sums(y);
    } else {
      for (int32_t x = 0; x < width_; ++x) row_[x] = choose(x, y);
      rows->take(rows->user, y, row_);
    }
  }
}

}  // namespace

size_t sweep_planes_bytes(const MapGrid& grid, int32_t max_planes, int32_t num_views) {
  const size_t width = static_cast<size_t>(grid.width), planes = static_cast<size_t>(max_planes);
  const size_t volume = width * static_cast<size_t>(grid.height) * planes;
  const size_t views = static_cast<size_t>(num_views), pitch = planes + 2 * kBlock;
  return 2 * arena_bytes<uint8_t>(volume) + 3 * views * arena_bytes<float>(planes) +
         arena_bytes<uint32_t>(planes) + arena_bytes<uint8_t>(planes * views) +
         7 * arena_bytes<int16_t>(width * pitch) + arena_bytes<int16_t>(2 * pitch) +
         6 * arena_bytes<int16_t>(width) + arena_bytes<SweptPixel>(width);
}

void sweep_planes(const PlaneSweep& sweep, const SweptRows& rows, Arena& arena) {
  const ArenaScope scope(arena);
  Sweep work(sweep, arena);
  work.fill_costs();
  work.go(true, nullptr);
  work.go(false, &rows);
}

}  // namespace tv
