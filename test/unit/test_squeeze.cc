// Squeezed images compared with the mean over each pixel's parallelogram in long double, their map
// back to the image, what is left of stripes, and the mask.

#include "image/squeeze.h"

#include <string.h>
#include <unity.h>

#include <cmath>
#include <cstdint>
#include <initializer_list>

#include "base/math.h"
#include "support/random.h"
#include "twoview/context.h"

namespace {

constexpr int kMaxSide = 160;
uint8_t pixels[kMaxSide * kMaxSide], given[kMaxSide * kMaxSide];
alignas(64) uint8_t arena_memory[1 << 20];

struct Shape {
  double tilt, angle_rad;
};
constexpr double kDegree = tv::kPi / 180;
constexpr Shape kShapes[] = {{1, 0},
                             {2, 0},
                             {2, 45 * kDegree},
                             {2, 90 * kDegree},
                             {2, 135 * kDegree},
                             {1.5, 20 * kDegree},
                             {2.8284271247461903, 112.5 * kDegree},
                             {2.8284271247461903, 90 * kDegree},
                             {2.8284271247461903, 10 * kDegree},
                             {3, 0},
                             {3, 160 * kDegree}};

tv::Squeeze squeeze_of(const Shape& shape, int width, int height) {
  return tv::make_squeeze(shape.tilt, std::cos(shape.angle_rad), std::sin(shape.angle_rad), width,
                          height);
}

tv_image image_of(int width, int height) { return tv_image{pixels, width, height, kMaxSide}; }

tv::Squeezed squeezed(const tv_image& image, const tv_image* mask, const tv::Squeeze& squeeze,
                      const tvk_set* kernels = tvk_select(TV_KERNELS_C)) {
  const size_t bytes = tv::squeeze_bytes(squeeze, image.width);
  TEST_ASSERT_LESS_OR_EQUAL(sizeof arena_memory, bytes);
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  const tv::Squeezed made = tv::squeeze_image(*kernels, image, mask, squeeze, arena);
  TEST_ASSERT_TRUE(arena.high_water_bytes == bytes);
  return made;
}

// The mean of row y of the image over [begin, end) pixels from its left edge; the pixels at both
// ends are repeated.
long double row_mean(const tv_image& image, int y, long double begin, long double end) {
  long double sum = 0;
  for (int x = static_cast<int>(std::floor(begin)); x < end; ++x) {
    const int at = x < 0 ? 0 : x < image.width ? x : image.width - 1;
    const long double share =
        std::fmin(end, x + 1.0L) - std::fmax(begin, static_cast<long double>(x));
    sum += share * image.data[y * image.stride_bytes + at];
  }
  return sum / (end - begin);
}

void test_a_squeezed_pixel_is_the_mean_over_its_parallelogram() {
  uint64_t seed = 5301;
  for (const Shape& shape : kShapes) {
    const int width = random_int(&seed, 40, kMaxSide);
    const int height = random_int(&seed, 40, kMaxSide);
    random_bytes(&seed, pixels, sizeof pixels);
    const tv_image image = image_of(width, height);
    const tv::Squeeze s = squeeze_of(shape, width, height);
    const tv::Squeezed made = squeezed(image, nullptr, s);
    const long double one = 65536;
    for (int v = 0; v < s.height; ++v) {
      for (int u = 0; u < s.width; ++u) {
        const long double top = v * (s.step_y / one), bottom = (v + 1) * (s.step_y / one);
        long double sum = 0;
        for (int y = static_cast<int>(top); y < bottom; ++y) {
          // A row of pixels is moved as its middle is.
          const long double begin =
              (s.first_x + s.shear * (y + 0.5L) + static_cast<long double>(u) * s.step_x) / one;
          sum += (std::fmin(bottom, y + 1.0L) - std::fmax(top, static_cast<long double>(y))) *
                 row_mean(image, y, begin, begin + s.step_x / one);
        }
        // The weights of rows are multiples of 1 / 256, of which the last takes what is left: at
        // most 1.5 / 256 of the weight are elsewhere. Both roundings add up to less than 0.51.
        const double expected = static_cast<double>(sum / (bottom - top));
        TEST_ASSERT_DOUBLE_WITHIN(255 * 1.5 / 256 + 0.51, expected,
                                  made.image.data[v * s.width + u]);
      }
    }
  }
}

void test_lengths_shrink_along_the_direction_and_stay_across_it() {
  for (const Shape& shape : kShapes) {
    const tv::Squeeze s = squeeze_of(shape, 640, 480);
    double origin[2], column[2], row[2];
    tv::to_image(s, 10, 20, &origin[0], &origin[1]);
    tv::to_image(s, 11, 20, &column[0], &column[1]);
    tv::to_image(s, 10, 21, &row[0], &row[1]);
    // The columns of the map to the image. Its inverse maps the direction d to a vector of length
    // 1 / tilt, and the direction across to one of length 1.
    const double a = column[0] - origin[0], b = row[0] - origin[0];
    const double c = column[1] - origin[1], d = row[1] - origin[1];
    const double determinant = a * d - b * c;
    TEST_ASSERT_DOUBLE_WITHIN(1e-4 * shape.tilt, shape.tilt, determinant);
    for (const bool across : {false, true}) {
      const double angle = shape.angle_rad + (across ? tv::kPi / 2 : 0);
      const double x = std::cos(angle), y = std::sin(angle);
      const double u = (d * x - b * y) / determinant, v = (a * y - c * x) / determinant;
      TEST_ASSERT_DOUBLE_WITHIN(1e-4, across ? 1 : 1 / shape.tilt, std::hypot(u, v));
    }
  }
}

void test_every_point_of_the_image_is_in_the_squeezed_one() {
  for (const Shape& shape : kShapes) {
    const tv::Squeeze s = squeeze_of(shape, 101, 83);
    double least[2] = {1e9, 1e9}, most[2] = {-1e9, -1e9};
    for (int v : {0, s.height - 1}) {
      for (int u : {0, s.width - 1}) {
        double at[2];
        tv::to_image(s, u, v, &at[0], &at[1]);
        for (int k = 0; k < 2; ++k) {
          least[k] = std::fmin(least[k], at[k]);
          most[k] = std::fmax(most[k], at[k]);
        }
      }
    }
    // The middles of the outermost pixels are half a squeezed pixel, at most 1.5 of the image,
    // within its edges; up to one more squeezed pixel does not fit.
    TEST_ASSERT_LESS_OR_EQUAL(4.5 - 0.5, least[0]);
    TEST_ASSERT_LESS_OR_EQUAL(4.5 - 0.5, least[1]);
    TEST_ASSERT_GREATER_OR_EQUAL(101 - 4.5, most[0] + 1);
    TEST_ASSERT_GREATER_OR_EQUAL(83 - 4.5, most[1] + 1);
  }
}

void test_a_ramp_has_the_value_of_the_point_that_a_pixel_comes_from() {
  for (int y = 0; y < kMaxSide; ++y) {
    for (int x = 0; x < kMaxSide; ++x)
      pixels[y * kMaxSide + x] = static_cast<uint8_t>(x / 2 + y / 2);
  }
  for (const Shape& shape : kShapes) {
    const tv::Squeeze s = squeeze_of(shape, kMaxSide, kMaxSide);
    const tv::Squeezed made = squeezed(image_of(kMaxSide, kMaxSide), nullptr, s);
    int compared = 0;
    for (int v = 2; v < s.height - 2; ++v) {
      for (int u = 0; u < s.width; ++u) {
        double x, y;
        tv::to_image(s, u, v, &x, &y);
        if (x < 4 || x > kMaxSide - 5) continue;
        TEST_ASSERT_DOUBLE_WITHIN(2, 0.5 * (x + y) - 0.5, made.image.data[v * s.width + u]);
        ++compared;
      }
    }
    TEST_ASSERT_GREATER_THAN(kMaxSide * kMaxSide / 4, compared);
  }
}

// The standard deviation of the inner pixels of a squeezed image of stripes, whose grey level is a
// sine of amplitude 100 with this period in pixels along a direction.
double left_of_stripes(const Shape& shape, double period, double angle_rad) {
  for (int y = 0; y < kMaxSide; ++y) {
    for (int x = 0; x < kMaxSide; ++x) {
      const double along = x * std::cos(angle_rad) + y * std::sin(angle_rad);
      pixels[y * kMaxSide + x] =
          static_cast<uint8_t>(128.5 + 100 * std::sin(2 * tv::kPi * along / period));
    }
  }
  const tv::Squeeze s = squeeze_of(shape, kMaxSide, kMaxSide);
  const tv::Squeezed made = squeezed(image_of(kMaxSide, kMaxSide), nullptr, s);
  double sum = 0, squares = 0, count = 0;
  for (int v = 3; v < s.height - 3; ++v) {
    for (int u = 0; u < s.width; ++u) {
      if (made.mask.data[v * s.width + u] == 0) continue;
      const double grey = made.image.data[v * s.width + u];
      sum += grey;
      squares += grey * grey;
      ++count;
    }
  }
  return std::sqrt(squares / count - sum / count * (sum / count));
}

void test_stripes_too_fine_for_the_squeezed_image_do_not_alias() {
  for (int step = 0; step < 8; ++step) {
    const Shape shape = {2.8284271247461903, step * 22.5 * kDegree};
    // Without a blur both stripes would keep their standard deviation of 70.
    TEST_ASSERT_LESS_THAN(20.0, left_of_stripes(shape, 3.5, shape.angle_rad));
    TEST_ASSERT_GREATER_THAN(40.0, left_of_stripes(shape, 3.5, shape.angle_rad + tv::kPi / 2));
  }
}

void test_the_mask_leaves_out_what_is_beyond_the_image_or_masked_there() {
  constexpr int kWidth = 90, kHeight = 70;
  uint64_t seed = 5302;
  random_bytes(&seed, given, sizeof given);
  for (uint8_t& byte : given) byte = byte < 128 ? 0 : byte;
  const tv_image mask = {given, kWidth, kHeight, kMaxSide};
  for (const Shape& shape : kShapes) {
    const tv::Squeeze s = squeeze_of(shape, kWidth, kHeight);
    for (const tv_image* of_caller : {static_cast<const tv_image*>(nullptr), &mask}) {
      const tv::Squeezed made = squeezed(image_of(kWidth, kHeight), of_caller, s);
      int kept = 0;
      for (int v = 0; v < s.height; ++v) {
        for (int u = 0; u < s.width; ++u) {
          double x, y;
          tv::to_image(s, u, v, &x, &y);
          x += 0.5;  // from the edges
          y += 0.5;
          const double nearest =
              std::fmin(std::fabs(x - std::round(x)), std::fabs(y - std::round(y)));
          // On an edge between pixels rounding may choose either one, unless all is whole.
          if (nearest > 0 && nearest < 1e-3) continue;
          const bool inside = x >= tv::kSqueezeMargin && x < kWidth - tv::kSqueezeMargin;
          const bool wanted =
              inside && (of_caller == nullptr ||
                         given[static_cast<int>(y) * kMaxSide + static_cast<int>(x)] != 0);
          TEST_ASSERT_EQUAL_INT(wanted, made.mask.data[v * s.width + u] != 0);
          kept += wanted;
        }
      }
      TEST_ASSERT_GREATER_THAN(100, kept);
    }
  }
}

void test_the_smallest_images_are_squeezed() {
  for (const Shape& shape : kShapes) {
    for (int width = 1; width < 5; ++width) {
      for (int height = 3; height < 6; ++height) {
        memset(pixels, 255, sizeof pixels);
        const tv::Squeeze s = squeeze_of(shape, width, height);
        const tv::Squeezed made = squeezed(image_of(width, height), nullptr, s);
        for (int k = 0; k < s.width * s.height; ++k) {
          TEST_ASSERT_EQUAL_INT(255, made.image.data[k]);
          TEST_ASSERT_EQUAL_INT(0, made.mask.data[k]);
        }
      }
    }
  }
}

}  // namespace

extern "C" void setUp() {}
extern "C" void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_squeezed_pixel_is_the_mean_over_its_parallelogram);
  RUN_TEST(test_lengths_shrink_along_the_direction_and_stay_across_it);
  RUN_TEST(test_every_point_of_the_image_is_in_the_squeezed_one);
  RUN_TEST(test_a_ramp_has_the_value_of_the_point_that_a_pixel_comes_from);
  RUN_TEST(test_stripes_too_fine_for_the_squeezed_image_do_not_alias);
  RUN_TEST(test_the_mask_leaves_out_what_is_beyond_the_image_or_masked_there);
  RUN_TEST(test_the_smallest_images_are_squeezed);
  return UNITY_END();
}
