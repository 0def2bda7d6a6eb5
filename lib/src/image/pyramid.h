// Smaller images of an image: levels to find corners on, octaves to describe them on.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/image.h"

namespace tv {

inline constexpr int32_t kMaxLevels = 8;
inline constexpr int32_t kMaxOctaves = 8;
inline constexpr int32_t kMinLevelSide = 24;  // a smaller level holds no patch worth describing

// An image whose pixel (x, y) is the average around ((x + 0.5) scale - 0.5, ...) of the full image.
struct Level {
  const uint8_t* data;
  int32_t width, height;
  int64_t stride;
  double scale;  // full-image pixels in one of its pixels
};

inline Level full_level(const tv_image& image) {
  return Level{image.data, image.width, image.height, image.stride_bytes, 1.0};
}

inline double to_level(double scale, double x) { return (x + 0.5) / scale - 0.5; }
inline double to_full(const Level& level, double x) { return (x + 0.5) * level.scale - 0.5; }
inline double to_level(const Level& level, double x) { return to_level(level.scale, x); }

// Two buffers that take turns: a level is made from the one before it, which then is free again.
struct LevelBuffers {
  uint8_t* pixels[2];
  uint16_t* sums;           // one row
  int32_t* first;           // one row
  int32_t* column_weights;  // three rows
};

size_t level_buffers_bytes(int32_t max_width, int32_t max_height);
LevelBuffers alloc_level_buffers(Arena& arena, int32_t max_width, int32_t max_height);

// The next smaller level, by area averaging over factor x factor pixels, factor in (1, 2]. False
// when it would be smaller than kMinLevelSide. `index` counts the levels made, and picks the
// buffer.
bool next_level(const tvk_table& kernels, const Level& level, double factor, int32_t index,
                LevelBuffers& buffers, Level* next);

// The image halved some times and blurred by the 3x3 binomial, its rows stored in pairs:
// pairs[y (width + 1) + x] holds pixel (x, y) and the one below it, each less 128 (tvk pair_rows).
struct Octave {
  const uint16_t* pairs;
  int32_t width, height;
  double scale;  // full-image pixels in one of its pixels
};

struct Octaves {
  Octave octaves[kMaxOctaves];
  int32_t count;
};

size_t octaves_bytes(int32_t max_width, int32_t max_height);

// Makes the octaves from `first` to `last` (fewer where the image is too small, at least one in
// all); those before `first` are not filled in.
Octaves make_octaves(const tvk_table& kernels, const tv_image& image, int32_t first, int32_t last,
                     Arena& arena);

}  // namespace tv
