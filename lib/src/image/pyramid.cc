// Makes the levels and octaves of image/pyramid.h, row by row with the kernels of
// kernels/resample.h and pair_rows. Test: test/unit/test_pyramid.cc.
#include "image/pyramid.h"

#include <algorithm>

namespace tv {
namespace {

// The source pixels that are averaged into target pixel x: `first` and the two after it, with
// weights that add up to 256. A weight of 0 means that the pixel is not used.
struct Footprint {
  int32_t first;
  int32_t weights[3];
};

Footprint footprint(int32_t x, double factor) {
  const double begin = x * factor, end = (x + 1) * factor;
  Footprint f{static_cast<int32_t>(begin), {0, 0, 0}};
  int32_t rest = 256;
  for (int k = 0; k < 3; ++k) {
    const double low = begin > f.first + k ? begin : f.first + k;
    const double high = end < f.first + k + 1 ? end : f.first + k + 1;
    const double share = (high > low ? high - low : 0.0) / factor;
    const int32_t weight = static_cast<int32_t>(256 * share + 0.5);
    f.weights[k] = high >= end ? rest : std::min(weight, rest);
    rest -= f.weights[k];
  }
  return f;
}

void halve(const tvk_detect_table& kernels, const Level& source, uint8_t* pixels, int32_t width,
           int32_t height) {
  for (int32_t y = 0; y < height; ++y) {
    const uint8_t* row = source.data + 2 * y * source.stride;
    kernels.halve_row(row, row + source.stride, width, pixels + static_cast<int64_t>(y) * width);
  }
}

// The columns that average_columns makes at once, and the pixels that it reads for eight of them.
constexpr int32_t kColumns = 16, kColumnPixels = 18;

size_t padded_columns(int32_t width) {
  return static_cast<size_t>((width + kColumns - 1) / kColumns * kColumns);
}

// Fills `columns` for the new columns 0 .. width - 1, and for those that pad them with weight 0.
void plan_columns(int32_t source_width, double factor, int32_t width, tvk_columns& columns) {
  const int32_t last = source_width - 3;  // the last pixel that can be the first of three
  int32_t block_first = 0;
  for (int32_t x = 0; x < static_cast<int32_t>(padded_columns(width)); ++x) {
    const Footprint f = x < width ? footprint(x, factor) : Footprint{last, {0, 0, 0}};
    if (x % 8 == 0) {
      block_first = std::min(f.first, source_width - kColumnPixels);
      columns.first[x / 8] = block_first;
    }
    // A footprint of the last two pixels becomes one of the last three, the first without weight.
    const int32_t first = std::min(f.first, last), moved = f.first - first;
    columns.picks[x] = static_cast<uint16_t>(0xff00 + first - block_first);
    for (int k = 0; k < 3; ++k) {
      columns.weights[k][x] = static_cast<uint16_t>(k < moved ? 0 : f.weights[k - moved]);
    }
  }
}

void average(const tvk_detect_table& kernels, const Level& source, double factor,
             LevelBuffers& buffers, uint8_t* pixels, int32_t width, int32_t height) {
  plan_columns(source.width, factor, width, buffers.columns);
  int32_t made = 0;  // the rows of `source` whose columns are averaged
  for (int32_t y = 0; y < height; ++y) {
    const Footprint f = footprint(y, factor);
    const uint16_t* rows[3];
    for (int k = 0; k < 3; ++k) {
      const int32_t row = f.weights[k] != 0 ? f.first + k : f.first;
      for (; made <= row; ++made) {
        kernels.average_columns(source.data + made * source.stride, &buffers.columns, width,
                                buffers.sums[made % 3]);
      }
      rows[k] = buffers.sums[row % 3];
    }
    kernels.average_rows(rows, f.weights, width, pixels + static_cast<int64_t>(y) * width);
  }
}

// Blurs the level and writes the blurred rows in pairs. `rows` is scratch for two blurred rows.
void make_octave(const tvk_describe_table& kernels, const Level& source, uint8_t* rows[2],
                 uint16_t* pairs) {
  const int32_t last = source.height - 1;
  for (int32_t y = 0; y <= last; ++y) {
    const uint8_t* row = source.data + y * source.stride;
    kernels.blur_row(y > 0 ? row - source.stride : row, row, y < last ? row + source.stride : row,
                     source.width, rows[y & 1]);
    const int64_t above = static_cast<int64_t>(y - 1) * (source.width + 1);
    if (y > 0) kernels.pair_rows(rows[(y - 1) & 1], rows[y & 1], source.width, pairs + above);
  }
  kernels.pair_rows(rows[last & 1], rows[last & 1], source.width,
                    pairs + static_cast<int64_t>(last) * (source.width + 1));
}

size_t area(int32_t width, int32_t height) {
  return static_cast<size_t>(width) * static_cast<size_t>(height);
}

}  // namespace

size_t level_buffers_bytes(int32_t max_width, int32_t max_height) {
  const size_t columns = padded_columns(max_width);
  return 2 * arena_bytes<uint8_t>(area(max_width, max_height)) +
         7 * arena_bytes<uint16_t>(columns) + arena_bytes<int32_t>(columns / 8);
}

LevelBuffers alloc_level_buffers(Arena& arena, int32_t max_width, int32_t max_height) {
  const size_t columns = padded_columns(max_width);
  LevelBuffers buffers;
  for (uint8_t*& pixels : buffers.pixels) {
    pixels = arena_alloc<uint8_t>(arena, area(max_width, max_height));
  }
  for (uint16_t*& sums : buffers.sums) sums = arena_alloc<uint16_t>(arena, columns);
  for (uint16_t*& weights : buffers.columns.weights)
    weights = arena_alloc<uint16_t>(arena, columns);
  buffers.columns.picks = arena_alloc<uint16_t>(arena, columns);
  buffers.columns.first = arena_alloc<int32_t>(arena, columns / 8);
  return buffers;
}

bool next_level(const tvk_set& set, const Level& level, double factor, int32_t index,
                LevelBuffers& buffers, Level* next) {
  const int32_t width = static_cast<int32_t>(level.width / factor);
  const int32_t height = static_cast<int32_t>(level.height / factor);
  if (width < kMinLevelSide || height < kMinLevelSide) return false;
  const tvk_detect_table& kernels = *tvk_detect_of(&set);
  uint8_t* pixels = buffers.pixels[index & 1];
  if (factor == 2.0) {
    halve(kernels, level, pixels, width, height);
  } else {
    average(kernels, level, factor, buffers, pixels, width, height);
  }
  *next = Level{pixels, width, height, width, level.scale * factor};
  return true;
}

size_t octaves_bytes(int32_t max_width, int32_t max_height) {
  // Every octave needs its rows in pairs, and all but the first a halved image. Areas fall by a
  // factor of four from one octave to the next.
  size_t bytes = 2 * arena_bytes<uint8_t>(static_cast<size_t>(max_width));
  for (int32_t o = 0; o < kMaxOctaves; ++o) {
    const int32_t width = max_width >> o, height = max_height >> o;
    bytes += arena_bytes<uint16_t>(area(width + 1, height));
    if (o > 0) bytes += arena_bytes<uint8_t>(area(width, height));
  }
  return bytes;
}

Octaves make_octaves(const tvk_set& set, const tv_image& image, int32_t first, int32_t last,
                     Arena& arena) {
  Octaves octaves{};
  Level level = full_level(image);
  uint8_t* rows[2];
  for (uint8_t*& row : rows) row = arena_alloc<uint8_t>(arena, static_cast<size_t>(level.width));
  for (int32_t o = 0; o < kMaxOctaves; ++o) {
    const int32_t width = level.width / 2, height = level.height / 2;
    const bool is_coarsest = o >= last || width < kMinLevelSide || height < kMinLevelSide;
    if (o >= first || is_coarsest) {
      uint16_t* pairs = arena_alloc<uint16_t>(arena, area(level.width + 1, level.height));
      make_octave(*tvk_describe_of(&set), level, rows, pairs);
      octaves.octaves[o] = Octave{pairs, level.width, level.height, level.scale};
    }
    octaves.count = o + 1;
    if (is_coarsest) break;
    uint8_t* halved = arena_alloc<uint8_t>(arena, area(width, height));
    halve(*tvk_detect_of(&set), level, halved, width, height);
    level = Level{halved, width, height, width, level.scale * 2};
  }
  return octaves;
}

}  // namespace tv
