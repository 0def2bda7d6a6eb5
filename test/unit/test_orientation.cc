// Dominant orientations and descriptors of smooth patterns that are rotated by known angles.

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include <cmath>
#include <initializer_list>

#include "feature/describe.h"
#include "support/random.h"
#include "twoview/context.h"

namespace {

constexpr int kSide = 81;
constexpr double kMiddle = 40.0;
constexpr double kPi = 3.14159265358979323846;
uint8_t pixels[kSide * kSide];
alignas(64) uint8_t arena_memory[1 << 20];
const tv_keypoint middle{40.0f, 40.0f, 4.0f, 0.0f, 1.0f, 0};

// Fills the image with pattern(u, v). (u, v) is the pixel's position in a frame around the middle
// that is turned by `angle`, clockwise as seen (from x towards y).
template <typename Pattern>
void render(double angle, Pattern pattern) {
  const double c = std::cos(angle), s = std::sin(angle);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const double dx = x - kMiddle, dy = y - kMiddle;
      const double grey = pattern(c * dx + s * dy, c * dy - s * dx);
      pixels[y * kSide + x] = static_cast<uint8_t>(std::fmin(255, std::fmax(0, grey + 0.5)));
    }
  }
}

// Brightness rises along u, so the gradient's direction is the frame's angle.
double ramp(double u, double) { return 128 + 100 * std::tanh(u / 6); }

// Like `ramp`, but with gradient directions spread evenly to both sides, as in real patches.
double bent_ramp(double u, double v) { return 128 + 100 * std::tanh((u - 0.03 * v * v) / 6); }

// One half of the patch rises along u; the other along v, `share` times as steeply.
double share;
double two_ramps(double u, double v) { return 120 + 6 * std::fmax(u, share * v); }

tv::Octaves octaves_of_pixels() {
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  return tv::make_octaves(*tvk_select(TV_KERNELS_AUTO), tv_image{pixels, kSide, kSide, kSide}, 0, 2,
                          arena);
}

int angles_of(const tv_keypoint& keypoint, float angles_rad[2]) {
  return tv::dominant_angles(*tvk_select(TV_KERNELS_AUTO), octaves_of_pixels(), keypoint,
                             angles_rad);
}

double difference(double a, double b) { return std::fabs(std::remainder(a - b, 2 * kPi)); }

// Bins are 10 degrees wide, a sample is shared between two bins, and a parabola finds the peak
// between them. The result is exact in a bin's middle and halfway between two, and wrong by a
// fraction of a degree elsewhere.
void check_rotation(double (*pattern)(double, double), double max_mean_degrees,
                    double max_degrees) {
  double sum = 0.0, worst = 0.0;
  int trials = 0;
  for (int degrees = -179; degrees <= 180; ++degrees) {
    const double angle = degrees * kPi / 180;
    render(angle, pattern);
    for (float size : {2.7f, 4.0f, 5.0f, 7.0f}) {
      tv_keypoint keypoint = middle;
      keypoint.size = size;
      float angles_rad[2];
      TEST_ASSERT_EQUAL_INT(1, angles_of(keypoint, angles_rad));
      TEST_ASSERT_TRUE(angles_rad[0] > -3.1415930f && angles_rad[0] <= 3.1415930f);
      const double error = 180 / kPi * difference(angle, angles_rad[0]);
      worst = error > worst ? error : worst;
      sum += error;
      ++trials;
    }
  }
  printf("orientation: error %.2f degrees in the mean, %.2f at most\n", sum / trials, worst);
  TEST_ASSERT_TRUE(sum / trials <= max_mean_degrees);
  TEST_ASSERT_TRUE(worst <= max_degrees);
}

void test_the_angle_follows_the_rotation() {
  check_rotation(ramp, 0.5, 1.0);
  check_rotation(bent_ramp, 0.4, 2.0);  // up to 2 degrees: the bend shifts the histogram's peak
}

// An angle of 0 points along x, to the right; a quarter turn along y, downwards. So angles grow
// clockwise as seen.
void test_the_sign_is_clockwise_as_seen() {
  float angles_rad[2];
  render(0, [](double u, double) { return 100 + 3 * u; });  // grey levels rise to the right
  angles_of(middle, angles_rad);
  TEST_ASSERT_DOUBLE_WITHIN(1e-3, 0.0, angles_rad[0]);
  render(0, [](double, double v) { return 100 + 3 * v; });  // grey levels rise downwards
  angles_of(middle, angles_rad);
  TEST_ASSERT_DOUBLE_WITHIN(1e-3, kPi / 2, angles_rad[0]);
}

void test_a_second_peak_above_80_per_cent_counts() {
  for (int degrees = 0; degrees < 360; degrees += 10) {
    const double angle = degrees * kPi / 180;
    float angles_rad[2];
    share = 0.97;
    render(angle, two_ramps);
    TEST_ASSERT_EQUAL_INT(2, angles_of(middle, angles_rad));
    TEST_ASSERT_DOUBLE_WITHIN(12 * kPi / 180, kPi / 2, difference(angles_rad[0], angles_rad[1]));
    share = 0.6;
    render(angle, two_ramps);
    TEST_ASSERT_EQUAL_INT(1, angles_of(middle, angles_rad));
  }
}

void test_a_flat_patch_has_angle_zero() {
  float angles_rad[2];
  memset(pixels, 50, sizeof pixels);
  TEST_ASSERT_EQUAL_INT(1, angles_of(middle, angles_rad));
  TEST_ASSERT_EQUAL_FLOAT(0.0f, angles_rad[0]);
  uint8_t descriptor[TV_DESCRIPTOR_BYTES], zeros[TV_DESCRIPTOR_BYTES] = {0};
  for (int kind : {TV_NORMALISATION_SIFT, TV_NORMALISATION_ROOTSIFT}) {
    tv::describe_keypoints(*tvk_select(TV_KERNELS_AUTO), octaves_of_pixels(), &middle, 1, kind, 0,
                           descriptor);
    TEST_ASSERT_EQUAL_MEMORY(zeros, descriptor, sizeof zeros);
  }
}

double texture(double u, double v) {
  return 128 + 40 * std::sin(0.31 * u + 0.5) * std::cos(0.23 * v - 0.2) +
         35 * std::sin(0.11 * u * v / 8 + 0.4 * v) + 15 * std::cos(0.45 * u - 0.3 * v);
}

double cosine(const uint8_t* a, const uint8_t* b) {
  double ab = 0, aa = 0, bb = 0;
  for (int k = 0; k < TV_DESCRIPTOR_BYTES; ++k) {
    ab += a[k] * b[k];
    aa += a[k] * a[k];
    bb += b[k] * b[k];
  }
  return ab / std::sqrt(aa * bb);
}

void test_a_descriptor_turns_with_its_angle() {
  uint8_t upright[TV_DESCRIPTOR_BYTES], turned[TV_DESCRIPTOR_BYTES];
  const tvk_set& kernels = *tvk_select(TV_KERNELS_AUTO);
  render(0, texture);
  tv::describe_keypoints(kernels, octaves_of_pixels(), &middle, 1, TV_NORMALISATION_SIFT, 0,
                         upright);
  for (int degrees = -170; degrees <= 180; degrees += 10) {
    tv_keypoint keypoint = middle;
    keypoint.angle_rad = static_cast<float>(degrees * kPi / 180);
    render(degrees * kPi / 180, texture);
    tv::describe_keypoints(kernels, octaves_of_pixels(), &keypoint, 1, TV_NORMALISATION_SIFT, 0,
                           turned);
    TEST_ASSERT_TRUE(cosine(upright, turned) > 0.98);
    if (degrees == 0) continue;
    keypoint.angle_rad = 0.0f;
    tv::describe_keypoints(kernels, octaves_of_pixels(), &keypoint, 1, TV_NORMALISATION_SIFT, 0,
                           turned);
    if (std::abs(degrees) >= 30) {
      TEST_ASSERT_TRUE(cosine(upright, turned) < 0.95);
    }
  }
}

// The order of UBC's descriptors: direction 0 points along x, direction 2 upwards as seen; cells
// row by row.
void test_the_order_is_ubcs() {
  uint8_t descriptor[TV_DESCRIPTOR_BYTES];
  const tvk_set& kernels = *tvk_select(TV_KERNELS_AUTO);
  for (int direction = 0; direction < 8; ++direction) {
    // Brightness rises along `direction`, counter-clockwise as seen, in the lower right quarter
    // only.
    const double angle = direction * kPi / 4;
    render(0, [angle](double u, double v) {
      return u < 1 || v < 1
                 ? 40.0
                 : 40 + 20 * (8 + (u - 8) * std::cos(angle) - (v - 8) * std::sin(angle)) / 4;
    });
    tv_keypoint keypoint = middle;
    tv::describe_keypoints(kernels, octaves_of_pixels(), &keypoint, 1, TV_NORMALISATION_SIFT, 0,
                           descriptor);
    const uint8_t* last_cell = descriptor + 15 * 8;
    for (int k = 0; k < 8; ++k) {
      TEST_ASSERT_TRUE(k == direction || last_cell[k] < last_cell[direction]);
    }
    // The first cell of the patch has no gradient, so its 8 values are 0.
    for (int k = 0; k < 8; ++k) TEST_ASSERT_EQUAL_INT(0, descriptor[k]);
  }
}

// Any finite keypoint gets a descriptor, and nothing outside the image is read.
void test_points_outside_and_of_any_size_are_described() {
  uint64_t seed = 41;
  render(0.3, texture);
  const tv::Octaves octaves = octaves_of_pixels();
  for (int k = 0; k < 3000; ++k) {
    const bool is_far = k % 3 == 0;
    tv_keypoint keypoint = middle;
    keypoint.x = static_cast<float>((random_unit(&seed) - 0.5) * (is_far ? 2e5 : 200) + kMiddle);
    keypoint.y = static_cast<float>((random_unit(&seed) - 0.5) * (is_far ? 2e5 : 200) + kMiddle);
    keypoint.size = static_cast<float>(std::exp(random_unit(&seed) * 14.0 - 7.76));
    keypoint.angle_rad = static_cast<float>((random_unit(&seed) - 0.5) * 2000);
    if (keypoint.size > 512.0f) keypoint.size = 512.0f;
    float angles_rad[2];
    uint8_t descriptor[TV_DESCRIPTOR_BYTES];
    const int count =
        tv::dominant_angles(*tvk_select(TV_KERNELS_AUTO), octaves, keypoint, angles_rad);
    for (int a = 0; a < count; ++a) {
      TEST_ASSERT_TRUE(angles_rad[a] > -3.1415930f && angles_rad[a] <= 3.1415930f);
    }
    tv::describe_keypoints(*tvk_select(TV_KERNELS_AUTO), octaves, &keypoint, 1,
                           TV_NORMALISATION_ROOTSIFT, 0, descriptor);
  }
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_the_angle_follows_the_rotation);
  RUN_TEST(test_the_sign_is_clockwise_as_seen);
  RUN_TEST(test_a_second_peak_above_80_per_cent_counts);
  RUN_TEST(test_a_flat_patch_has_angle_zero);
  RUN_TEST(test_a_descriptor_turns_with_its_angle);
  RUN_TEST(test_the_order_is_ubcs);
  RUN_TEST(test_points_outside_and_of_any_size_are_described);
  return UNITY_END();
}
