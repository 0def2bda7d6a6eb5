#include "robust/second_model.h"

#include <algorithm>
#include <cmath>

#include "robust/chance.h"
#include "robust/loop.h"

namespace tv {
namespace {

// With these numbers of samples, a model with just as many inliers as are required is missed once
// in twenty pairs, and one with 20 % more once in a hundred. A model whose inliers are a third of
// the searched matches is missed once in five pairs, because kMostSamples ends the search.
constexpr int kMostSamples = 400;
constexpr double kConfidence = 0.95;
constexpr int kFewestInliers = 12;
constexpr int kMaxLeft = 512;  // if more matches remain, this many, evenly spaced, are searched

// Copies the listed matches alone. The list becomes their order.
Matches gathered(const Matches& matches, int32_t* listed, int count, Arena& arena) {
  Matches part = matches;
  part.pairs = alloc_ray_pairs(arena, count, matches.pairs.on_plane);
  part.pairs.num = part.num_all = count;
  part.pairs.kernels = matches.pairs.kernels;
  for (int v = 0; v < 2; ++v) {
    for (int k = 0; k < count; ++k) {
      set_ray(part.pairs, v, k, ray_of(matches.pairs, v, listed[k]),
              jacobian_of(matches.pairs, v, listed[k]));
    }
  }
  finish_rays(part.pairs, part.num_all);
  for (int k = 0; k < count; ++k) listed[k] = matches.order[listed[k]];
  part.order = listed;
  return part;
}

}  // namespace

size_t second_model_bytes(int max_matches) {
  const int most = max_matches < kMaxLeft ? max_matches : kMaxLeft;
  return 2 * arena_bytes<int32_t>(static_cast<size_t>(most)) + ray_pairs_bytes(most) +
         arena_bytes<PoseBatch>(1);
}

SecondModel find_second_model(const Matches& matches, const uint8_t* explained, int num_first,
                              double threshold_px, uint64_t seed, Arena& arena) {
  SecondModel second;
  int left = 0;
  for (int i = 0; i < matches.num_unique(); ++i) left += explained[i] == 0;
  if (left < kFewestInliers || left < kSecondShare * num_first) return second;
  ArenaScope scope(arena);
  const int count = left < kMaxLeft ? left : kMaxLeft;
  int32_t* listed = arena_alloc<int32_t>(arena, static_cast<size_t>(count));
  int taken = 0;
  for (int i = 0, seen = 0; i < matches.num_unique(); ++i) {
    if (explained[i] != 0) continue;
    if (static_cast<int64_t>(seen) * count / left == taken) listed[taken++] = i;
    ++seen;
    if (taken == count) break;
  }
  const Matches part = gathered(matches, listed, taken, arena);
  int32_t* indices = arena_alloc<int32_t>(arena, static_cast<size_t>(taken));
  PoseEstimator estimator{part.pairs, threshold_px, indices, arena_alloc<PoseBatch>(arena, 1)};
  Sampler sampler = make_sampler(seed, taken, PoseEstimator::kSampleSize, false);
  // The number of samples is chosen for a model with just as many inliers as are required below.
  const double fewest = std::max<double>(kFewestInliers, kSecondShare * num_first * taken / left);
  const int most = samples_needed(kConfidence, static_cast<int>(fewest), taken,
                                  PoseEstimator::kSampleSize, kMostSamples);
  const LoopOptions options{kConfidence, 5, most, 0, 0, static_cast<int>(fewest / 2)};
  const LoopResult<Pose> result = robust_loop(estimator, sampler, options);
  if (!result.found || result.num_inliers < kFewestInliers) return second;
  const double of_all = static_cast<double>(result.num_inliers) * left / taken;
  if (of_all < kSecondShare * num_first) return second;
  const double limit = meaningful_chance(taken, result.num_inliers, 5, 10);
  const Mat3 M = essential_from_pose(result.model);
  if (!(chance_of_agreement(part, M, threshold_px, seed, limit) < limit)) return second;
  second.found = true;
  second.pose = result.model;
  second.num_inliers = static_cast<int>(of_all);
  return second;
}

}  // namespace tv
