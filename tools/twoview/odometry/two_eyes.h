// Pictures of two eyes in a source that is taken as of one camera: side by side or one above the
// other in each picture, or the one eye's and the other's in turn.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace cli {

enum class EyesLayout { kOne, kSideBySide, kTopBottom, kInTurn };
// "side_by_side", "top_bottom", "in_turn"; empty for kOne.
std::string layout_name(EyesLayout layout);

// Looks at some of a sequence's pictures, in their order.
class TwoEyes {
 public:
  void add(const cv::Mat& luma);
  // By what was seen so far; of few or plain pictures kOne.
  EyesLayout layout() const;
  // What the user must know of such pictures, as a line without an end; empty for kOne.
  std::string words() const;

 private:
  // For patches of one half of a picture, the share that is found in the other half at the same
  // rows, and at other rows, which chance alone gives; one number a picture.
  struct Halves {
    std::vector<double> same_rows, other_rows;
    bool are_alike() const;
  };
  void compare_halves(const cv::Mat& luma);
  void compare_in_turn(const cv::Mat& luma);

  size_t num_ = 0;
  Halves beside_, above_;
  cv::Mat before_[2];  // the two pictures before, small, the newest first
  size_t num_steps_ = 0, num_in_turn_ = 0;
};

}  // namespace cli
