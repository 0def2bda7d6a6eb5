#include "pose/absolute_search.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "base/random.h"
#include "pose/absolute_pose_3pt.h"
#include "pose/reprojection.h"
#include "robust/chance.h"
#include "robust/loop.h"

namespace tv {
namespace {

// The least number of samples, and that number times the inliers where inliers are few.
constexpr int kMinIterations = 20, kFewInliersIterations = 1000;

struct AbsoluteEstimator {
  using Model = Pose;
  static constexpr int kSampleSize = 3;
  static constexpr int kMaxModels = kMaxAbsolutePose3pt;
  static constexpr int kBatch = 1;
  const Sightings& sightings;
  double threshold_px;
  int32_t* indices;  // scratch, one entry a match

  int generate_models(const int32_t* sample, Pose* poses) const {
    double rays[3][3], points[3][3];
    for (int k = 0; k < 3; ++k) {
      const Sighting& sighting = sightings.all[sample[k]];
      unit_ray(sighting, rays[k]);
      for (int d = 0; d < 3; ++d) points[k][d] = sighting.point[d];
    }
    return absolute_pose_3pt(rays, points, poses);
  }
  int64_t fast_cost(const Pose& pose, int64_t bound) const {
    return reprojection_cost(sightings, pose, threshold_px, bound);
  }
  int64_t full_cost(const Pose& pose, int* num_inliers) const {
    const double inverse_sq = 1 / (threshold_px * threshold_px);
    int64_t cost = 0;
    *num_inliers = 0;
    for (int i = 0; i < sightings.num; ++i) {
      const double q = reprojection_sq(sightings.all[i], pose) * inverse_sq;
      *num_inliers += q <= 1;
      cost += q < 1 ? static_cast<int64_t>(q * kSightingCost) : kSightingCost;
    }
    return cost;
  }
  void refine_model(Pose* pose) const {
    int count = near_sightings(sightings, *pose, kNear * threshold_px, indices);
    if (count > kMostLocal) {
      for (int k = 0; k < kMostLocal; ++k) {
        indices[k] = indices[static_cast<int64_t>(k) * count / kMostLocal];
      }
      count = kMostLocal;
    }
    const PoseProblem problem{nullptr, sightings, indices, count, threshold_px, {}, 0};
    refine_absolute(problem, kLocalIterations, kLocalGain, pose, nullptr);
  }
};

// The probability that a wrong match agrees with the pose: by pairings of points with the pixels of
// other matches, and by the share of the image that the threshold's disc covers (robust/chance.h).
double chance_of_sighting(const SightingInput& input, const Sightings& s, const Pose& pose,
                          double threshold_px, uint64_t seed) {
  constexpr int kPairings = 512;
  const int n = s.num;
  if (n < 2) return 1;
  double sigmas_sq = 0;
  for (int k = 0; k < n; ++k) {
    const double sigma = input.sigma(s.order[k]);
    sigmas_sq += sigma * sigma / n;
  }
  const tv_camera& camera = input.camera.model;
  const double area = static_cast<double>(camera.width) * camera.height;
  const double prior = std::min(1.0, kPi * threshold_px * threshold_px * sigmas_sq / area);
  Random random = random_seeded(seed);
  int agreeing = 0;
  for (int k = 0; k < kPairings; ++k) {
    const WrongMatch drawn = draw_wrong_match(random, n);
    Sighting wrong = s.all[drawn.second];
    std::copy_n(s.all[drawn.first].point, 3, wrong.point);
    agreeing += reprojection_sq(wrong, pose) <= threshold_px * threshold_px;
  }
  return chance_from_pairings(agreeing, kPairings, kPairings, n, prior);
}

}  // namespace

int near_sightings(const Sightings& s, const Pose& pose, double limit_px, int32_t* indices) {
  int near = 0;
  for (int i = 0; i < s.num; ++i) {
    if (reprojection_sq(s.all[i], pose) <= limit_px * limit_px) indices[near++] = i;
  }
  return near;
}

void search_absolute_pose(const Sightings& sightings, const tv_absolute_pose_options& options,
                          bool progressive, Arena& arena, AbsolutePoseSearch* search) {
  if (sightings.num < AbsoluteEstimator::kSampleSize) return;
  ArenaScope scope(arena);
  int32_t* indices = arena_alloc<int32_t>(arena, static_cast<size_t>(sightings.num));
  AbsoluteEstimator estimator{sightings, options.max_error_px, indices};
  Sampler sampler =
      make_sampler(options.seed, sightings.num, AbsoluteEstimator::kSampleSize, progressive);
  // Few matches have few different samples. With this many draws, all samples of the four inliers
  // are missed once in 50 times.
  const double n = sightings.num, different = n * (n - 1) * (n - 2) / 6;
  const int most =
      different < options.max_iterations ? static_cast<int>(different) : options.max_iterations;
  const LoopOptions loop{options.confidence, kMinIterations, most, options.fixed_iterations,
                         kFewInliersIterations};
  const LoopResult<Pose> result = robust_loop(estimator, sampler, loop);
  search->found = result.found;
  search->num_iterations = result.num_iterations;
  if (result.found) search->pose = result.model;
}

bool is_meaningful(const SightingInput& input, const Sightings& s, const Pose& pose,
                   int num_inliers, const tv_absolute_pose_options& options) {
  if (num_inliers <= AbsoluteEstimator::kSampleSize) return false;
  const double chance = chance_of_sighting(input, s, pose, options.max_error_px, options.seed);
  return log_false_alarms(s.num, num_inliers, AbsoluteEstimator::kSampleSize, kMaxAbsolutePose3pt,
                          chance) < kLogMeaningful;
}

}  // namespace tv
