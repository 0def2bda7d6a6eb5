// A film that is written and read through OpenCV comes out of the frame source unchanged, both when
// it is read as a file and when it is played as a live camera.
#include <time.h>
#include <unistd.h>
#include <unity.h>

#include <cstdio>
#include <cstdlib>
#include <opencv2/videoio.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "sources/camera_source.h"

using cli::CameraSource;

namespace {

constexpr int kFrames = 20, kWidth = 96, kHeight = 64;
constexpr double kFps = 25;
std::string film;

int grey_of(uint64_t number) { return 30 + 10 * static_cast<int>(number); }

void write_film() {
  cv::VideoWriter writer(film, cv::CAP_OPENCV_MJPEG, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'),
                         kFps, cv::Size(kWidth, kHeight));
  if (!writer.isOpened()) {
    std::printf("skipped: this OpenCV writes no film\n");
    std::exit(TWOVIEW_SKIP_CODE);
  }
  for (int k = 0; k < kFrames; ++k) {
    writer.write(
        cv::Mat(kHeight, kWidth, CV_8UC3, cv::Scalar::all(grey_of(static_cast<uint64_t>(k)))));
  }
}

tvs_frame empty_frame() {
  tvs_frame frame{};
  frame.struct_size = sizeof frame;
  return frame;
}

void check_picture(const tvs_frame& frame) {
  TEST_ASSERT_EQUAL_INT(kWidth, frame.image.width);
  TEST_ASSERT_EQUAL_INT(kHeight, frame.image.height);
  const uint8_t* row = frame.image.data + (kHeight - 1) * frame.image.stride_bytes;
  TEST_ASSERT_INT_WITHIN(3, grey_of(frame.number), row[kWidth - 1]);
  TEST_ASSERT_TRUE(frame.flags & TVS_FRAME_KEY);
}

void test_a_film_gives_each_picture_with_its_time() {
  CameraSource camera(film);
  const tvs_frame_source source = camera.frames();
  std::vector<tvs_frame> held;
  tvs_frame frame = empty_frame();
  while (source.next(source.user, &frame) == TVS_OK) held.push_back(frame);
  TEST_ASSERT_EQUAL_INT(kFrames, static_cast<int>(held.size()));
  TEST_ASSERT_EQUAL_INT(TVS_END, source.next(source.user, &frame));
  // No frame was released yet: all are held at the same time.
  for (size_t k = 0; k < held.size(); ++k) {
    check_picture(held[k]);
    TEST_ASSERT_EQUAL_UINT64(k, held[k].number);
    TEST_ASSERT_FALSE(held[k].flags & (TVS_FRAME_GAP | TVS_FRAME_HAS_ATTITUDE));
    TEST_ASSERT_EQUAL_INT(k == 0, (held[k].flags & TVS_FRAME_NEW_STREAM) != 0);
    TEST_ASSERT_EQUAL_UINT32(1, held[k].time.clock_id);
    TEST_ASSERT_DOUBLE_WITHIN(1e-3, static_cast<double>(k) / kFps,
                              static_cast<double>(held[k].time.device_ns) * 1e-9);
    source.release(source.user, &held[k]);
  }
}

void test_a_live_source_never_waits_and_flags_what_it_left_out() {
  CameraSource camera(film, CameraSource::Kind::kLive);
  const tvs_frame_source source = camera.frames();
  tvs_frame frame = empty_frame();
  uint64_t expected = 0;
  int64_t last_ns = 0;
  int num = 0;
  for (int tries = 0; tries < 20000; ++tries) {
    const tvs_status status = source.next(source.user, &frame);
    if (status == TVS_END) break;
    if (status == TVS_NONE) {
      usleep(100);
      continue;
    }
    TEST_ASSERT_EQUAL_INT(TVS_OK, status);
    check_picture(frame);
    TEST_ASSERT_TRUE(frame.number >= expected && frame.time.host_ns >= last_ns);
    TEST_ASSERT_EQUAL_INT(frame.number != expected, (frame.flags & TVS_FRAME_GAP) != 0);
    TEST_ASSERT_EQUAL_UINT32(0, frame.time.clock_id);
    expected = frame.number + 1;
    last_ns = frame.time.host_ns;
    ++num;
    source.release(source.user, &frame);
    usleep(2000);
  }
  TEST_ASSERT_TRUE(num > 0);
  // a live source may drop frames, but delivers the last one
  TEST_ASSERT_EQUAL_UINT64(kFrames, expected);
  TEST_ASSERT_EQUAL_INT(TVS_END, source.next(source.user, &frame));
}

void test_a_paced_film_plays_at_its_rate_from_the_first_call_on() {
  CameraSource camera(film, CameraSource::Kind::kPaced);
  const tvs_frame_source source = camera.frames();
  tvs_frame frame = empty_frame();
  usleep(200000);
  int64_t first_ns = 0, num = 0;
  for (;;) {
    const tvs_status status = source.next(source.user, &frame);
    if (status == TVS_END) break;
    if (status == TVS_OK) {
      check_picture(frame);
      if (num++ == 0) first_ns = frame.time.host_ns - static_cast<int64_t>(frame.number * 4e7);
      TEST_ASSERT_INT64_WITHIN(1000, first_ns + static_cast<int64_t>(frame.number * 4e7),
                               frame.time.host_ns);
      timespec now{};
      clock_gettime(CLOCK_MONOTONIC, &now);
      TEST_ASSERT_TRUE(now.tv_sec * int64_t{1000000000} + now.tv_nsec >= frame.time.host_ns);
      source.release(source.user, &frame);
    }
    usleep(1000);
  }
  TEST_ASSERT_TRUE(num > kFrames / 2);
  TEST_ASSERT_EQUAL_UINT64(kFrames - 1, frame.number);
}

void test_a_pipeline_is_a_camera_by_its_name() {
  TEST_ASSERT_TRUE(CameraSource::kind_of("gst:x ! appsink") == CameraSource::Kind::kLive);
  TEST_ASSERT_TRUE(CameraSource::kind_of("v4l2:/dev/video3") == CameraSource::Kind::kLive);
  TEST_ASSERT_TRUE(CameraSource::kind_of("film.avi") == CameraSource::Kind::kFile);
  std::string refused;
  try {
    CameraSource camera(
        "gst:videotestsrc num-buffers=40 ! video/x-raw,width=96,height=64 ! videoconvert ! "
        "video/x-raw,format=BGR ! appsink");
    const tvs_frame_source source = camera.frames();
    tvs_frame frame = empty_frame();
    tvs_status status = TVS_NONE;
    for (int k = 0; k < 5000 && status == TVS_NONE; ++k) {
      status = source.next(source.user, &frame);
      usleep(1000);
    }
    TEST_ASSERT_EQUAL_INT(TVS_OK, status);
    TEST_ASSERT_EQUAL_INT(kWidth, frame.image.width);
    source.release(source.user, &frame);
  } catch (const cli::BadInput& e) {
    refused = e.what();
  }
  if (refused.empty()) return;
  TEST_ASSERT_TRUE(refused.find("gst:") != std::string::npos);
  TEST_IGNORE_MESSAGE("no GStreamer in this OpenCV, or no gstreamer1.0-plugins-base");
}

void test_what_does_not_open_is_refused() {
  for (const char* name :
       {"/no/such/film.avi", "", "999", "/dev/null", "v4l2:/dev/null", "gst:no_such"}) {
    bool refused = false;
    try {
      CameraSource camera(name);
    } catch (const cli::BadInput& e) {
      refused = std::string(e.what()).find(name) != std::string::npos;
    }
    TEST_ASSERT_TRUE_MESSAGE(refused, name);
  }
}

void test_bad_arguments() {
  CameraSource camera(film);
  const tvs_frame_source source = camera.frames();
  tvs_frame frame{};
  TEST_ASSERT_EQUAL_INT(TVS_ERR_NULL, source.next(source.user, nullptr));
  TEST_ASSERT_EQUAL_INT(TVS_ERR_STRUCT_SIZE, source.next(source.user, &frame));
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  film = "/tmp/twoview_film_" + std::to_string(getpid()) + ".avi";
  write_film();
  UNITY_BEGIN();
  RUN_TEST(test_a_film_gives_each_picture_with_its_time);
  RUN_TEST(test_a_live_source_never_waits_and_flags_what_it_left_out);
  RUN_TEST(test_a_paced_film_plays_at_its_rate_from_the_first_call_on);
  RUN_TEST(test_a_pipeline_is_a_camera_by_its_name);
  RUN_TEST(test_what_does_not_open_is_refused);
  RUN_TEST(test_bad_arguments);
  unlink(film.c_str());
  return UNITY_END();
}
