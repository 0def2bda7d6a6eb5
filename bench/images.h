// Pairs of real images in memory, with what is known about their cameras.
//
// From TWOVIEW_DATA (else ../shared/data beside the project): 640x480 is a pair of TUM's fr3 office
// as it is; 1280x720 the middle of Strecha's fountain, 1536x1024 averaged down to 1280x853. Without
// that data both are cut out of Middlebury's Motorcycle pair, the larger one after enlarging.
#pragma once

#include <opencv2/core.hpp>
#include <string>

#include "twoview/twoview.h"

namespace bench {

struct Pair {
  std::string name;  // the size of the images: "640x480" or "1280x720"
  cv::Mat image[2];  // 8-bit grey
  tv_camera camera[2];
  bool has_truth;
  double R[9], t[3];  // true pose x1 = R x0 + t; only valid if has_truth
};

enum class Size { kVga, kHd };

// The pair of this size. Ends the program with one line on stderr if the images are missing.
const Pair& pair_of(Size size);

tv_image view_of(const cv::Mat& image);

}  // namespace bench
