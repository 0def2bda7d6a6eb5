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

// What a map knows of a pixel says whether the picture shows it: what lies beyond its edge and
// what the mask leaves out do not become plain walls, and do not darken their neighbours.
void test_a_map_says_which_of_its_pixels_show_the_scene() {
  cli::RoomPicture picture;
  picture.luma.create(camera.height, camera.width, CV_8U);
  cv::randu(picture.luma, 100, 200);
  const cli::RoomPicture other = picture;
  picture.mask = cv::Mat(camera.height, camera.width, CV_8U, cv::Scalar(255));
  picture.mask.rowRange(100, camera.height) = 0;  // the vehicle
  cli::RoomView here, beside;
  beside.t = {0.1, 0, 0};
  cli::DepthSweep sweep(camera);
  cli::TileCounts tiles{};
  cli::MapPixels map;
  sweep.run({&here, &beside}, {&picture, &other}, 1, 10, tiles).unpack(map);
  const int width = sweep.map_camera().width, height = sweep.map_camera().height;
  TEST_ASSERT_EQUAL(width * height, map.shown.size());
  const auto at = [width](int x, int y) { return static_cast<size_t>(y * width + x); };
  // The map is so large that its corners are those of the picture, whose sides bend inwards.
  TEST_ASSERT_EQUAL(0, map.shown[at(width / 2, 0)]);
  TEST_ASSERT_EQUAL(0, map.shown[at(width / 2, height - 1)]);
  TEST_ASSERT_EQUAL(255, map.shown[at(width / 2, height / 2)]);
  for (size_t i = 0; i < map.shown.size(); ++i) {
    TEST_ASSERT_TRUE(map.shown[i] != 0 || map.distance[i] == 0);
    TEST_ASSERT_TRUE(map.shown[i] == 0 || map.rgb[3 * i] >= 95);
  }
}

}  // namespace

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_what_lies_beyond_the_picture_is_no_plain_wall);
  RUN_TEST(test_what_a_mask_leaves_out_does_not_count);
  RUN_TEST(test_a_map_says_which_of_its_pixels_show_the_scene);
  return UNITY_END();
}
