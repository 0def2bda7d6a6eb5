// Bundle adjustment of two views: the pose and all points of a pair together, and the covariance of
// the pose. Derivations: docs/algorithms/bundle.md. Tests: test/unit/test_bundle_ceres.cc,
// test/property/test_bundle_covariance.cc, test/api/test_bundle_api.c.
#pragma once

#include "base/arena.h"
#include "robust/bundle_match.h"

namespace tv {

struct BundleOutcome {
  Pose pose;
  int num_points, num_iterations;
  bool moved;  // whether the pose differs from the one at the start
  bool converged, has_covariance;
  double initial_cost, final_cost, initial_sum_sq, final_sum_sq;
  double covariance[25];
  double noise_px;
};

// How many bytes of arena one adjustment takes.
size_t bundle_scratch_bytes(int max_points);

// The points are in units of `baseline`; those that take part are updated.
void adjust_two_view(const BundleProblem& problem, const Pose& start, double baseline, Arena& arena,
                     tv_point* points, BundleOutcome* outcome);

}  // namespace tv
