// The pictures of a live source that are kept for its room: what was kept comes back, in its order
// and close to what it was, and what has no space is not kept and is named.
#include <unity.h>

#include <filesystem>
#include <opencv2/imgproc.hpp>

#include "odometry/kept_pictures.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

cli::SourceFrame frame_of(int index, bool has_colour) {
  cli::SourceFrame frame;
  frame.index = index;
  frame.name = "frame_" + std::to_string(index);
  cv::Mat noise(48, 64, CV_8UC3);
  cv::RNG random(static_cast<uint64_t>(index) + 1);
  random.fill(noise, cv::RNG::UNIFORM, 40, 200);
  cv::GaussianBlur(noise, noise, {}, 2);
  cv::cvtColor(noise, frame.luma, cv::COLOR_BGR2GRAY);
  if (has_colour) frame.colour = noise;
  return frame;
}

std::vector<cli::SourceFrame> again(cli::KeptPictures& kept, int but) {
  std::vector<cli::SourceFrame> frames;
  const std::atomic<bool> stop{false};
  kept.run([but](int index) { return index != but; },
           [&frames](const cli::SourceFrame& frame) {
             frames.push_back(frame);
             return true;
           },
           stop);
  return frames;
}

void test_what_was_kept_comes_back() {
  cli::KeptPictures kept(std::filesystem::temp_directory_path(), "a camera");
  for (const int index : {2, 5, 9}) kept.add(frame_of(index, index != 5));
  TEST_ASSERT_TRUE(kept.has(5) && !kept.has(3));
  const std::vector<cli::SourceFrame> frames = again(kept, 2);
  TEST_ASSERT_EQUAL(2, frames.size());
  TEST_ASSERT_TRUE(frames[0].colour.empty());
  TEST_ASSERT_FALSE(frames[1].colour.empty());
  for (const cli::SourceFrame& frame : frames) {
    TEST_ASSERT_EQUAL_STRING(("frame_" + std::to_string(frame.index)).c_str(), frame.name.c_str());
    const cv::Mat luma = frame_of(frame.index, false).luma;
    TEST_ASSERT_TRUE(cv::norm(luma, frame.luma, cv::NORM_L1) <
                     1.5 * static_cast<double>(luma.total()));
  }
  TEST_ASSERT_TRUE(kept.notes().empty());
}

void test_what_has_no_space_is_not_kept() {
  cli::KeptPictures kept(std::filesystem::temp_directory_path(), "a camera", 6000);
  for (int index = 0; index < 20; ++index) kept.add(frame_of(index, false));
  const std::vector<cli::SourceFrame> frames = again(kept, -1);
  TEST_ASSERT_TRUE(!frames.empty() && frames.size() < 20);
  const std::string last = frames.back().name;
  TEST_ASSERT_EQUAL(frames.size() - 1, frames.back().index);  // none after the first without space
  TEST_ASSERT_EQUAL(1, kept.notes().size());
  TEST_ASSERT_TRUE(kept.notes()[0].find("the last is " + last) != std::string::npos);
}

}  // namespace

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_what_was_kept_comes_back);
  RUN_TEST(test_what_has_no_space_is_not_kept);
  return UNITY_END();
}
