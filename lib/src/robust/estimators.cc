#include "robust/estimators.h"

#include <cmath>

#include "geometry/fundamental_7pt.h"
#include "geometry/fundamental_8pt.h"
#include "geometry/homography_4pt.h"
#include "geometry/rotation_2pt.h"
#include "robust/refine.h"

namespace tv {
namespace {

inline int64_t quantised(double q) { return q < 1 ? static_cast<int64_t>(q * kCostOne) : kCostOne; }

template <int kCount>
void gather(const RayPairs& pairs, const int32_t* sample, Vec3* rays0, Vec3* rays1) {
  for (int k = 0; k < kCount; ++k) {
    rays0[k] = ray_of(pairs, 0, sample[k]);
    rays1[k] = ray_of(pairs, 1, sample[k]);
  }
}

}  // namespace

namespace {

// Calls use(i, r^2) for the first `count` matches.
template <typename Use>
void for_each_square(const RayPairs& pairs, int count, const Mat3& M, Use use) {
  constexpr int kChunk = 64;
  double squares[kChunk];
  for (int first = 0; first < count; first += kChunk) {
    const int some = count - first < kChunk ? count - first : kChunk;
    sampson_squares(pairs, first, some, M, squares);
    for (int k = 0; k < some; ++k) use(first + k, squares[k]);
  }
}

// Calls use(i, r^2) for a pose; r^2 is infinite for a match that lies behind a camera by more than
// the threshold.
template <typename Use>
void for_each_square(const RayPairs& pairs, int count, const Pose& pose, double threshold_px,
                     Use use) {
  constexpr int kChunk = 64;
  double squares[kChunk];
  for (int first = 0; first < count; first += kChunk) {
    const int some = count - first < kChunk ? count - first : kChunk;
    pose_squares(pairs, first, some, pose, threshold_px, squares);
    for (int k = 0; k < some; ++k) use(first + k, squares[k]);
  }
}

}  // namespace

int near_matches(const RayPairs& pairs, int count, const Mat3& M, double limit_px,
                 int32_t* indices) {
  const double limit_sq = limit_px * limit_px;
  int near = 0;
  for_each_square(pairs, count, M, [&](int i, double r_sq) {
    if (r_sq <= limit_sq) indices[near++] = i;
  });
  return near;
}

int near_matches(const RayPairs& pairs, int count, const Pose& pose, double limit_px,
                 double threshold_px, int32_t* indices) {
  const double limit_sq = limit_px * limit_px;
  int near = 0;
  for_each_square(pairs, count, pose, threshold_px, [&](int i, double r_sq) {
    if (r_sq <= limit_sq) indices[near++] = i;
  });
  return near;
}

bool pose_from_essential(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& E,
                         double threshold_px, bool strict, Pose* pose) {
  Mat3 R[2];
  Vec3 t;
  if (!decompose_essential(E, R, &t)) return false;
  // Each rotation with +t and with -t: the second's depths are the negatives of the first's.
  int votes[4] = {}, signs[4] = {}, behind[4] = {};
  for (int r = 0; r < 2; ++r) {
    const Pose candidate{R[r], t};
    for (int k = 0; k < count; ++k) {
      const int i = indices[k];
      const DepthSigns d = depth_signs(candidate, ray_of(pairs, 0, i), ray_of(pairs, 1, i),
                                       threshold_px * pairs.pixel_angle[i]);
      const DepthSigns opposite{-d.depth0, -d.depth1, d.tolerance0_sq, d.tolerance1_sq};
      const int vote = depth_vote(d), opposite_vote = depth_vote(opposite);
      votes[2 * r] += vote;
      votes[2 * r + 1] += opposite_vote;
      behind[2 * r] += vote < 0;
      behind[2 * r + 1] += opposite_vote < 0;
      signs[2 * r] += (d.depth0 > 0) + (d.depth1 > 0);
      signs[2 * r + 1] += (d.depth0 < 0) + (d.depth1 < 0);
      if (strict && behind[2 * r] > 0 && behind[2 * r + 1] > 0) break;
    }
  }
  int best = 0;
  for (int c = 1; c < 4; ++c) {
    if (strict ? behind[c] < behind[best] || (behind[c] == behind[best] && signs[c] > signs[best])
               : votes[c] > votes[best] || (votes[c] == votes[best] && signs[c] > signs[best])) {
      best = c;
    }
  }
  if (strict && behind[best] > 0) return false;
  *pose = Pose{orthonormalised(R[best / 2]), best % 2 == 0 ? t : Vec3(-t)};
  return true;
}

void PoseEstimator::generate(const int32_t samples[][5], int num_samples) const {
  for (int s = 0; s < kSamples5; ++s) {
    Vec3 rays0[5], rays1[5];
    gather<5>(pairs, samples[s < num_samples ? s : 0], rays0, rays1);
    set_sample(&batch->rays, s, rays0, rays1);
  }
  relpose_5pt(*pairs.kernels, batch->rays, num_samples, &batch->models);
}

int64_t PoseEstimator::fast_cost(int s, int k, int64_t bound) const {
  return msac_cost_fast(pairs, batch->models.matrix(s, k), threshold_px, bound);
}

int64_t PoseEstimator::fast_cost(const Pose& model, int64_t bound) const {
  return msac_cost_fast(pairs, essential_from_pose(model), threshold_px, bound);
}

bool PoseEstimator::complete(int s, int k, const int32_t* sample, Pose* pose) const {
  const Mat3 E = batch->models.matrix(s, k);
  return pose_from_essential(pairs, sample, 5, E, threshold_px, true, pose);
}

int64_t PoseEstimator::full_cost(const Pose& model, int* num_inliers) const {
  const double inverse_sq = 1 / (threshold_px * threshold_px);
  int64_t cost = 0;
  int inliers = 0;
  for_each_square(pairs, pairs.num, model, threshold_px, [&](int, double r_sq) {
    const bool inlier = r_sq <= threshold_px * threshold_px;
    inliers += inlier;
    cost += inlier ? quantised(r_sq * inverse_sq) : kCostOne;
  });
  *num_inliers = inliers;
  return cost;
}

void PoseEstimator::refine_model(Pose* model) const {
  int count = near_matches(pairs, pairs.num, *model, kNear * threshold_px, threshold_px, indices);
  if (count > kMostLocal) {
    for (int k = 0; k < kMostLocal; ++k) {
      indices[k] = indices[static_cast<int64_t>(k) * count / kMostLocal];
    }
    count = kMostLocal;
  }
  PoseModel refined{*model};
  refine(pairs, indices, count, RobustLoss{Loss::kTruncated, threshold_px}, kLocalIterations,
         &refined, kLocalGain);
  *model = refined.pose;
}

template <int kPoints>
int FundamentalEstimator<kPoints>::generate_models(const int32_t* sample, Mat3* models) const {
  Vec3 rays0[kPoints], rays1[kPoints];
  gather<kPoints>(pairs, sample, rays0, rays1);
  if constexpr (kPoints == 7) {
    return fundamental_7pt(rays0, rays1, models);
  } else {
    return fundamental_8pt(rays0, rays1, models) ? 1 : 0;
  }
}

template <int kPoints>
int64_t FundamentalEstimator<kPoints>::fast_cost(const Mat3& model, int64_t bound) const {
  return msac_cost_fast(pairs, model, threshold_px, bound);
}

template <int kPoints>
int64_t FundamentalEstimator<kPoints>::full_cost(const Mat3& model, int* num_inliers) const {
  const double inverse_sq = 1 / (threshold_px * threshold_px);
  int64_t cost = 0;
  int inliers = 0;
  for_each_square(pairs, pairs.num, model, [&](int, double r_sq) {
    const double q = r_sq * inverse_sq;
    inliers += q <= 1;
    cost += quantised(q);
  });
  *num_inliers = inliers;
  return cost;
}

template <int kPoints>
void FundamentalEstimator<kPoints>::refine_model(Mat3* model) const {
  const int count = near_matches(pairs, pairs.num, *model, kNear * threshold_px, indices);
  FundamentalModel refined = fundamental_model(*model);
  refine(pairs, indices, count, RobustLoss{Loss::kTruncated, threshold_px}, kLocalIterations,
         &refined, kLocalGain);
  *model = refined.matrix().normalized();
}

template struct FundamentalEstimator<7>;
template struct FundamentalEstimator<8>;

int64_t TransferEstimator::cost(const Mat3& H, int64_t bound, int* num_inliers) const {
  constexpr int kChunk = 64;
  const double inverse_sq = 1 / (threshold_px * threshold_px);
  double squares[kChunk];
  int64_t sum = 0;
  int inliers = 0;
  for (int first = 0; first < num_subset && sum <= bound; first += kChunk) {
    const int some = num_subset - first < kChunk ? num_subset - first : kChunk;
    transfer_squares(pairs, subset + first, some, H, squares);
    for (int k = 0; k < some; ++k) {
      const double q = squares[k] * inverse_sq;
      inliers += q <= 1;
      sum += quantised(q);
    }
  }
  if (num_inliers != nullptr) *num_inliers = inliers;
  return sum;
}

int HomographyEstimator::generate_models(const int32_t* sample, Mat3* models) const {
  int32_t chosen[4];
  for (int k = 0; k < 4; ++k) chosen[k] = subset[sample[k]];
  Vec3 rays0[4], rays1[4];
  gather<4>(pairs, chosen, rays0, rays1);
  return homography_4pt(rays0, rays1, models) ? 1 : 0;
}

void HomographyEstimator::refine_model(Mat3* model) const {
  HomographyModel refined{*model};
  refine(pairs, subset, num_subset, RobustLoss{Loss::kTruncated, threshold_px}, kLocalIterations,
         &refined, kLocalGain);
  *model = refined.H;
}

int RotationEstimator::generate_models(const int32_t* sample, Mat3* models) const {
  const int32_t chosen[2] = {subset[sample[0]], subset[sample[1]]};
  Vec3 rays0[2], rays1[2];
  gather<2>(pairs, chosen, rays0, rays1);
  return rotation_2pt(rays0, rays1, models) ? 1 : 0;
}

void RotationEstimator::refine_model(Mat3* model) const {
  RotationModel refined{*model};
  refine(pairs, subset, num_subset, RobustLoss{Loss::kTruncated, threshold_px}, kLocalIterations,
         &refined, kLocalGain);
  *model = refined.R;
}

}  // namespace tv
