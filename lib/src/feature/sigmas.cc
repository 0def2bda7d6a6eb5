#include "feature/sigmas.h"

#include <algorithm>

#include "base/math.h"

namespace tv {

float KeypointSigmas::of(const tv_keypoint& keypoint) {
  OfLevel& last = levels_[static_cast<uint32_t>(keypoint.level) % kLevels];
  if (keypoint.size != last.size) {
    const double ratio = static_cast<double>(keypoint.size) / size_of_one_;
    const float sigma = static_cast<float>(exp(exponent_ * log(ratio)));
    last = {keypoint.size, std::max(kLeastSigma, std::min(sigma, kLargestSigma))};
  }
  return last.sigma;
}

}  // namespace tv
