// The robust loop (loop.h) with the solver and the priors that the caller's options name.
#include "base/math.h"
#include "geometry/sampson.h"
#include "robust/estimators_upright.h"
#include "robust/loop.h"
#include "robust/two_view.h"

namespace tv {
namespace {

// The first samples of inliers alone may not lead to the best model that local optimisation can
// reach. At least kMinIterations samples are therefore drawn, and at least kFewInliersIterations /
// inliers where inliers are few. docs/decisions/0002-robust-loop.md has the measurements.
constexpr int kMinIterations = 50, kFewInliersIterations = 20000;

LoopOptions loop_options(const tv_estimate_options& options) {
  return LoopOptions{options.confidence, kMinIterations, options.max_iterations,
                     options.fixed_iterations, kFewInliersIterations};
}

template <typename Estimator>
LoopResult<typename Estimator::Model> run(Estimator estimator, const TwoViewProblem& problem) {
  Sampler sampler = make_sampler(problem.options.seed, estimator.pairs.num, Estimator::kSampleSize,
                                 problem.ratios != nullptr);
  return robust_loop(estimator, sampler, loop_options(problem.options));
}

}  // namespace

int least_matches(int method) {
  if (method == TV_SOLVER_EIGHT_POINT) return 8;
  return method == TV_SOLVER_SEVEN_POINT ? 7 : 5;
}

GravityPrior gravity_of(const TwoViewProblem& problem) {
  const tv_estimate_options& options = problem.options;
  return gravity_prior(options.gravity0, options.gravity1, options.gravity_sigma_rad);
}

size_t search_bytes(int max_matches) {
  return arena_bytes<int32_t>(static_cast<size_t>(max_matches)) + arena_bytes<PoseBatch>(1);
}

void search_two_view(const TwoViewProblem& problem, const Matches& matches, Arena& arena,
                     TwoViewModel* model) {
  *model = TwoViewModel{};
  ArenaScope scope(arena);
  const RayPairs& pairs = matches.pairs;
  int32_t* indices = arena_alloc<int32_t>(arena, static_cast<size_t>(pairs.num));
  const double threshold = problem.options.max_error_px;
  EpipolarModel& epipolar = model->epipolar;
  const int sample_size = least_matches(problem.options.method);
  if (pairs.num < sample_size) return;
  if (sample_size == 5) {
    const GravityPrior gravity = gravity_of(problem);
    const LoopResult<Pose> result =
        problem.options.method == TV_SOLVER_UPRIGHT
            ? run(make_upright_estimator(pairs, threshold, indices, gravity), problem)
            : run(PoseEstimator{pairs, threshold, indices, arena_alloc<PoseBatch>(arena, 1)},
                  problem);
    model->num_iterations = result.num_iterations;
    epipolar.found = epipolar.has_pose = result.found;
    if (result.found) epipolar.pose = result.model;
    return;
  }
  const LoopResult<Mat3> result =
      problem.options.method == TV_SOLVER_EIGHT_POINT
          ? run(FundamentalEstimator<8>{pairs, threshold, indices}, problem)
          : run(FundamentalEstimator<7>{pairs, threshold, indices}, problem);
  model->num_iterations = result.num_iterations;
  epipolar.found = result.found;
  if (!result.found) return;
  epipolar.M = result.model;
  if (!problem.calibrated) return;
  // The pose is found as in the FAST-SIFT paper: of the essential matrix nearest to M, it is the
  // pose with most points in front of both cameras.
  const int count = near_matches(pairs, pairs.num, epipolar.M, threshold, indices);
  Svd3 svd = svd3(epipolar.M);
  const Mat3 essential =
      svd.U.col(0) * svd.V.col(0).transpose() + svd.U.col(1) * svd.V.col(1).transpose();
  epipolar.has_pose =
      pose_from_essential(pairs, indices, count, essential, threshold, false, &epipolar.pose);
  epipolar.found = epipolar.has_pose;
}

}  // namespace tv
