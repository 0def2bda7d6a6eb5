#include "robust/rivals.h"

#include <algorithm>

#include "geometry/camera.h"
#include "geometry/homography_4pt.h"
#include "geometry/transfer.h"
#include "robust/loop.h"

namespace tv {
namespace {

constexpr int kChunk = 64;  // matches that are handled at a time, on the stack

// Few samples suffice, since only a rival that explains most of the support matters, and few
// matches suffice to compare models. A model that explains least_share of them is missed once in
// ten thousand pairs.
constexpr double kRivalConfidence = 0.9999;
constexpr int kMostRivalSamples = 200;
constexpr int kMaxSubset = 64;

struct Best {
  bool found = false;
  Mat3 model = Mat3::Zero();
};

template <typename Estimator>
Best search(Estimator estimator, const int32_t* support, int num_support, double least_share,
            uint64_t seed) {
  if (num_support < Estimator::kSampleSize) return {};
  Sampler sampler = make_sampler(seed, estimator.num_subset, Estimator::kSampleSize, false);
  const int least = static_cast<int>(least_share * estimator.num_subset);
  const int most = samples_needed(kRivalConfidence, least, estimator.num_subset,
                                  Estimator::kSampleSize, kMostRivalSamples);
  const LoopOptions options{0.999, 5, most, 0, 0, least / 2};
  const LoopResult<Mat3> result = robust_loop(estimator, sampler, options);
  if (!result.found) return {};
  Best best{true, result.model};
  if (result.num_inliers < least / 2) return best;
  estimator.subset = support;
  estimator.num_subset = num_support;
  estimator.refine_model(&best.model);
  return best;
}

int count_inliers(const RayPairs& pairs, int count, const Mat3& H, double threshold_px) {
  double squares[kChunk];
  int inliers = 0;
  for (int first = 0; first < count; first += kChunk) {
    const int some = std::min(kChunk, count - first);
    transfer_squares(pairs, first, some, H, squares);
    for (int k = 0; k < some; ++k) inliers += squares[k] <= threshold_px * threshold_px;
  }
  return inliers;
}

}  // namespace

size_t rivals_bytes(int max_matches) {
  return arena_bytes<int32_t>(kMaxSubset) + arena_bytes<uint8_t>(static_cast<size_t>(max_matches));
}

Rivals find_rivals(const Matches& matches, const int32_t* support, int num_support, bool calibrated,
                   double least_share, double threshold_px, uint64_t seed, Arena& arena) {
  ArenaScope scope(arena);
  int32_t* subset = arena_alloc<int32_t>(arena, kMaxSubset);
  const int num_subset = num_support < kMaxSubset ? num_support : kMaxSubset;
  for (int k = 0; k < num_subset; ++k) {
    subset[k] = support[static_cast<int64_t>(k) * num_support / num_subset];
  }
  const double limit = kTransferThresholdScale * threshold_px;
  const TransferEstimator base{matches.pairs, limit, subset, num_subset};
  const int n = matches.num_unique();
  Rivals rivals{};
  rivals.rotation_inliers = rivals.homography_inliers = -1;
  if (calibrated) {
    const Best rotation = search(RotationEstimator{base}, support, num_support, least_share, seed);
    rivals.has_rotation = rotation.found;
    if (rotation.found) {
      rivals.R = rotation.model;
      rivals.rotation_inliers = count_inliers(matches.pairs, n, rivals.R, limit);
    }
  }
  const Best homography =
      search(HomographyEstimator{base}, support, num_support, least_share, seed);
  rivals.has_homography = homography.found;
  if (homography.found) {
    rivals.H = homography.model;
    rivals.homography_inliers = count_inliers(matches.pairs, n, rivals.H, limit);
  }
  // The model of no motion: the identity on rays, or, without cameras, the same pixel in both
  // images.
  const Mat3 identity =
      calibrated ? Mat3::Identity()
                 : Mat3(inverse_intrinsics(matches.intrinsics[1]) * matches.intrinsics[0]);
  rivals.identity_inliers = count_inliers(matches.pairs, n, identity, limit);
  return rivals;
}

}  // namespace tv
