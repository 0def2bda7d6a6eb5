// Pictures as a pinhole would have taken them, by the library's lens models.
#pragma once

#include <opencv2/core/mat.hpp>

#include "twoview/camera.h"

namespace cli {

// The pinhole of the same size, focal length and principal point.
tv_camera pinhole_of(const tv_camera& lens);

// The position in the lens's picture of each pixel of a pinhole's.
struct UndistortMap {
  cv::Mat place;  // for each new pixel x y in the old picture, 32-bit floats
  // 255 if the lens model is valid there and the position is in the old picture, else 0
  cv::Mat seen;
};
UndistortMap undistort_map(const tv_camera& lens, const tv_camera& pinhole);

// Interpolates bicubically. At the border the nearest pixels are repeated, and pixels without a
// position in the old picture are black.
cv::Mat undistorted(const cv::Mat& picture, const UndistortMap& map);

// The largest part around the middle of the pinhole's picture, of about its shape, of which the
// lens has seen every pixel; of size 0 where the middle was not seen.
cv::Rect seen_middle(const UndistortMap& map);

}  // namespace cli
