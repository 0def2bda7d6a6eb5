#include "robust/verdict.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/loop.h"

namespace tv {
namespace {

constexpr double kInfinity = __builtin_inf();
constexpr int kChunk = 64;  // matches at a time, on the stack

// The rivals need few samples, since only one that explains most of the support matters, and few
// matches to be told apart. Of models that explain least_share, one in ten thousand is missed.
constexpr double kRivalConfidence = 0.9999;
constexpr int kMostRivalSamples = 200;
constexpr int kMaxSubset = 64;

double log_factorial(int n) {
  if (n < 16) {
    double product = 1;
    for (int k = 2; k <= n; ++k) product *= k;
    return log(product);
  }
  const double x = n;
  return (x + 0.5) * log(x) - x + 0.91893853320467274178 + 1 / (12 * x) - 1 / (360 * x * x * x);
}

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

// Whether a share of `agreeing` of `drawn` tells a probability from the limit: were it the limit's,
// the share would be as far away with probability exp(-kClear) at most (Chernoff's bound).
bool is_clear(int agreeing, int drawn, double limit) {
  constexpr double kClear = 25;
  if (drawn == 0 || !(limit > 0 && limit < 1)) return false;
  const double n = drawn, share = agreeing / n;
  double divergence = 0;
  if (agreeing > 0) divergence += share * log(share / limit);
  if (agreeing < drawn) divergence += (1 - share) * log((1 - share) / (1 - limit));
  return n * divergence > kClear;
}

// Points of view 0 with others of view 1, in the arrays' own form.
struct WrongPairs {
  double storage[18][kChunk];
  RayPairs arrays;

  explicit WrongPairs(const RayPairs& pairs) : arrays(pairs) {
    for (int k = 0; k < 18; ++k) array(k) = storage[k];
  }
  double*& array(int k) {  // the rays' entries, then the Jacobians'
    return k < 6 ? arrays.ray[k / 3][k % 3] : arrays.jacobian[k / 6 - 1][k % 6];
  }
  int count_agreeing(const RayPairs& pairs, const int listed[2][kChunk], const Mat3& M,
                     double threshold_px) {
    for (int v = 0; v < 2; ++v) {
      for (int k = 0; k < (pairs.on_plane ? 2 : 3); ++k) {
        for (int l = 0; l < kChunk; ++l) arrays.ray[v][k][l] = pairs.ray[v][k][listed[v][l]];
      }
      for (int k = 0; k < (pairs.on_plane ? 4 : 6); ++k) {
        for (int l = 0; l < kChunk; ++l) {
          arrays.jacobian[v][k][l] = pairs.jacobian[v][k][listed[v][l]];
        }
      }
    }
    double squares[kChunk];
    sampson_squares(arrays, 0, kChunk, M, squares);
    int agreeing = 0;
    for (double r_sq : squares) agreeing += r_sq <= threshold_px * threshold_px;
    return agreeing;
  }
};

}  // namespace

double log_binomial(int n, int k) {
  return log_factorial(n) - log_factorial(k) - log_factorial(n - k);
}

double log_false_alarms(int n, int k, int m, int models, double p) {
  if (k <= m) return kInfinity;
  return log(static_cast<double>(models) * (n - m)) + log_binomial(n, k) + log_binomial(k, m) +
         (k - m) * log(p);
}

double meaningful_chance(int n, int k, int m, int models) {
  return exp((kLogMeaningful - log(static_cast<double>(models) * (n - m)) - log_binomial(n, k) -
              log_binomial(k, m)) /
             (k - m));
}

double chance_of_agreement(const Matches& matches, const Mat3& M, double threshold_px,
                           uint64_t seed, double limit) {
  constexpr int kPairings = 1024;
  constexpr double kPriorWeight = 100;
  const RayPairs& pairs = matches.pairs;
  // A band of half width sqrt(2) T: Sampson's distance shares the error between the two images. Its
  // length is about the image's side.
  const double prior =
      std::min(1.0, 2.8284271247461903 * threshold_px / std::sqrt(matches.area_px));
  const int n = matches.num_unique;
  if (n < 2) return 1;
  Random random = random_seeded(seed);
  WrongPairs wrong(pairs);
  int agreeing = 0, drawn = 0;
  while (drawn < kPairings && !is_clear(agreeing, drawn, limit)) {
    int listed[2][kChunk];
    for (int k = 0; k < kChunk; ++k) {
      const int i = static_cast<int>(random_below(random, static_cast<uint32_t>(n)));
      const int j = static_cast<int>(random_below(random, static_cast<uint32_t>(n - 1)));
      listed[0][k] = i;
      listed[1][k] = j + (j >= i);
    }
    agreeing += wrong.count_agreeing(pairs, listed, M, threshold_px);
    drawn += kChunk;
  }
  // Of few matches there are fewer different pairings than were drawn.
  const double different = 0.5 * n * (n - 1.0);
  const double weight = different < kPairings ? different : kPairings;
  return (weight * agreeing / drawn + kPriorWeight * prior) / (weight + kPriorWeight);
}

size_t verdict_bytes(int max_matches) {
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
  const int n = matches.num_unique;
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
  // The same pixel in both images, whatever the camera; with two equal cameras the identity.
  const Mat3 K0 = matches.intrinsics[0], K1 = matches.intrinsics[1];
  Mat3 inverse;
  inverse << 1 / K1(0, 0), 0, -K1(0, 2) / K1(0, 0), 0, 1 / K1(1, 1), -K1(1, 2) / K1(1, 1), 0, 0, 1;
  const Mat3 identity = calibrated ? Mat3::Identity() : Mat3(inverse * K0);
  rivals.identity_inliers = count_inliers(matches.pairs, n, identity, limit);
  return rivals;
}

bool leaves_parallax(const Matches& matches, const Mat3& H, const uint8_t* inlier,
                     double threshold_px) {
  const double limit = kTransferThresholdScale * threshold_px;
  const double half_width = 1.4142135623730951 * threshold_px;
  int unexplained = 0, agreeing = 0;
  double expected = 0;
  for (int i = 0; i < matches.num_unique; ++i) {
    const TransferResidual residual = transfer_residual(matches.pairs, i, H);
    if (residual.r_sq <= limit * limit) continue;
    ++unexplained;
    agreeing += inlier[i] != 0;
    const double ratio = half_width * half_width / residual.d_sq;
    expected += ratio < 1 ? (2 / kPi) * asin(std::sqrt(ratio)) : 1.0;
  }
  if (unexplained < 3 || agreeing < 3) return false;
  const double n = unexplained, share = agreeing / n, chance = expected / n;
  if (share <= chance) return false;
  const double divergence =
      share * log(share / chance) +
      (agreeing < unexplained ? (1 - share) * log((1 - share) / (1 - chance)) : 0.0);
  // The epipole was chosen by the best two of them.
  return log_binomial(unexplained, 2) - n * divergence < kLogMeaningful;
}

}  // namespace tv
