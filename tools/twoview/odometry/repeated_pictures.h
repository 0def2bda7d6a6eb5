// Pictures that a film, a stream or a folder gives again while its clock runs: they say nothing of
// where the camera is, which need not have stood still meanwhile.
#pragma once

#include <cstddef>
#include <deque>
#include <opencv2/core/mat.hpp>
#include <vector>

namespace cli {

// Tells the repeated pictures of a sequence by how much each differs from the last new one (mean
// absolute difference of the pixels). A camera cannot stop between two frames, and a picture of a
// camera that stands still has its noise, or comes after slower and slower ones: a picture that
// differs by less than a fifth of what neighbours differed by before it is the same picture, stored
// again. Whether the camera stood still meanwhile after all, the next new picture says.
class RepeatedPictures {
 public:
  // Whether this picture, 8-bit grey, is the last new one again. `frame` is the caller's number.
  bool is_repeated(const cv::Mat& luma, size_t frame);
  // Ends the sequence: what is repeated at its end counts as `stood`.
  void end();

  // The frames, in ascending order, whose picture was repeated although the camera moved on, as far
  // as is known yet. Pictures that an encoder stored anew between repeated ones are among them.
  const std::vector<size_t>& stood() const { return stood_; }
  // The frames whose picture was repeated because the camera stood still.
  const std::vector<size_t>& waited() const { return waited_; }

 private:
  void close(std::vector<size_t>& frames);
  double usual() const;

  cv::Mat last_;              // the last new picture
  std::deque<double> steps_;  // differences of new pictures, the newest last
  std::vector<size_t> run_;   // frames of which it is not known yet
  bool is_after_repeated_ = false;
  std::vector<size_t> stood_, waited_;
};

}  // namespace cli
