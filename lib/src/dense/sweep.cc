// The costs, the five paths and the choice of semi-global matching.
#include "dense/sweep.h"

#include <algorithm>

namespace tv {
namespace {

// The window of the census: kAcross x kDown pixels; each pixel before the middle one is compared
// with that opposite to it, which makes 31 bits.
constexpr int32_t kHalfAcross = 4, kHalfDown = 3;
// Costs of a change of parallax along a path, by one step and by more; the latter is lower where
// the image has an edge.
constexpr int32_t kSmall = 5, kLeastLarge = 10, kLarge = 48, kEdge = 12;
constexpr int16_t kOutside = 15;  // the cost of a pixel outside image 1: that of a chance match
constexpr int16_t kNever = 8000;
// The winner's cost is below this share of the cost of any step that is not its neighbour.
constexpr int32_t kUnique = 97;
constexpr int32_t kPad = 8;  // entries before and behind a line of costs
// Loops over costs run in blocks of this many: a loop of known length becomes vector code in any
// build, and a small one.
constexpr int32_t kBlock = 8;

// A line of costs of one pixel: num_steps entries with kPad entries of kNever on both sides.
struct Lines {
  int16_t* data;
  ptrdiff_t stride;
  int16_t* at(ptrdiff_t x) const { return data + x * stride + kPad; }
};

ptrdiff_t stride_of(int32_t num_steps) { return num_steps + 2 * kPad; }

size_t lines_bytes(int32_t width, int32_t num_steps) {
  return arena_bytes<int16_t>(static_cast<size_t>(width) *
                              static_cast<size_t>(stride_of(num_steps)));
}

Lines make_lines(int32_t width, int32_t num_steps, Arena& arena) {
  const size_t count = static_cast<size_t>(width) * static_cast<size_t>(stride_of(num_steps));
  Lines lines{arena_alloc<int16_t>(arena, count), stride_of(num_steps)};
  for (int32_t x = 0; x < width; ++x) {
    int16_t* line = lines.at(x) - kPad;
    for (ptrdiff_t k = 0; k < lines.stride; ++k) line[k] = kNever;
    for (ptrdiff_t k = kPad; k < lines.stride - kPad; ++k) line[k] = 0;
  }
  return lines;
}

// The census of a row: 0 where the window is not wholly inside.
__attribute__((noinline)) void census_row(const uint8_t* pixels, int32_t width, int32_t height,
                                          int32_t y, uint32_t* census) {
  for (int32_t x = 0; x < width; ++x) census[x] = 0;
  if (y < kHalfDown || y + kHalfDown >= height) return;
  const uint8_t* middle = pixels + static_cast<ptrdiff_t>(y) * width;
  for (int32_t dy = -kHalfDown; dy <= 0; ++dy) {
    const int32_t last = dy < 0 ? kHalfAcross : -1;
    for (int32_t dx = -kHalfAcross; dx <= last; ++dx) {
      const ptrdiff_t offset = static_cast<ptrdiff_t>(dy) * width + dx;
      const uint8_t *before = middle + offset, *after = middle - offset;
      for (int32_t x = kHalfAcross; x < width - kHalfAcross; ++x) {
        census[x] = census[x] << 1 | (before[x] < after[x] ? 1u : 0u);
      }
    }
  }
}

// The number of bits in which a word differs from each of `count` others.
__attribute__((noinline)) void count_bits(uint32_t word, const uint32_t* others, int32_t count,
                                          int16_t* bits) {
  for (int32_t k = 0; k < count; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      uint32_t v = word ^ others[k + i];
      v = v - (v >> 1 & 0x55555555u);
      v = (v & 0x33333333u) + (v >> 2 & 0x33333333u);
      v = (v + (v >> 4)) & 0x0f0f0f0fu;
      v = v + (v >> 8);
      bits[k + i] = static_cast<int16_t>((v + (v >> 16)) & 63u);
    }
  }
}

int16_t least_of(const int16_t* block) {
  int16_t least = block[0];
  for (int32_t i = 1; i < kBlock; ++i) least = block[i] < least ? block[i] : least;
  return least;
}

// One step of a path: the costs of a pixel from those of the pixel before, which are added to
// `sums`. least_before is the least of `before`. Returns the least of `after`.
__attribute__((noinline)) int16_t follow(const int16_t* cost, const int16_t* before,
                                         int16_t least_before, int16_t large, int32_t count,
                                         int16_t* __restrict after, int16_t* __restrict sums) {
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
      way = static_cast<int16_t>(way + cost[k + i] - least_before);
      after[k + i] = way;
      sums[k + i] = static_cast<int16_t>(sums[k + i] + way);
      least[i] = way < least[i] ? way : least[i];
    }
  }
  return least_of(least);
}

int16_t large_cost(const uint8_t* pixels, ptrdiff_t before) {
  const int32_t change =
      pixels[0] > pixels[before] ? pixels[0] - pixels[before] : pixels[before] - pixels[0];
  return static_cast<int16_t>(std::max(kLeastLarge, kLarge * kEdge / (kEdge + change)));
}

__attribute__((noinline)) int16_t least_of_line(const int16_t* line, int32_t count) {
  int16_t block[kBlock];
  for (int16_t& value : block) value = kNever;
  for (int32_t k = 0; k < count; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      block[i] = line[k + i] < block[i] ? line[k + i] : block[i];
    }
  }
  return least_of(block);
}

// The step of the least sum, the first of several. *next is the least sum of the steps that are no
// neighbours of it. line: room for the sums.
int32_t least_step(const int16_t* sums, int32_t count, int16_t* line, int32_t* next) {
  const int16_t least = least_of_line(sums, count);
  int32_t at = 0;
  while (sums[at] != least) ++at;
  for (int32_t k = 0; k < count; ++k) line[k] = sums[k];
  for (int32_t k = at - 1; k <= at + 1; ++k) line[k] = kNever;  // at the ends, in the padding
  *next = least_of_line(line, count);
  return at;
}

// Lowers each of `least` to the sum beside it.
__attribute__((noinline)) void lower(const int16_t* sums, int32_t count, int16_t* least) {
  for (int32_t k = 0; k < count; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      const int16_t old = least[k + i];
      least[k + i] = sums[k + i] < old ? sums[k + i] : old;
    }
  }
}

// The rows of the paths that come from above: from the left, from straight above, from the right.
struct Above {
  Lines before[3], after[3];
  int16_t* least_before[3];
  int16_t* least_after[3];
};

}  // namespace

size_t match_rows_bytes(int32_t width, int32_t num_steps) {
  const size_t n = static_cast<size_t>(width), steps = static_cast<size_t>(num_steps);
  return 8 * lines_bytes(width, num_steps) + lines_bytes(2, num_steps) +
         6 * arena_bytes<int16_t>(n) + arena_bytes<uint32_t>(n) + arena_bytes<uint32_t>(n + steps) +
         arena_bytes<int16_t>(n + steps);
}

void match_rows(const RowPair& rows, Arena& arena, int16_t* steps) {
  const ArenaScope scope(arena);
  const int32_t width = rows.width, count = rows.num_steps, width1 = width + count - 1;
  const size_t n = static_cast<size_t>(width), n1 = n + static_cast<size_t>(count);
  const Lines costs = make_lines(width, count, arena), sums = make_lines(width, count, arena);
  const Lines pair = make_lines(2, count, arena);
  Above above;
  for (int p = 0; p < 3; ++p) {
    above.before[p] = make_lines(width, count, arena);
    above.after[p] = make_lines(width, count, arena);
    above.least_before[p] = arena_alloc<int16_t>(arena, n);
    above.least_after[p] = arena_alloc<int16_t>(arena, n);
    for (int32_t x = 0; x < width; ++x) above.least_before[p][x] = 0;
  }
  uint32_t* const census0 = arena_alloc<uint32_t>(arena, n);
  uint32_t* const census1 = arena_alloc<uint32_t>(arena, n1);
  int16_t* const least1 = arena_alloc<int16_t>(arena, n1);

  for (int32_t y = 0; y < rows.height; ++y) {
    const uint8_t* row0 = rows.pixels0 + static_cast<ptrdiff_t>(y) * width;
    const uint8_t* row1 = rows.pixels1 + static_cast<ptrdiff_t>(y) * width1;
    int16_t* const found = steps + static_cast<ptrdiff_t>(y) * width;
    census_row(rows.pixels0, width, rows.height, y, census0);
    census_row(rows.pixels1, width1, rows.height, y, census1);
    for (int32_t x = 0; x < width; ++x) {
      int16_t *cost = costs.at(x), *sum = sums.at(x);
      if (row0[x] == 0) {
        for (int32_t k = 0; k < count; ++k) cost[k] = 0;
      } else {
        count_bits(census0[x], census1 + x, count, cost);
        for (int32_t k = 0; k < count; ++k) {
          if (row1[x + k] == 0) cost[k] = kOutside;
        }
      }
      for (int32_t k = 0; k < count; ++k) sum[k] = 0;
    }
    // From the left, and the three paths from above.
    int16_t least = 0;
    for (int32_t k = 0; k < count; ++k) pair.at(1)[k] = 0;
    for (int32_t x = 0; x < width; ++x) {
      const int16_t large = x > 0 ? large_cost(row0 + x, -1) : static_cast<int16_t>(kLarge);
      least = follow(costs.at(x), pair.at(1 - (x & 1)), least, large, count, pair.at(x & 1),
                     sums.at(x));
      for (int p = 0; p < 3; ++p) {
        const int32_t from = std::min(std::max(x + p - 1, 0), width - 1);
        const int16_t down =
            y > 0 ? large_cost(row0 + x, from - x - width) : static_cast<int16_t>(kLarge);
        above.least_after[p][x] =
            follow(costs.at(x), above.before[p].at(from), above.least_before[p][from], down, count,
                   above.after[p].at(x), sums.at(x));
      }
    }
    for (int p = 0; p < 3; ++p) {
      std::swap(above.before[p], above.after[p]);
      std::swap(above.least_before[p], above.least_after[p]);
    }
    // From the right.
    least = 0;
    for (int32_t k = 0; k < count; ++k) pair.at(width & 1)[k] = 0;
    for (int32_t x = width - 1; x >= 0; --x) {
      const int16_t large = x < width - 1 ? large_cost(row0 + x, 1) : static_cast<int16_t>(kLarge);
      least = follow(costs.at(x), pair.at(1 - (x & 1)), least, large, count, pair.at(x & 1),
                     sums.at(x));
    }
    // The least sum of each pixel of image 1: the choice of the opposite direction has it.
    for (int32_t x = 0; x < width1; ++x) least1[x] = kNever;
    for (int32_t x = 0; x < width; ++x) lower(sums.at(x), count, least1 + x);
    for (int32_t x = 0; x < width; ++x) {
      const int16_t* const sum = sums.at(x);
      int32_t next;
      const int32_t k = least_step(sum, count, pair.at(0), &next);
      bool good = row0[x] != 0 && row1[x + k] != 0 && k > 0 && k < count - 1 &&
                  100 * sum[k] < kUnique * next;
      if (good && sum[k] != least1[x + k]) {
        good = (x > 0 && sums.at(x - 1)[k + 1] == least1[x + k]) ||
               (x < width - 1 && sums.at(x + 1)[k - 1] == least1[x + k]);
      }
      found[x] = static_cast<int16_t>(good ? k : -1);
    }
  }
}

void keep_supported(const int16_t* steps, int32_t width, int32_t height, int16_t* kept) {
  constexpr int32_t kReach = 4, kLeastShare = 60;  // per cent of a window of 9 x 9
  for (int32_t y = 0; y < height; ++y) {
    const int32_t top = std::max(0, y - kReach), bottom = std::min(height - 1, y + kReach);
    for (int32_t x = 0; x < width; ++x) {
      const ptrdiff_t at = static_cast<ptrdiff_t>(y) * width + x;
      kept[at] = -1;
      if (steps[at] < 0) continue;
      const int32_t left = std::max(0, x - kReach), right = std::min(width - 1, x + kReach);
      int32_t alike = 0;
      for (int32_t v = top; v <= bottom; ++v) {
        const int16_t* row = steps + static_cast<ptrdiff_t>(v) * width;
        for (int32_t u = left; u <= right; ++u) {
          const int32_t change = row[u] - steps[at];
          alike += change >= -1 && change <= 1 ? 1 : 0;
        }
      }
      if (100 * alike >= kLeastShare * (bottom - top + 1) * (right - left + 1))
        kept[at] = steps[at];
    }
  }
}

}  // namespace tv
