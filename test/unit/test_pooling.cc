// Pooled descriptors compared with their definition (docs/algorithms/sift.md) in double precision.

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "feature/describe.h"
#include "support/random.h"
#include "twoview/context.h"

namespace {

constexpr int kSide = 96;
constexpr double kPi = 3.14159265358979323846;
uint8_t pixels[kSide * kSide];
alignas(64) uint8_t arena_memory[1 << 20];

struct Grid {
  int side;
  std::vector<double> values;
  double at(int x, int y) const {
    const int cx = std::min(std::max(x, 0), side - 1), cy = std::min(std::max(y, 0), side - 1);
    return values[static_cast<size_t>(cy * side + cx)];
  }
};

// Smooth noise: random values 3 pixels apart, interpolated.
void render(uint64_t* seed) {
  Grid coarse{kSide / 3 + 2, {}};
  for (int k = 0; k < coarse.side * coarse.side; ++k) {
    coarse.values.push_back(255 * random_unit(seed));
  }
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const double fx = x % 3 / 3.0, fy = y % 3 / 3.0;
      const double above = (1 - fx) * coarse.at(x / 3, y / 3) + fx * coarse.at(x / 3 + 1, y / 3);
      const double below =
          (1 - fx) * coarse.at(x / 3, y / 3 + 1) + fx * coarse.at(x / 3 + 1, y / 3 + 1);
      pixels[y * kSide + x] = static_cast<uint8_t>((1 - fy) * above + fy * below);
    }
  }
}

Grid octave_by_definition(int octave) {
  Grid image{kSide, std::vector<double>(pixels, pixels + kSide * kSide)};
  for (int o = 0; o < octave; ++o) {
    Grid half{image.side / 2, {}};
    for (int y = 0; y < half.side; ++y) {
      for (int x = 0; x < half.side; ++x) {
        half.values.push_back((image.at(2 * x, 2 * y) + image.at(2 * x + 1, 2 * y) +
                               image.at(2 * x, 2 * y + 1) + image.at(2 * x + 1, 2 * y + 1)) /
                              4);
      }
    }
    image = half;
  }
  Grid blurred{image.side, {}};
  for (int y = 0; y < image.side; ++y) {
    for (int x = 0; x < image.side; ++x) {
      double sum = 0;
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) sum += (2 - i * i) * (2 - j * j) * image.at(x + i, y + j);
      }
      blurred.values.push_back(sum / 16);
    }
  }
  return blurred;
}

double cell_weight(int k, int cell) {
  const double p = 0.28 * (k - 7);
  return std::exp(-p * p / 8) * std::max(0.0, 1 - std::fabs(p + 1.5 - cell));
}

// Adds the histogram of the window of this size.
void add_window(const tv_keypoint& p, double size, double* histogram) {
  int octave = 0;
  while (0.42 * size / (1 << octave) >= 2.24) ++octave;
  const Grid image = octave_by_definition(octave);
  const double scale = 1 << octave, step = 0.42 * size / scale;
  const double c = std::cos(p.angle_rad) * step, s = std::sin(p.angle_rad) * step;
  double samples[16][16];
  for (int j = 0; j < 16; ++j) {
    for (int i = 0; i < 16; ++i) {
      const double x = (p.x + 0.5) / scale - 0.5 + (i - 7.5) * c - (j - 7.5) * s;
      const double y = (p.y + 0.5) / scale - 0.5 + (i - 7.5) * s + (j - 7.5) * c;
      const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
      const double fx = x - x0, fy = y - y0;
      samples[j][i] = (1 - fy) * ((1 - fx) * image.at(x0, y0) + fx * image.at(x0 + 1, y0)) +
                      fy * ((1 - fx) * image.at(x0, y0 + 1) + fx * image.at(x0 + 1, y0 + 1));
    }
  }
  for (int j = 0; j < 15; ++j) {
    for (int i = 0; i < 15; ++i) {
      const double u = samples[j + 1][i + 1] - samples[j][i];
      const double v = samples[j][i + 1] - samples[j + 1][i];
      // The angle counter-clockwise from x, in bins; u points to the lower right, v to the upper.
      double turn = (std::atan2(v, u) - kPi / 4) / (kPi / 4);
      if (turn < 0) turn += 8;
      const int low = static_cast<int>(turn) % 8;
      const double share = turn - std::floor(turn), length = std::hypot(u, v);
      // The two vectors along the bins whose sum is the gradient (law of sines).
      const double along_low = length * std::sin((1 - share) * kPi / 4) / std::sin(kPi / 4);
      const double along_high = length * std::sin(share * kPi / 4) / std::sin(kPi / 4);
      for (int cell = 0; cell < 16; ++cell) {
        const double weight = cell_weight(j, cell / 4) * cell_weight(i, cell % 4);
        histogram[8 * cell + low] += weight * along_low;
        histogram[8 * cell + (low + 1) % 8] += weight * along_high;
      }
    }
  }
}

// The L2 distance of our descriptor (of length 512) from the definition's, pooled or not.
double distance(const tv_keypoint& p, int32_t ours_pooled, bool pooled) {
  const tvk_set& kernels = *tvk_select(TV_KERNELS_AUTO);
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  const tv::OctaveRange range = tv::octave_range(&p, 1, ours_pooled);
  const tv::Octaves octaves = tv::make_octaves(kernels, tv_image{pixels, kSide, kSide, kSide},
                                               range.first, range.last, arena);
  uint8_t ours[TV_DESCRIPTOR_BYTES];
  tv::describe_keypoints(kernels, octaves, &p, 1, TV_NORMALISATION_SIFT, ours_pooled, ours);
  double wanted[TV_DESCRIPTOR_BYTES] = {0}, length = 0, clipped = 0, sum = 0;
  add_window(p, pooled ? 0.7 * p.size : p.size, wanted);
  if (pooled) add_window(p, 1.3 * p.size, wanted);
  for (double w : wanted) length += w * w;
  for (double& w : wanted) {
    w = std::min(w, 0.2 * std::sqrt(length));
    clipped += w * w;
  }
  for (int k = 0; k < TV_DESCRIPTOR_BYTES; ++k) {
    const double d = ours[k] - std::min(255.0, 512 * wanted[k] / std::sqrt(clipped));
    sum += d * d;
  }
  return std::sqrt(sum);
}

// Sizes whose windows are of octave 0, of two octaves, and of octave 1.
void test_a_pooled_descriptor_is_the_mean_over_two_windows() {
  uint64_t seed = 61;
  double worst = 0, least_other = 512;
  for (int k = 0; k < 300; ++k) {
    render(&seed);
    const float sizes[4] = {2.5f, 4.0f, 5.0f, 7.7f};
    const tv_keypoint p{static_cast<float>(44 + 8 * random_unit(&seed)),
                        static_cast<float>(44 + 8 * random_unit(&seed)),
                        sizes[k % 4],
                        static_cast<float>((2 * random_unit(&seed) - 1) * kPi),
                        1.0f,
                        0};
    worst = std::max(worst, std::max(distance(p, 1, true), distance(p, 0, false)));
    least_other = std::min(least_other, std::min(distance(p, 1, false), distance(p, 0, true)));
  }
  printf("distance of 512: at most %.1f; at least %.1f from the other kind\n", worst, least_other);
  TEST_ASSERT_TRUE(worst <= 32);  // a cosine of 0.998; bytes and 1/127 shares round
  TEST_ASSERT_TRUE(least_other >= 3 * worst);
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_pooled_descriptor_is_the_mean_over_two_windows);
  return UNITY_END();
}
