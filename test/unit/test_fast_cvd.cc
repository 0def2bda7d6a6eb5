// FAST-12 finds the same pixels as libcvd's fast_corner_detect_12, which is by the authors of FAST.

#include <cvd/fast_corner.h>
#include <cvd/image.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include <initializer_list>
#include <vector>

#include "kernels/kernels.h"
#include "support/random.h"
#include "support/real_pair.h"
#include "twoview/context.h"

namespace {

constexpr int kMaxWidth = 800, kMaxHeight = 600;
uint8_t pixels[kMaxWidth * kMaxHeight];
uint8_t theirs[kMaxHeight][kMaxWidth];
real_pair real;

void check_image(const uint8_t* data, int width, int height) {
  const CVD::BasicImage<CVD::byte> image(const_cast<uint8_t*>(data), CVD::ImageRef(width, height));
  for (int threshold : {1, 5, 10, 20, 40, 100, 200}) {
    std::vector<CVD::ImageRef> corners;
    CVD::fast_corner_detect_12(image, corners, threshold);
    memset(theirs, 0, sizeof theirs);
    for (const CVD::ImageRef& p : corners) theirs[p.y][p.x] = 1;
    for (int y = 3; y < height - 3; ++y) {
      const uint8_t* rows[7];
      uint8_t scores[kMaxWidth];
      for (int k = 0; k < 7; ++k) rows[k] = data + (y - 3 + k) * width;
      tvk_detect_of(tvk_select(TV_KERNELS_AUTO))
          ->fast_score_row(rows, width, 12, threshold, scores);
      for (int x = 0; x < width; ++x) TEST_ASSERT_EQUAL_INT(theirs[y][x], scores[x] != 0);
    }
  }
}

void test_noise_gives_libcvds_corners() {
  uint64_t state = 5;
  random_bytes(&state, pixels, sizeof pixels);
  check_image(pixels, 192, 91);
  for (uint8_t& p : pixels) p = p < 40 ? 255 : 0;
  check_image(pixels, 192, 91);
}

void test_real_images_give_libcvds_corners() {
  for (const uint8_t* luma : real.luma) check_image(luma, real.width, real.height);
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_noise_gives_libcvds_corners);
  const bool has_real_image = real_pair_load(&real) != 0;
  if (has_real_image) RUN_TEST(test_real_images_give_libcvds_corners);
  const int failures = UNITY_END();
  return failures == 0 && !has_real_image ? TWOVIEW_SKIP_CODE : failures;
}
