// The standard deviation of a keypoint's position by the keypoint's size, for tv_keypoint_sigmas.
#pragma once

#include "twoview/feature.h"

namespace tv {

// The range of a pixel's sigma, and of the exponent by which a keypoint's size gives it.
inline constexpr double kMostSigmaExponent = 2;
inline constexpr float kLeastSigma = 0.01f, kLargestSigma = 1000.0f;

// The sigmas of keypoints, one after another. Keypoints of a level mostly have one size: the last
// one of each level gives the next one's sigma, so that a logarithm and an exponential a level
// suffice.
class KeypointSigmas {
 public:
  // size_of_one: the size of a keypoint whose sigma is 1.
  KeypointSigmas(float size_of_one, double exponent)
      : size_of_one_(size_of_one), exponent_(exponent) {}
  float of(const tv_keypoint& keypoint);

 private:
  struct OfLevel {
    float size, sigma;
  };
  static constexpr uint32_t kLevels = 8;  // that an image has at most
  OfLevel levels_[kLevels] = {};
  float size_of_one_;
  double exponent_;
};

}  // namespace tv
