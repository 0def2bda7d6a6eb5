#include "robust/loop.h"

#include "base/math.h"

namespace tv {

int samples_needed(double confidence, int num_inliers, int num, int sample_size, int most) {
  double good = 1;  // the probability that a sample, drawn without replacement, is of inliers alone
  for (int k = 0; k < sample_size; ++k) {
    if (num_inliers <= k) return most;
    good *= static_cast<double>(num_inliers - k) / static_cast<double>(num - k);
  }
  if (good >= 1) return 1;
  if (!(good > 1e-12)) return most;
  const double needed = log(1 - confidence) / log(1 - good);
  return needed < most ? static_cast<int>(needed) + 1 : most;
}

int samples_wanted(const LoopOptions& options, int num_inliers, int num, int sample_size) {
  const int most = options.max_iterations;
  int wanted = samples_needed(options.confidence, num_inliers, num, sample_size, most);
  int least = options.min_iterations;
  // Local optimisation from a sample of inliers alone need not reach the best minimum: with few
  // inliers there are several minima, and samples cost little.
  if (options.few_inliers_iterations > 0 && num_inliers > 0) {
    int more = options.few_inliers_iterations / num_inliers;
    if (more > kMostForFewInliers) more = kMostForFewInliers;
    if (more > least) least = more;
  }
  if (wanted < least) wanted = least;
  return wanted < most ? wanted : most;
}

}  // namespace tv
