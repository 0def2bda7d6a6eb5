// Reduced images of an image: levels, on which corners are found, and octaves, on which keypoints
// are described.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/image.h"

namespace tv {

inline constexpr int32_t kMaxLevels = 8;
inline constexpr int32_t kMaxOctaves = 8;
inline constexpr int32_t kMinLevelSide = 24;  // pixels; no image is reduced to a shorter side

// A reduced image. Its pixel (x, y) is the average of scale x scale pixels of the full image around
// ((x + 0.5) scale - 0.5, (y + 0.5) scale - 0.5).
struct Level {
  const uint8_t* data;
  int32_t width, height;
  int64_t stride;
  double scale;  // the side of a pixel of this level, in pixels of the full image
};

inline Level full_level(const tv_image& image) {
  return Level{image.data, image.width, image.height, image.stride_bytes, 1.0};
}

inline double to_level(double scale, double x) { return (x + 0.5) / scale - 0.5; }
inline double to_full(const Level& level, double x) { return (x + 0.5) * level.scale - 0.5; }
inline double to_level(const Level& level, double x) { return to_level(level.scale, x); }

// Buffers for making levels one after another. Each level is made from the one before and written
// to the other pixel buffer, so a level is valid until the second call of next_level after the one
// that made it.
struct LevelBuffers {
  uint8_t* pixels[2];
  uint16_t* sums[3];  // the level's columns of three source rows; row y is in sums[y % 3]
  tvk_columns columns;
};

size_t level_buffers_bytes(int32_t max_width, int32_t max_height);
LevelBuffers alloc_level_buffers(Arena& arena, int32_t max_width, int32_t max_height);

// Makes the next smaller level by averaging factor x factor pixels for each of its pixels, factor
// in (1, 2]. Returns false, and makes nothing, when a side would be shorter than kMinLevelSide.
// `index` is the number of levels made so far; it selects the buffer.
bool next_level(const tvk_set& set, const Level& level, double factor, int32_t index,
                LevelBuffers& buffers, Level* next);

// The image halved zero or more times and blurred by the 3x3 binomial filter. Its rows are stored
// in pairs: pairs[y (width + 1) + x] holds pixel (x, y) in the low byte and the pixel below it in
// the high byte, each less 128 (kernel pair_rows). The last row is paired with itself, and column
// `width` repeats the one before it.
struct Octave {
  const uint16_t* pairs;
  int32_t width, height;
  double scale;  // the side of a pixel of this octave, in pixels of the full image
};

struct Octaves {
  Octave octaves[kMaxOctaves];
  int32_t count;
};

size_t octaves_bytes(int32_t max_width, int32_t max_height);

// Makes the octaves `first` to `last`; those before `first` are left unfilled. `count` is last + 1,
// or less where the image is too small for `last` (kMinLevelSide) or `last` is not below
// kMaxOctaves. The octave count - 1 is always filled, even if it comes before `first`.
Octaves make_octaves(const tvk_set& set, const tv_image& image, int32_t first, int32_t last,
                     Arena& arena);

}  // namespace tv
