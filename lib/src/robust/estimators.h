// The models that the robust loop (loop.h) estimates, the matches that are near a model, and the
// pose of an essential matrix.
#pragma once

#include "geometry/relpose_5pt.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/loop.h"
#include "robust/matches.h"
#include "robust/models.h"

namespace tv {

// The samples that PoseEstimator solves at once, and their models: 7.7 KB, in the arena to save
// stack.
struct PoseBatch {
  Samples5 rays;
  Essentials models;
};

// Estimates a pose from samples of five matches.
struct PoseEstimator {
  using Model = Pose;
  static constexpr int kSampleSize = 5;
  static constexpr int kMaxModels = kMaxRelpose5pt;
  static constexpr int kBatch = kSamples5;
  const RayPairs& pairs;  // the matches that take part
  double threshold_px;
  int32_t* indices;  // scratch, one entry a match
  PoseBatch* batch;  // scratch; null where no samples are solved
  void generate(const int32_t samples[][5], int num_samples) const;
  int count(int s) const { return batch->models.count[s]; }
  int64_t fast_cost(int s, int k, int64_t bound) const;
  int64_t fast_cost(const Pose& model, int64_t bound) const;
  bool complete(int s, int k, const int32_t* sample, Pose* pose) const;
  int64_t full_cost(const Model& model, int* num_inliers) const;
  void refine_model(Model* model) const;
};

// Estimates a fundamental matrix (on rays) from samples of eight or seven matches.
template <int kPoints>
struct FundamentalEstimator {
  using Model = Mat3;
  static constexpr int kSampleSize = kPoints;
  static constexpr int kMaxModels = kPoints == 7 ? 3 : 1;
  static constexpr int kBatch = 1;
  const RayPairs& pairs;
  double threshold_px;
  int32_t* indices;
  int generate_models(const int32_t* sample, Model* models) const;
  int64_t fast_cost(const Model& model, int64_t bound) const;
  int64_t full_cost(const Model& model, int* num_inliers) const;
  void refine_model(Model* model) const;
};

// A residual in two dimensions has its threshold at the same quantile as the epipolar one: at 95
// per cent chi-square is 3.84 with one degree of freedom, 5.99 with two.
inline constexpr double kTransferThresholdScale = 1.2489995996796797;  // sqrt(5.99 / 3.84)

// A match farther than this from a model, in thresholds, is clearly off it.
inline constexpr double kClearlyOff = 3;

// A homography from four rays, a rotation from two; over the listed matches only.
struct TransferEstimator {
  const RayPairs& pairs;
  double threshold_px;
  const int32_t* subset;
  int num_subset;
  int64_t cost(const Mat3& H, int64_t bound, int* num_inliers) const;
};

struct HomographyEstimator : TransferEstimator {
  using Model = Mat3;
  static constexpr int kSampleSize = 4;
  static constexpr int kMaxModels = 1;
  static constexpr int kBatch = 1;
  int generate_models(const int32_t* sample, Model* models) const;
  int64_t fast_cost(const Model& model, int64_t bound) const { return cost(model, bound, nullptr); }
  int64_t full_cost(const Model& model, int* num_inliers) const {
    return cost(model, INT64_MAX, num_inliers);
  }
  void refine_model(Model* model) const;
};

struct RotationEstimator : TransferEstimator {
  using Model = Mat3;
  static constexpr int kSampleSize = 2;
  static constexpr int kMaxModels = 1;
  static constexpr int kBatch = 1;
  int generate_models(const int32_t* sample, Model* models) const;
  int64_t fast_cost(const Model& model, int64_t bound) const { return cost(model, bound, nullptr); }
  int64_t full_cost(const Model& model, int* num_inliers) const {
    return cost(model, INT64_MAX, num_inliers);
  }
  void refine_model(Model* model) const;
};

// Matches among the first `count` whose Sampson distance is below limit_px. Returns how many.
int near_matches(const RayPairs& pairs, int count, const Mat3& M, double limit_px,
                 int32_t* indices);

// Like near_matches above, for a pose. Matches whose point lies behind a camera by more than
// threshold_px of parallax are left out.
int near_matches(const RayPairs& pairs, int count, const Pose& pose, double limit_px,
                 double threshold_px, int32_t* indices);

// The pose of an essential matrix that puts most of the listed matches in front of both cameras;
// False when E is zero or not finite, or when `strict` is set and a listed match is clearly behind
// a camera.
bool pose_from_essential(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& E,
                         double threshold_px, bool strict, Pose* pose);

}  // namespace tv
