// The library's inputs of two views, from the program's own types.
#pragma once

#include <algorithm>
#include <vector>

#include "base/matrix.h"
#include "twoview/camera.h"
#include "twoview/two_view.h"

namespace cli {

// R, t: cam1_from_cam0.
inline tv_camera_pair camera_pair(const tv_camera& camera0, const tv_camera& camera1,
                                  const Matrix3& R, const Vector3& t) {
  tv_camera_pair pair{camera0, camera1, {}, {}};
  std::copy(R.begin(), R.end(), pair.cam1_from_cam0_R);
  std::copy(t.begin(), t.end(), pair.cam1_from_cam0_t);
  return pair;
}

// pixels: (x, y) of each match, in image 0 and in image 1. They are not copied.
inline tv_pixel_pairs pixel_pairs(const std::vector<double> pixels[2]) {
  tv_pixel_pairs pairs;
  tv_pixel_pairs_init(&pairs);
  pairs.num = static_cast<int32_t>(pixels[0].size() / 2);
  pairs.pixels0 = pixels[0].data();
  pairs.pixels1 = pixels[1].data();
  return pairs;
}

}  // namespace cli
