#include "odometry/combed_rows.h"

#include <cstdint>
#include <cstdlib>

namespace cli {
namespace {

constexpr size_t kEvery = 4;     // pictures; half of those of a telecine are combed
constexpr size_t kFewest = 3;    // combed ones
constexpr double kShare = 0.05;  // of those seen: a camera that stands combs nothing

// Whether pixels that are `step` apart differ by more than those that are twice as far apart. In a
// picture of a scene differences grow with the distance, and noise makes them at most equal: the
// sum of squares of neighbouring rows is 0.29 to 0.53 of that of rows two apart in the pictures of
// 22 data sets (2026-11-30), and 1 to 46 times it where fields of two of their frames are woven.
bool are_alternating(const cv::Mat& luma, int step_x, int step_y) {
  int64_t near = 0, far = 0;
  for (int y = 0; y + 2 * step_y < luma.rows; ++y) {
    const uint8_t* const row = luma.ptr<uint8_t>(y);
    const uint8_t* const next = luma.ptr<uint8_t>(y + step_y);
    const uint8_t* const second = luma.ptr<uint8_t>(y + 2 * step_y);
    for (int x = 0; x + 2 * step_x < luma.cols; ++x) {
      const int to_next = row[x] - next[x + step_x], to_second = row[x] - second[x + 2 * step_x];
      near += to_next * to_next;
      far += to_second * to_second;
    }
  }
  return near > far;
}

}  // namespace

void CombedRows::add(const cv::Mat& luma) {
  if (num_++ % kEvery != 0) return;
  ++num_seen_;
  if (!are_alternating(luma, 0, 1)) return;
  ++num_combed_;
  num_mosaics_ += are_alternating(luma, 1, 0);
}

double CombedRows::share() const {
  return num_seen_ == 0 ? 0 : static_cast<double>(num_combed_) / static_cast<double>(num_seen_);
}

std::string CombedRows::words() const {
  if (num_combed_ < kFewest || share() < kShare) return "";
  const std::string seen = "in " + std::to_string(num_combed_) + " of " +
                           std::to_string(num_seen_) + " pictures that were looked at ";
  if (2 * num_mosaics_ > num_combed_)
    return seen +
           "neighbouring pixels differ by more than those two apart: a colour sensor's "
           "mosaic taken as grey? Make colours of it first (debayer)";
  return seen +
         "neighbouring rows differ by more than rows two apart: even and odd rows are of "
         "two moments (interlaced): deinterlace first (ffmpeg -vf bwdif)";
}

}  // namespace cli
