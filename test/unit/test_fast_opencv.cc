// FAST-9 finds the same corners with the same scores as OpenCV's cv::FAST, with and without
// suppression.

#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include <algorithm>
#include <opencv2/features2d.hpp>

#include "base/arena.h"
#include "feature/corners.h"
#include "support/random.h"
#include "support/real_pair.h"

namespace {

constexpr int kMaxWidth = 800, kMaxHeight = 600;
uint8_t pixels[kMaxWidth * kMaxHeight];
uint8_t opencv_scores[kMaxHeight][kMaxWidth];
alignas(64) uint8_t arena_memory[24 << 20];
tv_keypoint keypoints[kMaxWidth * kMaxHeight / 4];
real_pair real;

// OpenCV's corners as an image of scores. Without suppression OpenCV gives no scores, so a corner
// is 1.
int opencv_corners(const tv_image& image, int threshold, bool suppress) {
  const cv::Mat view(image.height, image.width, CV_8U, const_cast<uint8_t*>(image.data),
                     static_cast<size_t>(image.stride_bytes));
  std::vector<cv::KeyPoint> found;
  cv::FAST(view, found, threshold, suppress, cv::FastFeatureDetector::TYPE_9_16);
  memset(opencv_scores, 0, sizeof opencv_scores);
  for (const cv::KeyPoint& p : found) {
    opencv_scores[static_cast<int>(p.pt.y)][static_cast<int>(p.pt.x)] =
        static_cast<uint8_t>(suppress ? p.response : 1);
  }
  return static_cast<int>(found.size());
}

void check_unsuppressed(const tv_image& image, int threshold) {
  const tvk_set& kernels = *tvk_select(TV_KERNELS_AUTO);
  opencv_corners(image, threshold, false);
  for (int y = 3; y < image.height - 3; ++y) {
    const uint8_t* rows[7];
    uint8_t scores[kMaxWidth];
    for (int k = 0; k < 7; ++k) rows[k] = image.data + (y - 3 + k) * image.stride_bytes;
    tvk_detect_of(&kernels)->fast_score_row(rows, image.width, 9, threshold, scores);
    for (int x = 0; x < image.width; ++x) {
      TEST_ASSERT_EQUAL_INT(opencv_scores[y][x] != 0, scores[x] != 0);
    }
  }
}

void check_suppressed(const tv_image& image, int threshold) {
  tv_feature_options options;
  memset(&options, 0, sizeof options);
  options.arc = 9;
  options.threshold = threshold;
  options.levels = 1;
  options.scale_factor = 2.0f;
  options.keypoint_size = 4.0f;
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  const int32_t count = tv::find_corners(*tvk_select(TV_KERNELS_AUTO), image, nullptr, options,
                                         image.width * image.height / 4, arena, keypoints);
  TEST_ASSERT_EQUAL_INT(opencv_corners(image, threshold, true), count);
  for (int k = 0; k < count; ++k) {
    const tv_keypoint& p = keypoints[k];
    TEST_ASSERT_EQUAL_INT(opencv_scores[static_cast<int>(p.y)][static_cast<int>(p.x)],
                          static_cast<int>(p.score));
  }
}

void check_image(const tv_image& image) {
  for (int threshold : {1, 5, 10, 20, 40, 100, 200, 254}) {
    check_unsuppressed(image, threshold);
    check_suppressed(image, threshold);
  }
}

void test_real_images_give_opencvs_corners() {
  for (const uint8_t* luma : real.luma) {
    check_image(tv_image{luma, real.width, real.height, real.width});
  }
}

void test_noise_gives_opencvs_corners() {
  uint64_t state = 3;
  random_bytes(&state, pixels, sizeof pixels);
  check_image(tv_image{pixels, 173, 91, 190});
  for (uint8_t& p : pixels) p = p < 40 ? 255 : 0;
  check_image(tv_image{pixels, 173, 91, 190});
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_noise_gives_opencvs_corners);
  const bool has_real_image = real_pair_load(&real) != 0;
  if (has_real_image) RUN_TEST(test_real_images_give_opencvs_corners);
  const int failures = UNITY_END();
  return failures == 0 && !has_real_image ? TWOVIEW_SKIP_CODE : failures;
}
