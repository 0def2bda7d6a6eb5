#include "pair/camera_advice.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "pair/measures.h"

namespace cli {
namespace {

constexpr int kLeastPairs = 8;
constexpr double kContradicts = 13.815510557964274;  // chi-square of two, 99.9 %: 2 log(1000)
constexpr double kMedian = 0.5;

bool same_camera(const tv_camera& a, const tv_camera& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

CameraAdvice advice_for(const tv_camera& camera, const std::vector<ShiftEvidence>& pairs) {
  CameraAdvice advice;
  advice.camera = camera;
  std::vector<double> x, y, distance;
  for (const ShiftEvidence& pair : pairs) {
    if (!same_camera(pair.camera, camera)) continue;
    ++advice.num_pairs;
    if (pair.chi2 <= kContradicts) continue;
    x.push_back(pair.asked_px[0]);
    y.push_back(pair.asked_px[1]);
  }
  advice.num_asking = static_cast<int>(x.size());
  if (x.empty()) return advice;
  advice.asked_px[0] = percentile(x, kMedian);
  advice.asked_px[1] = percentile(y, kMedian);
  for (size_t i = 0; i < x.size(); ++i)
    distance.push_back(std::hypot(x[i] - advice.asked_px[0], y[i] - advice.asked_px[1]));
  advice.deviation_px = percentile(distance, kMedian);
  advice.calibrate_again =
      advice.num_pairs >= kLeastPairs && 2 * advice.num_asking > advice.num_pairs &&
      2 * advice.deviation_px < std::hypot(advice.asked_px[0], advice.asked_px[1]);
  return advice;
}

}  // namespace

std::optional<ShiftEvidence> shift_evidence(const tv_evidence& of_pair, const tv_camera& camera) {
  if (!(of_pair.principal_point_asked_covariance[0] > 0)) return std::nullopt;
  return ShiftEvidence{camera,
                       of_pair.principal_point_chi2,
                       {of_pair.principal_point_asked_px[0], of_pair.principal_point_asked_px[1]}};
}

std::vector<CameraAdvice> advise(const std::vector<ShiftEvidence>& pairs) {
  std::vector<CameraAdvice> all;
  for (const ShiftEvidence& pair : pairs) {
    const bool known = std::any_of(all.begin(), all.end(), [&](const CameraAdvice& advice) {
      return same_camera(advice.camera, pair.camera);
    });
    if (!known) all.push_back(advice_for(pair.camera, pairs));
  }
  return all;
}

}  // namespace cli
