#include "odometry/two_eyes.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "base/median.h"

namespace cli {
namespace {

constexpr size_t kEvery = 4, kMostPictures = 12, kLeastPictures = 4;  // whose halves are compared
constexpr int kHalfWidth = 160;  // pixels to which a half is brought
constexpr int kPatch = 15, kPatchRows = 5, kPatchColumns = 6;
constexpr int kReach = 45, kReachRows = 6;     // within which a patch is looked for
constexpr double kSigma = 8, kSigmaAlong = 3;  // grey levels, of a patch and of its row and column
constexpr double kAlike = 0.8;                 // correlation
constexpr size_t kLeastPatches = 8;
// Of two eyes 0.31 to 0.95 of the patches are found (unrectified boards, bicycle, halves of a
// film), of 24 sets of one eye at most 0.27 in the median of their pictures, and as many at other
// rows.
constexpr double kShare = 0.5, kOtherShare = 0.25;
// Pictures in turn: each is more like the one before the last than like the last one.
constexpr size_t kLeastSteps = 12;
constexpr double kInTurnShare = 0.9;

bool has_texture(const cv::Mat& patch) {
  const auto sigma_of = [](const cv::Mat& values) {
    cv::Scalar mean, sigma;
    cv::meanStdDev(values, mean, sigma);
    return sigma[0];
  };
  cv::Mat row, column;
  cv::reduce(patch, row, 0, cv::REDUCE_AVG, CV_32F);
  cv::reduce(patch, column, 1, cv::REDUCE_AVG, CV_32F);
  return sigma_of(patch) >= kSigma && sigma_of(row) >= kSigmaAlong &&
         sigma_of(column) >= kSigmaAlong;
}

bool is_found(const cv::Mat& patch, const cv::Mat& half, int x, int y) {
  const cv::Rect near(x - kReach, y - kReachRows, kPatch + 2 * kReach, kPatch + 2 * kReachRows);
  const cv::Rect inside = near & cv::Rect(0, 0, half.cols, half.rows);
  if (inside.width < kPatch || inside.height < kPatch) return false;
  cv::Mat correlation;
  cv::matchTemplate(half(inside), patch, correlation, cv::TM_CCOEFF_NORMED);
  double best = 0;
  cv::minMaxLoc(correlation, nullptr, &best);
  return best > kAlike;
}

cv::Mat small_of(const cv::Mat& luma, int width) {
  cv::Mat small;
  const int height = std::max(1, luma.rows * width / std::max(1, luma.cols));
  cv::resize(luma, small, {width, height}, 0, 0, cv::INTER_AREA);
  return small;
}

}  // namespace

std::string layout_name(EyesLayout layout) {
  switch (layout) {
    case EyesLayout::kSideBySide: return "side_by_side";
    case EyesLayout::kTopBottom: return "top_bottom";
    case EyesLayout::kInTurn: return "in_turn";
    default: return "";
  }
}

bool TwoEyes::Halves::are_alike() const {
  return same_rows.size() >= kLeastPictures && median_of(same_rows) >= kShare &&
         median_of(other_rows) <= kOtherShare;
}

void TwoEyes::add(const cv::Mat& luma) {
  if (num_ % kEvery == 0 && num_ < kEvery * kMostPictures) compare_halves(luma);
  if (num_steps_ < kEvery * kMostPictures) compare_in_turn(luma);
  ++num_;
}

void TwoEyes::compare_halves(const cv::Mat& luma) {
  const int width = luma.cols / 2, height = luma.rows / 2;
  if (width < kPatch || height < kPatch) return;
  const auto compare = [](const cv::Mat& first, const cv::Mat& second, Halves& halves) {
    const cv::Mat a = small_of(first, kHalfWidth), b = small_of(second, kHalfWidth);
    size_t count = 0, found = 0, elsewhere = 0;
    if (a.rows <= kPatch) return;
    for (int n = 0; n < kPatchRows * kPatchColumns; ++n) {
      const int x = (2 * (n % kPatchColumns) + 1) * a.cols / (2 * kPatchColumns) - kPatch / 2;
      const int y = (2 * (n / kPatchColumns) + 1) * a.rows / (2 * kPatchRows) - kPatch / 2;
      const cv::Rect place(x, y, kPatch, kPatch);
      if ((place & cv::Rect(0, 0, a.cols, a.rows)) != place || !has_texture(a(place))) continue;
      ++count;
      found += is_found(a(place), b, x, y);
      elsewhere += is_found(a(place), b, x, (y + a.rows / 3) % (a.rows - kPatch));
    }
    if (count < kLeastPatches) return;
    halves.same_rows.push_back(static_cast<double>(found) / static_cast<double>(count));
    halves.other_rows.push_back(static_cast<double>(elsewhere) / static_cast<double>(count));
  };
  compare(luma.colRange(0, width), luma.colRange(luma.cols - width, luma.cols), beside_);
  compare(luma.rowRange(0, height), luma.rowRange(luma.rows - height, luma.rows), above_);
}

void TwoEyes::compare_in_turn(const cv::Mat& luma) {
  const cv::Mat small = small_of(luma, kHalfWidth);
  if (before_[1].size() == small.size() && before_[0].size() == small.size()) {
    ++num_steps_;
    num_in_turn_ +=
        cv::norm(small, before_[1], cv::NORM_L1) < cv::norm(small, before_[0], cv::NORM_L1);
  }
  before_[1] = before_[0];
  before_[0] = small;
}

EyesLayout TwoEyes::layout() const {
  if (beside_.are_alike()) return EyesLayout::kSideBySide;
  if (above_.are_alike()) return EyesLayout::kTopBottom;
  const bool are_in_turn =
      num_steps_ >= kLeastSteps &&
      static_cast<double>(num_in_turn_) >= kInTurnShare * static_cast<double>(num_steps_);
  return are_in_turn ? EyesLayout::kInTurn : EyesLayout::kOne;
}

std::string TwoEyes::words() const {
  switch (layout()) {
    case EyesLayout::kSideBySide:
      return "the left and the right half of the pictures show the same scene, as films of two "
             "eyes do: give the pictures of one (ffmpeg -vf crop=iw/2:ih:0:0)";
    case EyesLayout::kTopBottom:
      return "the upper and the lower half of the pictures show the same scene, as films of two "
             "eyes do: give the pictures of one (ffmpeg -vf crop=iw:ih/2:0:0)";
    case EyesLayout::kInTurn:
      return "each picture is more like the one before the last than like the last one, as where "
             "two cameras take them in turn: give those of one (--every 2)";
    default: return "";
  }
}

}  // namespace cli
