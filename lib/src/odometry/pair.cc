#include "odometry/pair.h"

#include <algorithm>
#include <cmath>

namespace tv {
namespace {

constexpr int32_t kLeastMatches = 30;
constexpr int32_t kMostIterations = 2000;
constexpr int32_t kMostPairs = 3;  // that a keyframe is checked with
// A map contradicts a pair whose turns differ by more than three standard deviations of the pair's
// and this angle, in radians. Measured: docs/odometry.md.
constexpr double kTurnSigmas = 3, kTurnAllowed = 0.026;

}  // namespace

size_t pair_bytes(const tv_odometry_options& options) {
  const size_t n = static_cast<size_t>(options.max_keypoints);
  return 2 * arena_bytes<double>(2 * n) + 3 * arena_bytes<float>(n) + arena_bytes<uint8_t>(n) +
         arena_bytes<tv_two_view>(1);
}

tv_features as_features(const tv_keypoint* keypoints, const uint8_t* descriptors, int32_t num) {
  tv_features features;
  tv_features_init(&features);
  features.num = num;
  features.keypoints = keypoints;
  features.descriptors = descriptors;
  return features;
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
  tv_two_view_init(pair->view);
  return tv_estimate_two_view(odometry->context, &odometry->camera.model, &odometry->camera.model,
                              &pairs, &options, pair->view, pair->is_inlier) == TV_OK;
}

void add_vote(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
              const tv_correspondence* matches, int32_t num, const Rigid& cam1_from_cam0,
              MapVote* vote) {
  ArenaScope scope(odometry->scratch);
  Pair pair;
  ++vote->num_pairs;
  if (!estimate_pair(odometry, keypoints0, keypoints1, matches, num, &pair)) return;
  const tv_two_view& view = *pair.view;
  if (view.verdict == TV_VERDICT_DOUBTFUL && (view.reasons & TV_REASON_TWO_PLANAR_SOLUTIONS) != 0) {
    ++vote->num_planar;
  }
  if (view.verdict != TV_VERDICT_OK || !view.has_R || !view.has_covariance) return;
  Rigid turn = kIdentity, map_turn = cam1_from_cam0;
  std::copy_n(view.R, 9, turn.R);
  std::fill(map_turn.t, map_turn.t + 3, 0.0);
  // The variances of the rotation vector: elements 0, 6 and 12 of the 5x5 covariance.
  const double* c = view.covariance;
  const double sigma = std::sqrt(std::max({c[0], c[6], c[12]}));
  const double difference = rotation_angle(compose(turn, inverse(map_turn)));
  if (difference <= kTurnSigmas * sigma + kTurnAllowed)
    ++vote->num_agree;
  else
    ++vote->num_disagree;
}

bool needs_vote(const MapVote& vote) {
  return vote.num_agree == 0 && vote.num_disagree < 2 && vote.num_pairs < kMostPairs;
}

MapCheck result_of(const MapVote& vote) {
  if (vote.num_agree > 0) return MapCheck::kAgrees;
  if (vote.num_disagree >= 2) return MapCheck::kContradicts;
  return 2 * vote.num_planar > vote.num_pairs ? MapCheck::kOnePlane : MapCheck::kUnknown;
}

}  // namespace tv
