// The robust loop: sample, solve, score, optimise locally, stop when a better model is unlikely.
//
// An estimator is a struct with
//   Model, kSampleSize, kMaxModels, kBatch
//   int64_t full_cost(const Model&, int* num_inliers)  with all the checks a model must pass
//   void refine_model(Model*)                         local optimisation on the model's inliers
// and, where kBatch is 1,
//   int generate_models(const int32_t* sample, Model* models)
//   int64_t fast_cost(const Model&, int64_t bound)   MSAC cost; above bound: any number above it
// or, where kBatch samples are solved at once, and a solution is completed to a Model only if its
// cost is low enough,
//   void generate(const int32_t samples[][kSampleSize], int num_samples)   keeps what it finds
//   int count(int s)                                                       of sample s
//   int64_t fast_cost(int s, int k, int64_t bound)
//   bool complete(int s, int k, const int32_t* sample, Model*)
#pragma once

#include <cstdint>

#include "geometry/sampson.h"
#include "robust/sampler.h"

namespace tv {

// A window of local optimisation is kWindow samples and one more for every kWindowShare matches.
inline constexpr int kWindow = 8, kWindowShare = 2;

// Local optimisation uses the matches within kNear thresholds, so that further matches can become
// inliers. It takes at most kLocalIterations steps, until a step lowers the cost by less than
// kLocalGain of it. For a pose it uses at most kMostLocal matches; the final refinement uses all.
inline constexpr double kNear = 3;
inline constexpr int kMostLocal = 128, kLocalIterations = 5;
inline constexpr double kLocalGain = 1e-3;

// The most samples that few inliers alone can require (LoopOptions::few_inliers_iterations).
inline constexpr int kMostForFewInliers = 1000;

struct LoopOptions {
  double confidence;
  int min_iterations, max_iterations;
  int fixed_iterations;        // number of iterations; 0: the stop is adaptive
  int few_inliers_iterations;  // the least number of iterations is this / inliers, up to
                               // kMostForFewInliers
  int least_inliers = 0;       // a model whose cost shows that it has fewer is not refined
};

template <typename Model>
struct LoopResult {
  bool found = false;
  Model model;  // valid when `found` is true
  int64_t cost = INT64_MAX;
  int num_inliers = 0;
  int num_iterations = 0;
};

// Samples after which a sample of inliers alone has been drawn with the given confidence.
int samples_needed(double confidence, int num_inliers, int num, int sample_size, int most);

// samples_needed, and at least as many as the options require.
int samples_wanted(const LoopOptions& options, int num_inliers, int num, int sample_size);

template <typename Model>
void take_if_better(const Model& model, int64_t cost, int num_inliers, LoopResult<Model>* best) {
  if (cost >= best->cost) return;
  best->found = true;
  best->model = model;
  best->cost = cost;
  best->num_inliers = num_inliers;
}

// Draws samples and solves them, one or kBatch at a time.
template <typename Estimator, bool kOne = Estimator::kBatch == 1>
struct Solver {
  using Model = typename Estimator::Model;
  Model models[Estimator::kMaxModels];

  // Draws the next sample and returns how many candidate models it has.
  int next(Estimator& estimator, Sampler& sampler) {
    int32_t sample[Estimator::kSampleSize];
    draw_sample(sampler, sample);
    return estimator.generate_models(sample, models);
  }
  int64_t fast_cost(const Estimator& estimator, int k, int64_t bound) const {
    return estimator.fast_cost(models[k], bound);
  }
  bool complete(const Estimator&, int k, Model* model) const {
    *model = models[k];
    return true;
  }
};

template <typename Estimator>
struct Solver<Estimator, false> {
  using Model = typename Estimator::Model;
  int32_t samples[Estimator::kBatch][Estimator::kSampleSize];
  int current = Estimator::kBatch - 1;

  int next(Estimator& estimator, Sampler& sampler) {
    if (++current == Estimator::kBatch) {
      for (int s = 0; s < Estimator::kBatch; ++s) draw_sample(sampler, samples[s]);
      estimator.generate(samples, Estimator::kBatch);
      current = 0;
    }
    return estimator.count(current);
  }
  int64_t fast_cost(const Estimator& estimator, int k, int64_t bound) const {
    return estimator.fast_cost(current, k, bound);
  }
  bool complete(const Estimator& estimator, int k, Model* model) const {
    return estimator.complete(current, k, samples[current], model);
  }
};

// Local optimisation takes every sampled model that is the best so far (O. Chum, J. Matas, J.
// Kittler, "Locally optimized RANSAC", 2003), and the best of each window of samples: the best
// minimum does not always start from the best sample. A window is longer where optimising takes
// longer.
template <typename Estimator>
LoopResult<typename Estimator::Model> robust_loop(Estimator& estimator, Sampler& sampler,
                                                  const LoopOptions& options) {
  using Model = typename Estimator::Model;
  LoopResult<Model> best;
  const bool fixed = options.fixed_iterations > 0;
  const int most = fixed ? options.fixed_iterations : options.max_iterations;
  const int window = kWindow + sampler.num / kWindowShare;
  int wanted = most;
  int window_iterations = 0;
  const int64_t worth_optimising = int64_t{kCostOne} * (sampler.num - options.least_inliers);
  int64_t best_sampled = INT64_MAX, window_cost = INT64_MAX;  // costs before local optimisation
  Model window_model, model;
  Solver<Estimator> solver;
  while (best.num_iterations < wanted) {
    ++best.num_iterations;
    ++window_iterations;
    bool improved = false;
    const int num_models = solver.next(estimator, sampler);
    for (int k = 0; k < num_models; ++k) {
      const int64_t cost = solver.fast_cost(estimator, k, window_cost);
      if (cost >= window_cost) continue;
      if (!solver.complete(estimator, k, &model)) continue;
      window_cost = cost;
      window_model = model;
      if (cost < best_sampled) {
        best_sampled = cost;
        improved = true;
      }
    }
    const bool window_over = window_iterations >= window && window_cost < INT64_MAX;
    if (!improved && !window_over) continue;
    const bool worth = window_cost <= worth_optimising;
    if (!worth && !improved) continue;
    if (worth) estimator.refine_model(&window_model);
    int num_inliers;
    const int64_t cost = estimator.full_cost(window_model, &num_inliers);
    take_if_better(window_model, cost, num_inliers, &best);
    if (!worth) continue;
    window_iterations = 0;
    window_cost = INT64_MAX;
    if (fixed || !best.found) continue;
    wanted = samples_wanted(options, best.num_inliers, sampler.num, Estimator::kSampleSize);
  }
  return best;
}

}  // namespace tv
