// The pyramid's levels compared with area averaging in long double, its coordinates, and the
// octaves.

#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include <cmath>
#include <initializer_list>

#include "image/pyramid.h"
#include "support/random.h"
#include "twoview/context.h"

namespace {

constexpr int kMaxSide = 260;
uint8_t pixels[kMaxSide * kMaxSide];
alignas(64) uint8_t arena_memory[1 << 20];

// The average of the image over [x0, x1) x [y0, y1), each pixel being a square of one grey level.
long double area_average(const tv::Level& image, long double x0, long double y0, long double x1,
                         long double y1) {
  long double sum = 0;
  for (int y = static_cast<int>(y0); y < image.height && y < y1; ++y) {
    const long double h = std::fmin(y1, y + 1.0L) - std::fmax(y0, static_cast<long double>(y));
    for (int x = static_cast<int>(x0); x < image.width && x < x1; ++x) {
      const long double w = std::fmin(x1, x + 1.0L) - std::fmax(x0, static_cast<long double>(x));
      sum += h * w * image.data[y * image.stride + x];
    }
  }
  return sum / ((x1 - x0) * (y1 - y0));
}

tv::Level noise_image(uint64_t* seed, int width, int height, int stride) {
  random_bytes(seed, pixels, sizeof pixels);
  if (random_int(seed, 0, 1) == 0) {
    for (uint8_t& p : pixels) p = p < 128 ? 0 : 255;
  }
  return tv::Level{pixels, width, height, stride, 1.0};
}

// In grey levels. The weights are multiples of 1/256 along each axis, and those of a pixel sum to
// 1. Rounding them moves at most 1/256 of the weight (0.5/256 twice with three pixels) from one
// pixel to others, whose grey levels differ by at most 255: an error of up to 255/256 for each
// axis. Rounding the result adds 0.5.
constexpr double kMaxAverageError = 2 * 255.0 / 256.0 + 0.5;

void check_level(const tvk_set& kernels, uint64_t* seed, int width, int height, double factor) {
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  TEST_ASSERT_LESS_OR_EQUAL(sizeof arena_memory, tv::level_buffers_bytes(width, height));
  tv::LevelBuffers buffers = tv::alloc_level_buffers(arena, width, height);
  TEST_ASSERT_TRUE(arena.used_bytes == tv::level_buffers_bytes(width, height));
  const tv::Level level = noise_image(seed, width, height, width + random_int(seed, 0, 3));
  tv::Level next;
  const int expected_width = static_cast<int>(width / factor);
  const int expected_height = static_cast<int>(height / factor);
  const bool made = tv::next_level(kernels, level, factor, 0, buffers, &next);
  TEST_ASSERT_EQUAL_INT(expected_width >= tv::kMinLevelSide && expected_height >= tv::kMinLevelSide,
                        made);
  if (!made) return;
  TEST_ASSERT_EQUAL_INT(expected_width, next.width);
  TEST_ASSERT_EQUAL_INT(expected_height, next.height);
  TEST_ASSERT_EQUAL_DOUBLE(factor, next.scale);
  double sum_error = 0.0;
  for (int y = 0; y < next.height; ++y) {
    for (int x = 0; x < next.width; ++x) {
      const long double f = factor;
      const double exact =
          static_cast<double>(area_average(level, x * f, y * f, (x + 1) * f, (y + 1) * f));
      const double error = next.data[y * next.stride + x] - exact;
      TEST_ASSERT_DOUBLE_WITHIN(kMaxAverageError, 0.0, error);
      sum_error += error;
    }
  }
  // The mean error comes only from the rounding of halves upwards: 3/16 of a grey level where a new
  // pixel is the average of four that are black or white.
  TEST_ASSERT_DOUBLE_WITHIN(0.2, 0.0, sum_error / (next.width * next.height));
}

void test_levels_are_area_averages() {
  uint64_t seed = 21;
  for (int set = TV_KERNELS_C; set <= TV_KERNELS_NEON; ++set) {
    const tvk_set* kernels = tvk_select(set);
    if (kernels == nullptr) continue;
    for (float factor : {1.1f, 1.2f, 1.25f, 1.33333f, 1.41421f, 1.5f, 1.9f, 1.99999f, 2.0f}) {
      check_level(*kernels, &seed, 97, 63, factor);
      check_level(*kernels, &seed, 64, 101, factor);
      check_level(*kernels, &seed, kMaxSide, 48, factor);
      check_level(*kernels, &seed, 49, 53, factor);
    }
  }
}

void test_the_largest_factor_reads_nothing_outside() {
  // Where the factor divides the size exactly, the last pixel ends at the image's edge.
  uint64_t seed = 22;
  for (int side = 48; side <= 120; side += 3) {
    for (float factor : {1.125f, 1.5f, 1.5000001f, 1.75f, 2.0f}) {
      check_level(*tvk_select(TV_KERNELS_AUTO), &seed, side, side + 5, factor);
    }
  }
}

void test_a_constant_image_stays_constant() {
  for (int grey : {0, 1, 77, 254, 255}) {
    memset(pixels, grey, sizeof pixels);
    for (float factor : {1.1f, 1.2f, 1.37f, 1.7f, 1.85f, 2.0f}) {
      tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
      tv::LevelBuffers buffers = tv::alloc_level_buffers(arena, 201, 155);
      tv::Level level{pixels, 201, 155, 211, 1.0};
      const tvk_set& kernels = *tvk_select(TV_KERNELS_AUTO);
      for (int k = 0; tv::next_level(kernels, level, factor, k, buffers, &level); ++k) {
        for (int p = 0; p < level.width * level.height; ++p) {
          TEST_ASSERT_EQUAL_INT(grey, level.data[p]);
        }
      }
      TEST_ASSERT_TRUE(level.width < 201);
    }
  }
}

// Bilinear interpolation at positions clamped to the image, less 128, times 127^2 / 256. Fractions
// are multiples of 1/128 pixel along each axis, an error of 255 / 128 each between a black and a
// white pixel; the last shift truncates by up to 1.
void test_patches_are_bilinear_samples() {
  constexpr double kUnit = 127.0 * 127.0 / 256.0;
  constexpr double kMaxError = 2 * 255 / 128.0 * kUnit + 1;
  constexpr int kRows = 12, kPatch = TVK_PATCH_SIDE, kWidth = 37, kHeight = 29, kStride = 41;
  uint64_t seed = 24;
  const tv::Level image = noise_image(&seed, kWidth, kHeight, kStride);
  uint16_t pairs[kHeight * (kWidth + 1)];
  for (int y = 0; y < kHeight; ++y) {
    const uint8_t* row = image.data + y * kStride;
    tvk_describe_of(tvk_select(TV_KERNELS_AUTO))
        ->pair_rows(row, y + 1 < kHeight ? row + kStride : row, kWidth, pairs + y * (kWidth + 1));
  }
  double sum = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const int x = random_int(&seed, -10 * 65536, 45 * 65536);
    const int y = random_int(&seed, -10 * 65536, 37 * 65536);
    const int du_x = random_int(&seed, -70000, 70000), du_y = random_int(&seed, -70000, 70000);
    int16_t patch[kRows * kPatch + 1];
    tvk_describe_of(tvk_select(trial % 2 ? TV_KERNELS_AUTO : TV_KERNELS_C))
        ->sample_patch(pairs, kWidth, kHeight, x, y, du_x, du_y, kRows, patch);
    for (int k = 0; k < kRows * kPatch; ++k) {
      const int i = k % kPatch, j = k / kPatch;
      const double sx = std::fmin(kWidth - 1, std::fmax(0, (x + i * du_x - j * du_y) / 65536.0));
      const double sy = std::fmin(kHeight - 1, std::fmax(0, (y + i * du_y + j * du_x) / 65536.0));
      const int ix = static_cast<int>(std::fmin(kWidth - 2, sx));
      const int iy = static_cast<int>(std::fmin(kHeight - 2, sy));
      const uint8_t* p = image.data + iy * kStride + ix;
      const double fx = sx - ix, fy = sy - iy;
      const double grey = (1 - fy) * ((1 - fx) * p[0] + fx * p[1]) +
                          fy * ((1 - fx) * p[kStride] + fx * p[kStride + 1]);
      TEST_ASSERT_DOUBLE_WITHIN(kMaxError, kUnit * (grey - 128), patch[k]);
      sum += patch[k] - kUnit * (grey - 128);
    }
    TEST_ASSERT_EQUAL_INT(0, patch[kRows * kPatch]);
  }
  TEST_ASSERT_DOUBLE_WITHIN(1, -0.5, sum / (4000.0 * kRows * kPatch));
}

void test_coordinates_go_to_a_level_and_back() {
  for (double scale : {1.0, 1.1, 2.0, 2.56, 128.0}) {
    const tv::Level level{nullptr, 0, 0, 0, scale};
    for (double x : {-0.5, 0.0, 17.25, 16383.5}) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-10, x, tv::to_level(level, tv::to_full(level, x)));
    }
    // The image's corner, half a pixel before the first pixel's centre, is the corner of every
    // level too.
    TEST_ASSERT_EQUAL_DOUBLE(-0.5, tv::to_full(level, -0.5));
  }
}

// A horizontal ramp has the same value at the position that to_full returns, so levels are not
// shifted.
void test_a_ramp_keeps_its_place_on_every_level() {
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 250; ++x) pixels[y * 250 + x] = static_cast<uint8_t>(x);
  }
  for (float factor : {1.2f, 1.5f, 2.0f}) {
    tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
    tv::LevelBuffers buffers = tv::alloc_level_buffers(arena, 250, 120);
    tv::Level level{pixels, 250, 120, 250, 1.0};
    double tolerance = 0.0;
    for (int k = 0; tv::next_level(*tvk_select(TV_KERNELS_C), level, factor, k, buffers, &level);
         ++k) {
      // Neighbours differ by `scale` grey levels, weights are wrong by 1/256, and each level rounds
      // by 0.5.
      tolerance += 0.5 + level.scale * 2 / 256;
      for (int x = 0; x < level.width; ++x) {
        TEST_ASSERT_DOUBLE_WITHIN(tolerance, tv::to_full(level, x), level.data[x]);
      }
    }
  }
}

int blurred(const tv::Level& image, int x, int y) {
  constexpr int weights[3] = {1, 2, 1};
  int sum = 8;
  for (int j = -1; j <= 1; ++j) {
    for (int i = -1; i <= 1; ++i) {
      const int cx = x + i < 0 ? 0 : x + i >= image.width ? image.width - 1 : x + i;
      const int cy = y + j < 0 ? 0 : y + j >= image.height ? image.height - 1 : y + j;
      sum += weights[j + 1] * weights[i + 1] * image.data[cy * image.stride + cx];
    }
  }
  return sum >> 4;
}

void test_octaves_are_halved_then_blurred() {
  uint64_t seed = 23;
  uint8_t halved[kMaxSide * kMaxSide], smaller[kMaxSide * kMaxSide];
  for (int width : {1, 2, 23, 47, 48, 97, 200, 322, 323, 500}) {
    for (int height : {1, 30, 49, 131}) {
      const tv::Level full = noise_image(&seed, width, height, width + 5);
      const tv_image image{full.data, width, height, full.stride};
      for (int first = 0; first < 4; ++first) {
        tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
        const tv::Octaves octaves =
            tv::make_octaves(*tvk_select(TV_KERNELS_AUTO), image, first, 3, arena);
        TEST_ASSERT_TRUE(arena.used_bytes <= tv::octaves_bytes(width, height));
        TEST_ASSERT_TRUE(octaves.count >= 1 && octaves.count <= 4);
        tv::Level level = full;
        for (int o = 0; o < octaves.count; ++o) {
          const tv::Octave& octave = octaves.octaves[o];
          if (octave.pairs != nullptr) {
            TEST_ASSERT_EQUAL_INT(level.width, octave.width);
            TEST_ASSERT_EQUAL_INT(level.height, octave.height);
            TEST_ASSERT_EQUAL_DOUBLE(std::ldexp(1.0, o), octave.scale);
            for (int y = 0; y < level.height; ++y) {
              const int below = y + 1 < level.height ? y + 1 : y;
              for (int x = 0; x <= level.width; ++x) {
                const int column = x < level.width ? x : x - 1;
                const int pair = octave.pairs[y * (level.width + 1) + x];
                TEST_ASSERT_EQUAL_INT(blurred(level, column, y) ^ 128, pair & 255);
                TEST_ASSERT_EQUAL_INT(blurred(level, column, below) ^ 128, pair >> 8);
              }
            }
          } else {
            TEST_ASSERT_TRUE(o < first && o + 1 < octaves.count);
          }
          const tv::Level next{smaller, level.width / 2, level.height / 2, level.width / 2, 0.0};
          for (int y = 0; y < next.height; ++y) {
            for (int x = 0; x < next.width; ++x) {
              const uint8_t* p = level.data + 2 * y * level.stride + 2 * x;
              smaller[y * next.width + x] = static_cast<uint8_t>(
                  (p[0] + p[1] + p[level.stride] + p[level.stride + 1] + 2) / 4);
            }
          }
          memcpy(halved, smaller, sizeof halved);
          level = tv::Level{halved, next.width, next.height, next.width, 0.0};
        }
      }
    }
  }
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_levels_are_area_averages);
  RUN_TEST(test_the_largest_factor_reads_nothing_outside);
  RUN_TEST(test_a_constant_image_stays_constant);
  RUN_TEST(test_patches_are_bilinear_samples);
  RUN_TEST(test_coordinates_go_to_a_level_and_back);
  RUN_TEST(test_a_ramp_keeps_its_place_on_every_level);
  RUN_TEST(test_octaves_are_halved_then_blurred);
  return UNITY_END();
}
