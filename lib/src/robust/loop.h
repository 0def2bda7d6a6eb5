// The robust loop: sample, solve, score, optimise locally, stop when a better model is unlikely.
//
// An estimator is a struct with
//   Model, kSampleSize, kMaxModels
//   int generate_models(const int32_t* sample, Model* models)
//   int64_t fast_cost(const Model&, int64_t bound)   MSAC cost; above bound, anything above it
//   int64_t full_cost(const Model&, int* num_inliers)  with all the checks a pose must pass
//   void refine_model(Model*)                         local optimisation on the model's inliers
#pragma once

#include <cstdint>

#include "base/math.h"
#include "robust/sampler.h"

namespace tv {

struct LoopOptions {
  double confidence;
  int min_iterations, max_iterations;
  int fixed_iterations;  // 0: adaptive stop
};

template <typename Model>
struct LoopResult {
  bool found = false;
  Model model;  // when found
  int64_t cost = INT64_MAX;
  int num_inliers = 0;
  int num_iterations = 0;
};

// Samples after which a sample of inliers alone has been drawn with the given confidence.
inline int samples_needed(double confidence, int num_inliers, int num, int sample_size, int most) {
  double good = 1;  // that one sample is of inliers alone, drawn without replacement
  for (int k = 0; k < sample_size; ++k) {
    if (num_inliers <= k) return most;
    good *= static_cast<double>(num_inliers - k) / static_cast<double>(num - k);
  }
  if (good >= 1) return 1;
  if (!(good > 1e-12)) return most;
  const double needed = log(1 - confidence) / log(1 - good);
  return needed < most ? static_cast<int>(needed) + 1 : most;
}

template <typename Estimator>
LoopResult<typename Estimator::Model> robust_loop(Estimator& estimator, Sampler& sampler,
                                                  const LoopOptions& options) {
  using Model = typename Estimator::Model;
  LoopResult<Model> best;
  int64_t best_sampled = INT64_MAX;  // before local optimisation
  const bool fixed = options.fixed_iterations > 0;
  const int most = fixed ? options.fixed_iterations : options.max_iterations;
  int wanted = most;
  int32_t sample[Estimator::kSampleSize];
  Model models[Estimator::kMaxModels];
  while (best.num_iterations < wanted) {
    draw_sample(sampler, sample);
    ++best.num_iterations;
    const int num_models = estimator.generate_models(sample, models);
    int winner = -1;
    for (int k = 0; k < num_models; ++k) {
      if (estimator.fast_cost(models[k], best_sampled) >= best_sampled) continue;
      int num_inliers;
      const int64_t cost = estimator.full_cost(models[k], &num_inliers);
      if (cost >= best_sampled) continue;
      best_sampled = cost;
      winner = k;
      if (cost < best.cost) {
        best.found = true;
        best.model = models[k];
        best.cost = cost;
        best.num_inliers = num_inliers;
      }
    }
    if (winner < 0) continue;
    Model refined = models[winner];
    estimator.refine_model(&refined);
    int num_inliers;
    const int64_t cost = estimator.full_cost(refined, &num_inliers);
    if (cost < best.cost) {
      best.model = refined;
      best.cost = cost;
      best.num_inliers = num_inliers;
    }
    if (fixed) continue;
    wanted = samples_needed(options.confidence, best.num_inliers, sampler.num,
                            Estimator::kSampleSize, most);
    if (wanted < options.min_iterations) wanted = options.min_iterations;
    if (wanted > most) wanted = most;
  }
  return best;
}

}  // namespace tv
