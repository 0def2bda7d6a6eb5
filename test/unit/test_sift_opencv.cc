// Plain SIFT compared with OpenCV's at the same keypoints, angles, level and blur.
//
// Our octave 0 is the image blurred by the 3x3 binomial, whose variance is 0.5 square pixels.
// OpenCV takes an image to have a blur of 0.5 pixel already (variance 0.25) and blurs it further,
// to `sigma` pixels in all, so that sigma = sqrt(0.25 + 0.5) makes its octave 0, layer 0 the same
// image but for the Gaussian's shape.

#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>

#include "base/arena.h"
#include "feature/corners.h"
#include "feature/describe.h"
#include "match/match.h"
#include "support/random.h"
#include "support/real_pair.h"

namespace {

constexpr int kMaxKeypoints = 1500;
constexpr double kPi = 3.14159265358979323846;

real_pair real;
alignas(64) uint8_t arena_memory[48 << 20];
tv_keypoint keypoints[2][kMaxKeypoints];
uint8_t ours[2][kMaxKeypoints * TV_DESCRIPTOR_BYTES];
uint8_t opencvs[2][kMaxKeypoints * TV_DESCRIPTOR_BYTES];
tv_correspondence matches[2][kMaxKeypoints];
int counts[2];
double cosines[2 * kMaxKeypoints];

tv_image image_of(int view) {
  return tv_image{real.luma[view], real.width, real.height, real.width};
}

// Corners at integer positions, away from the border, where the two libraries extend the image
// differently.
void find_keypoints(int view) {
  tv_feature_options options;
  memset(&options, 0, sizeof options);
  options.arc = 9;
  options.threshold = 15;
  options.levels = 1;
  options.scale_factor = 2.0f;
  options.cell_px = 40;
  options.keypoint_size = 4.0f;
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  const int32_t found = tv::find_corners(*tvk_select(TV_KERNELS_AUTO), image_of(view), nullptr,
                                         options, kMaxKeypoints, arena, keypoints[view]);
  counts[view] = 0;
  for (int k = 0; k < found; ++k) {
    const tv_keypoint p = keypoints[view][k];
    if (p.x < 30 || p.y < 30 || p.x > real.width - 31 || p.y > real.height - 31) continue;
    keypoints[view][counts[view]++] = p;
  }
}

void describe_with_ours(int view) {
  const tvk_set& kernels = *tvk_select(TV_KERNELS_AUTO);
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  const tv::Octaves octaves = tv::make_octaves(kernels, image_of(view), 0, 0, arena);
  for (int k = 0; k < counts[view]; ++k) {
    TEST_ASSERT_EQUAL_INT(0, tv::octave_of(keypoints[view][k].size));
    tv::describe_keypoints(kernels, octaves, &keypoints[view][k], 1, TV_NORMALISATION_SIFT, 0,
                           ours[view] + k * TV_DESCRIPTOR_BYTES);
  }
}

void describe_with_opencv(int view) {
  const tv_image image = image_of(view);
  const cv::Mat pixels(image.height, image.width, CV_8U, const_cast<uint8_t*>(image.data));
  std::vector<cv::KeyPoint> points;
  for (int k = 0; k < counts[view]; ++k) {
    const tv_keypoint& p = keypoints[view][k];
    // OpenCV's angle is in degrees, clockwise as seen; octave 0, layer 0 is encoded as 0.
    const float degrees = static_cast<float>(p.angle_rad * 180 / kPi);
    points.emplace_back(p.x, p.y, p.size, degrees < 0 ? degrees + 360 : degrees, 0.0f, 0, k);
  }
  cv::Mat descriptors;
  cv::SIFT::create(0, 3, 0.04, 10.0, std::sqrt(0.25 + 0.5))->compute(pixels, points, descriptors);
  TEST_ASSERT_EQUAL_INT(counts[view], static_cast<int>(points.size()));
  for (int k = 0; k < counts[view]; ++k) {
    TEST_ASSERT_EQUAL_INT(k, points[static_cast<size_t>(k)].class_id);
    for (int i = 0; i < TV_DESCRIPTOR_BYTES; ++i) {
      opencvs[view][k * TV_DESCRIPTOR_BYTES + i] =
          static_cast<uint8_t>(descriptors.at<float>(k, i) + 0.5f);
    }
  }
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

double median_cosine() {
  int n = 0;
  for (int view = 0; view < 2; ++view) {
    for (int k = 0; k < counts[view]; ++k) {
      const int at = k * TV_DESCRIPTOR_BYTES;
      cosines[n++] = cosine(ours[view] + at, opencvs[view] + at);
    }
  }
  std::sort(cosines, cosines + n);
  printf("cosine: median %.4f, 5th percentile %.4f, least %.4f of %d\n", cosines[n / 2],
         cosines[n / 20], cosines[0], n);
  return cosines[n / 2];
}

// The number of matches common to both descriptors over the larger of the two numbers of matches.
double match_agreement() {
  int found[2];
  for (int system = 0; system < 2; ++system) {
    uint8_t(*descriptors)[kMaxKeypoints * TV_DESCRIPTOR_BYTES] = system == 0 ? ours : opencvs;
    tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
    tv_features features[2] = {};
    for (int view = 0; view < 2; ++view) {
      features[view].num = counts[view];
      features[view].descriptors = descriptors[view];
    }
    tv_match_options options = {};
    options.ratio = 0.8f;
    const tv_correspondence* in_arena = nullptr;
    found[system] = tv::match_descriptors(*tvk_select(TV_KERNELS_AUTO), features[0], features[1],
                                          options, arena, &in_arena);
    std::copy(in_arena, in_arena + found[system], matches[system]);
  }
  int common = 0;
  for (int a = 0, b = 0; a < found[0] && b < found[1];) {
    const tv_correspondence &m = matches[0][a], &o = matches[1][b];
    common += m.idx0 == o.idx0 && m.idx1 == o.idx1;
    if (m.idx0 <= o.idx0) ++a;
    if (o.idx0 <= m.idx0) ++b;
  }
  printf("matches: ours %d, OpenCV's %d, both %d\n", found[0], found[1], common);
  return 1.0 * common / std::max(found[0], found[1]);
}

void check(float size, bool is_upright) {
  uint64_t seed = 51;
  for (int view = 0; view < 2; ++view) {
    find_keypoints(view);
    TEST_ASSERT_TRUE(counts[view] > 300);
    for (int k = 0; k < counts[view]; ++k) {
      keypoints[view][k].size = size;
      keypoints[view][k].angle_rad =
          is_upright ? 0.0f : static_cast<float>((2 * random_unit(&seed) - 1) * kPi);
    }
    describe_with_ours(view);
    describe_with_opencv(view);
  }
  TEST_ASSERT_TRUE(median_cosine() >= 0.98);
}

void test_upright_descriptors_are_opencvs() {
  for (float size : {2.67f, 4.0f, 5.0f}) check(size, true);
}

void test_turned_descriptors_are_opencvs() {
  for (float size : {2.67f, 3.3f, 4.0f, 5.0f}) check(size, false);
}

void test_matches_agree_with_opencvs_descriptors() {
  for (float size : {4.0f, 5.0f}) {
    check(size, true);
    TEST_ASSERT_TRUE(match_agreement() >= 0.95);
  }
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  if (!real_pair_load(&real)) return TWOVIEW_SKIP_CODE;
  UNITY_BEGIN();
  RUN_TEST(test_upright_descriptors_are_opencvs);
  RUN_TEST(test_turned_descriptors_are_opencvs);
  RUN_TEST(test_matches_agree_with_opencvs_descriptors);
  return UNITY_END();
}
