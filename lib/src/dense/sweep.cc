// The costs, the five paths and the choice of semi-global matching.
#include "dense/sweep.h"

#include <algorithm>

#include "dense/lines.h"

namespace tv {
namespace {

// Costs of a change of parallax along a path, by one step and by more; the latter is lower where
// the image has an edge.
constexpr int32_t kLeastLarge = 10, kLarge = 48, kEdge = 12;
constexpr int16_t kOutside = 15;  // the cost of a pixel outside image 1: that of a chance match
// The winner's cost is below this share of the cost of any step that is not its neighbour.
constexpr int32_t kUnique = 97;
constexpr int32_t kPad = 8;  // entries before and behind a line of costs

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

int16_t large_cost(const uint8_t* pixels, ptrdiff_t before) {
  const int32_t change =
      pixels[0] > pixels[before] ? pixels[0] - pixels[before] : pixels[before] - pixels[0];
  return static_cast<int16_t>(std::max(kLeastLarge, kLarge * kEdge / (kEdge + change)));
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
