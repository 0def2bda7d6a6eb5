// Pictures whose even and odd rows are not of one picture: two fields of two moments that no
// container calls interlaced, or the mosaic of a colour sensor taken as grey.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

namespace cli {

// Looks at some of a sequence's pictures.
class CombedRows {
 public:
  void add(const cv::Mat& luma);
  // The share of the pictures examined in which neighbouring rows differ more than rows that are
  // two apart.
  double share() const;
  // What the user must know of such pictures, as a line without an end; empty where there are few.
  std::string words() const;

 private:
  size_t num_ = 0, num_seen_ = 0, num_combed_ = 0, num_mosaics_ = 0;
};

}  // namespace cli
