#include "pictures/undistorted.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "base/error.h"

namespace cli {

tv_camera pinhole_of(const tv_camera& lens) {
  tv_camera pinhole = lens;
  pinhole.model = TV_CAMERA_PINHOLE;
  std::fill(std::begin(pinhole.k), std::end(pinhole.k), 0.0);
  return pinhole;
}

UndistortMap undistort_map(const tv_camera& lens, const tv_camera& pinhole) {
  UndistortMap map{cv::Mat(pinhole.height, pinhole.width, CV_32FC2),
                   cv::Mat(pinhole.height, pinhole.width, CV_8U)};
  const auto width = static_cast<size_t>(pinhole.width);
  std::vector<double> rays(3 * width), pixels(2 * width);
  std::vector<uint8_t> inside(width);
  for (int y = 0; y < pinhole.height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      rays[3 * x] = (static_cast<double>(x) - pinhole.cx) / pinhole.fx;
      rays[3 * x + 1] = (y - pinhole.cy) / pinhole.fy;
      rays[3 * x + 2] = 1;
    }
    check(tv_camera_project_points(&lens, rays.data(), pinhole.width, pixels.data(), inside.data()),
          "cannot project");
    for (size_t x = 0; x < width; ++x) {
      const double u = pixels[2 * x], v = pixels[2 * x + 1];
      const bool seen =
          inside[x] && u >= -0.5 && v >= -0.5 && u <= lens.width - 0.5 && v <= lens.height - 0.5;
      map.seen.at<uint8_t>(y, static_cast<int>(x)) = seen ? 255 : 0;
      map.place.at<cv::Vec2f>(y, static_cast<int>(x)) =
          seen ? cv::Vec2f(static_cast<float>(u), static_cast<float>(v)) : cv::Vec2f(0, 0);
    }
  }
  return map;
}

cv::Mat undistorted(const cv::Mat& picture, const UndistortMap& map) {
  cv::Mat remapped, result;
  cv::remap(picture, remapped, map.place, cv::noArray(), cv::INTER_CUBIC, cv::BORDER_REPLICATE);
  remapped.copyTo(result, map.seen);  // pixels without a position stay 0
  return result;
}

cv::Rect seen_middle(const UndistortMap& map) {
  const int width = map.seen.cols, height = map.seen.rows;
  cv::Mat sums;
  cv::integral(map.seen == 0, sums, CV_64F);
  for (int y = 0; y < height / 2; ++y) {
    const int x = static_cast<int>(std::lround(static_cast<double>(y) * width / height));
    if (2 * x >= width) break;
    const int right = width - x, below = height - y;
    if (sums.at<double>(below, right) - sums.at<double>(y, right) - sums.at<double>(below, x) +
            sums.at<double>(y, x) ==
        0)
      return {x, y, width - 2 * x, height - 2 * y};
  }
  return {};
}

}  // namespace cli
