#include "odometry/frame_pair.h"

#include <algorithm>
#include <cmath>

#include "odometry/still_cells.h"

namespace tv {
namespace {

constexpr int32_t kLeastMatches = 30;
constexpr int32_t kMostIterations = 2000;

}  // namespace

tv_features as_features(const tv_keypoint* keypoints, const uint8_t* descriptors, int32_t num) {
  tv_features features;
  tv_features_init(&features);
  features.num = num;
  features.keypoints = keypoints;
  features.descriptors = descriptors;
  return features;
}

tv_features features_of(const Map& map, const MapKeyframe& keyframe, tv_keypoint* keypoints) {
  const MapKeypoint* own = keypoints_of(map, keyframe);
  for (int32_t k = 0; k < keyframe.num_keypoints; ++k) {
    keypoints[k] = tv_keypoint{own[k].x, own[k].y, own[k].size, 0, 1, 0};
  }
  return as_features(keypoints, descriptors_of(map, keyframe), keyframe.num_keypoints);
}

bool estimate_pair(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                   const tv_correspondence* matches, int32_t num, Pair* pair) {
  Arena& arena = odometry->scratch;
  const size_t n = static_cast<size_t>(std::max(num, 1));
  double* pixels0 = arena_alloc<double>(arena, 2 * n);
  double* pixels1 = arena_alloc<double>(arena, 2 * n);
  float* ratios = arena_alloc<float>(arena, n);
  float* sigmas0 = arena_alloc<float>(arena, n);
  float* sigmas1 = arena_alloc<float>(arena, n);
  pair->matches = matches;
  pair->num = num;
  pair->is_inlier = arena_alloc<uint8_t>(arena, n);
  pair->view = arena_alloc<tv_two_view>(arena, 1);
  *pair->view = tv_two_view{};
  pair->evidence = arena_alloc<tv_evidence>(arena, 1);
  if (num < kLeastMatches) return false;
  for (int32_t k = 0; k < num; ++k) {
    const tv_keypoint& a = keypoints0[matches[k].idx0];
    const tv_keypoint& b = keypoints1[matches[k].idx1];
    pixels0[2 * k] = static_cast<double>(a.x);
    pixels0[2 * k + 1] = static_cast<double>(a.y);
    pixels1[2 * k] = static_cast<double>(b.x);
    pixels1[2 * k + 1] = static_cast<double>(b.y);
    ratios[k] = matches[k].ratio;
    sigmas0[k] = a.size / kFinestSize;
    sigmas1[k] = b.size / kFinestSize;
  }
  tv_pixel_pairs pairs;
  tv_pixel_pairs_init(&pairs);
  pairs.num = num;
  pairs.pixels0 = pixels0;
  pairs.pixels1 = pixels1;
  pairs.ratios = ratios;
  pairs.sigmas0 = sigmas0;
  pairs.sigmas1 = sigmas1;
  tv_estimate_options options;
  tv_estimate_options_init(&options);
  options.seed = odometry->options.seed;
  options.max_iterations = kMostIterations;
  options.readout_turn_sigma_rad = 0;  // frames confirm each other
  tv_two_view_init(pair->view);
  tv_evidence_init(pair->evidence);
  if (tv_estimate_two_view(odometry->context, &odometry->camera.model, &odometry->camera.model,
                           &pairs, &options, pair->view, pair->evidence,
                           pair->is_inlier) != TV_OK) {
    return false;
  }
  if (pair->view->num_still > 0) mark_still(odometry, keypoints0, keypoints1, matches, num);
  return true;
}

double turn_sigma_of(const double* covariance, int num_parameters) {
  const int next = num_parameters + 1;  // variance on the diagonal
  return std::sqrt(std::max(std::max(covariance[0], covariance[next]), covariance[2 * next]));
}

}  // namespace tv
