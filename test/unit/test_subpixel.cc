// Sub-pixel positions of corners that are rendered at known places, symmetric corners included.

#include <string.h>
#include <unity.h>

#include <cmath>

#include "feature/subpixel.h"
#include "image/pyramid.h"
#include "support/random.h"
#include "twoview/context.h"

namespace {

constexpr int kSide = 40;
constexpr int kOversampling = 16;
uint8_t pixels[kSide * kSide];
const tv::Level level{pixels, kSide, kSide, kSide, 1.0};

// Renders a wedge with this opening, its axis turned by `turn` (radians). A pixel is the average
// over its area, as on a sensor, and then blurred slightly as by a lens.
void render_wedge(double tip_x, double tip_y, double turn, double opening, int dark, int bright) {
  const double cosine = std::cos(turn), sine = std::sin(turn), slope = std::tan(opening / 2);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      int inside = 0;
      for (int j = 0; j < kOversampling; ++j) {
        for (int i = 0; i < kOversampling; ++i) {
          // Averages over two pixels: the pixel and half of each neighbour.
          const double sx = x - 1 + 2 * (i + 0.5) / kOversampling;
          const double sy = y - 1 + 2 * (j + 0.5) / kOversampling;
          const double along = (sx - tip_x) * cosine + (sy - tip_y) * sine;
          const double across = std::fabs((sy - tip_y) * cosine - (sx - tip_x) * sine);
          inside += along > 0 && across < along * slope;
        }
      }
      const double share = static_cast<double>(inside) / (kOversampling * kOversampling);
      pixels[y * kSide + x] = static_cast<uint8_t>(dark + (bright - dark) * share + 0.5);
    }
  }
}

void render_blob(double centre_x, double centre_y, double sigma, int base, int height) {
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const double d_sq = (x - centre_x) * (x - centre_x) + (y - centre_y) * (y - centre_y);
      pixels[y * kSide + x] =
          static_cast<uint8_t>(base + height * std::exp(-d_sq / (2 * sigma * sigma)) + 0.5);
    }
  }
}

// The pixel with the highest score, the first of equal ones; false where there is no corner.
bool find_corner(int arc, int* best_x, int* best_y) {
  int best = 0;
  for (int y = 3; y < kSide - 3; ++y) {
    const uint8_t* rows[7];
    uint8_t scores[kSide];
    for (int k = 0; k < 7; ++k) rows[k] = pixels + (y - 3 + k) * kSide;
    tvk_detect_of(tvk_select(TV_KERNELS_C))->fast_score_row(rows, kSide, arc, 1, scores);
    for (int x = 3; x < kSide - 3; ++x) {
      if (scores[x] <= best) continue;
      best = scores[x];
      *best_x = x;
      *best_y = y;
    }
  }
  return best > 0;
}

void refine(int x, int y, double* rx, double* ry) {
  tv::Peak peak{x, y, 1.0 * x, 1.0 * y};
  const uint8_t* const at = level.data + y * level.stride + x;
  const uint8_t* const centres[2] = {at, at};
  int32_t determinants[2 * TVK_HESSIAN_PLACES];
  tvk_detect_of(tvk_select(TV_KERNELS_AUTO))
      ->hessian_determinants(centres, level.stride, determinants);
  tv::find_peak(determinants, x, y, &peak);
  *rx = peak.x;
  *ry = peak.y;
}

void test_a_blobs_middle_is_found_below_a_pixel() {
  uint64_t seed = 31;
  double sum_integer = 0, sum_refined = 0;
  constexpr int kTrials = 200;
  for (int k = 0; k < kTrials; ++k) {
    const double cx = 19.5 + random_unit(&seed), cy = 19.5 + random_unit(&seed);
    const bool dark = k % 2 != 0;
    render_blob(cx, cy, 1.5 + random_unit(&seed), dark ? 220 : 20, dark ? -180 : 180);
    int x = 0, y = 0;
    double rx, ry;
    TEST_ASSERT_TRUE(find_corner(9 + k % 4, &x, &y));
    refine(x, y, &rx, &ry);
    sum_integer += std::hypot(x - cx, y - cy);
    sum_refined += std::hypot(rx - cx, ry - cy);
  }
  // A uniformly distributed position in a pixel is 0.383 from the pixel's centre on average.
  TEST_ASSERT_DOUBLE_WITHIN(0.05, 0.383, sum_integer / kTrials);
  TEST_ASSERT_TRUE(sum_refined / kTrials <= 0.15);
}

// The maximum lies a little inside the wedge, by the same amount at every sub-pixel shift; so the
// test compares the offsets at different shifts, not the positions.
void test_a_wedge_that_moves_takes_its_corner_along() {
  uint64_t seed = 32;
  double sum_integer = 0, sum_refined = 0;
  int trials = 0;
  for (int k = 0; k < 40; ++k) {
    const double turn = 6.283185307 * random_unit(&seed), opening = 0.9 + 0.7 * random_unit(&seed);
    double dx[8], dy[8], ix[8], iy[8];
    int found = 0;
    for (int s = 0; s < 8; ++s) {
      const double tip_x = 19 + random_unit(&seed), tip_y = 19 + random_unit(&seed);
      int x = 0, y = 0;
      double rx, ry;
      render_wedge(tip_x, tip_y, turn, opening, k % 2 ? 30 : 210, k % 2 ? 210 : 30);
      if (!find_corner(9 + k % 4, &x, &y)) continue;
      refine(x, y, &rx, &ry);
      dx[found] = rx - tip_x;
      dy[found] = ry - tip_y;
      ix[found] = x - tip_x;
      iy[found] = y - tip_y;
      ++found;
    }
    for (int s = 1; s < found; ++s) {
      sum_refined += std::hypot(dx[s] - dx[0], dy[s] - dy[0]);
      sum_integer += std::hypot(ix[s] - ix[0], iy[s] - iy[0]);
      ++trials;
    }
  }
  TEST_ASSERT_TRUE(trials > 150);
  TEST_ASSERT_TRUE(sum_refined < 0.6 * sum_integer);
}

// The smoothed pixel by definition: both sums at once, rounded once.
int smoothed_pixel(int x, int y) {
  const int weights[5] = {1, 4, 6, 4, 1};
  int sum = 0;
  for (int v = 0; v < 5; ++v) {
    for (int u = 0; u < 5; ++u) {
      sum += weights[u] * weights[v] * pixels[(y + v - 2) * kSide + x + u - 2];
    }
  }
  return (sum + 8) / 16;
}

int64_t determinant_at(int x, int y) {
  const int second[3] = {1, -2, 1}, smooth[3] = {1, 2, 1}, first[3] = {-1, 0, 1};
  int64_t xx = 0, yy = 0, xy = 0;
  for (int v = 0; v < 3; ++v) {
    for (int u = 0; u < 3; ++u) {
      const int s = smoothed_pixel(x + u - 1, y + v - 1);
      xx += second[u] * smooth[v] * s;
      yy += smooth[u] * second[v] * s;
      xy += first[u] * first[v] * s;
    }
  }
  return xx * yy - xy * xy;
}

// Black and white images reach the largest values, so that an overflow would show.
void test_determinants_are_those_of_the_definition() {
  uint64_t seed = 34;
  for (int trial = 0; trial < 60; ++trial) {
    random_bytes(&seed, pixels, sizeof pixels);
    for (uint8_t& pixel : pixels) {
      if (trial % 3 == 1) pixel = pixel > 127 ? 255 : 0;
      if (trial % 3 == 2) pixel = pixel > 250 ? 255 : 0;
    }
    if (trial % 10 == 4) render_blob(20, 20, 0.6 + 0.1 * trial, 0, 255);
    int cx[2], cy[2];
    const uint8_t* centres[2];
    for (int n = 0; n < 2; ++n) {
      cx[n] = random_int(&seed, 6, kSide - 7);
      cy[n] = random_int(&seed, 6, kSide - 7);
      centres[n] = pixels + cy[n] * kSide + cx[n];
    }
    for (int set = TV_KERNELS_C; set <= TV_KERNELS_AVX512; ++set) {
      const tvk_set* kernels = tvk_select(static_cast<tv_kernels>(set));
      if (kernels == nullptr) continue;
      int32_t found[2][TVK_HESSIAN_PLACES];
      tvk_detect_of(kernels)->hessian_determinants(centres, kSide, found[0]);
      for (int k = 0; k < 2 * 49; ++k) {
        const int n = k / 49, row = k % 49 / 7, column = k % 7;
        const int64_t expected = determinant_at(cx[n] + column - 3, cy[n] + row - 3);
        TEST_ASSERT_TRUE(expected == found[n][8 * row + column]);
      }
    }
  }
}

void test_refinement_never_moves_more_than_its_limit() {
  uint64_t seed = 33;
  int moved = 0, kept = 0;
  for (int k = 0; k < 4000; ++k) {
    if (k % 100 == 0) random_bytes(&seed, pixels, sizeof pixels);
    const int x = random_int(&seed, 6, kSide - 7), y = random_int(&seed, 6, kSide - 7);
    double rx, ry;
    refine(x, y, &rx, &ry);
    TEST_ASSERT_TRUE(std::fabs(rx - x) <= 3 && std::fabs(ry - y) <= 3);
    (rx == x && ry == y ? kept : moved) += 1;
  }
  TEST_ASSERT_TRUE(moved > 100 && kept > 100);
}

void test_a_flat_or_symmetric_place_stays() {
  double rx, ry;
  memset(pixels, 90, sizeof pixels);
  refine(20, 20, &rx, &ry);
  TEST_ASSERT_TRUE(rx == 20 && ry == 20);
  render_blob(20, 20, 2.0, 20, 200);
  refine(20, 20, &rx, &ry);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 20, rx);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 20, ry);
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_blobs_middle_is_found_below_a_pixel);
  RUN_TEST(test_a_wedge_that_moves_takes_its_corner_along);
  RUN_TEST(test_determinants_are_those_of_the_definition);
  RUN_TEST(test_refinement_never_moves_more_than_its_limit);
  RUN_TEST(test_a_flat_or_symmetric_place_stays);
  return UNITY_END();
}
