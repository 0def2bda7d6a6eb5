// What a room says became of a depth map's pixels: only those that the picture shows count.
#include <unity.h>

#include "room_model/depth.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

// A lens whose pinhole map has corners beyond the picture.
const tv_camera camera{TV_CAMERA_BROWN_CONRADY, 160, 120, 0, 100, 100, 80, 60,
                       {-0.28, 0.075, 0, 0, 0}};

cli::PixelCounts counts_of(const cli::RoomPicture& picture) {
  cli::DepthSweep sweep(camera);
  cli::TileCounts tiles{};
  sweep.count_unmapped(picture, tiles);
  cli::PixelCounts all;
  for (const cli::PixelCounts& tile : tiles) all.add(tile);
  return all;
}

cli::RoomPicture noise() {
  cli::RoomPicture picture;
  picture.luma.create(camera.height, camera.width, CV_8U);
  cv::randu(picture.luma, 0, 256);
  return picture;
}

void test_what_lies_beyond_the_picture_is_no_plain_wall() {
  const cli::PixelCounts counts = counts_of(noise());
  const tv_camera map = cli::DepthSweep(camera).map_camera();
  TEST_ASSERT_EQUAL(0, counts.no_texture);
  TEST_ASSERT_TRUE(counts.total() < 0.95 * map.width * map.height);
  TEST_ASSERT_TRUE(counts.total() > 0.5 * map.width * map.height);
}

void test_what_a_mask_leaves_out_does_not_count() {
  cli::RoomPicture picture = noise();
  const int64_t all = counts_of(picture).total();
  picture.mask = cv::Mat::zeros(camera.height, camera.width, CV_8U);
  picture.mask.colRange(0, camera.width / 2) = 255;
  const int64_t half = counts_of(picture).total();
  TEST_ASSERT_TRUE(half > 0.45 * all && half < 0.55 * all);
}

}  // namespace

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_what_lies_beyond_the_picture_is_no_plain_wall);
  RUN_TEST(test_what_a_mask_leaves_out_does_not_count);
  return UNITY_END();
}
