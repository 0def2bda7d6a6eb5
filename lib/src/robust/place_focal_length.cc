#include "robust/place_focal_length.h"

#include <cmath>

#include "base/math.h"
#include "geometry/vector3.h"
#include "robust/calibration.h"
#include "robust/estimators.h"

namespace tv {
namespace {

// The focal lengths that are searched, in standard deviations of the logarithm.
constexpr int kNumStarts = 7;
constexpr double kStarts[kNumStarts] = {0, -0.5, 0.5, -1, 1, -1.5, 1.5};
// Matches that share errors, with a noise of 0.3 thresholds, count by this factor less in a
// comparison of starts: 4 times 0.3 squared.
constexpr double kLessSure = 0.36;
// A start whose direction is 60 degrees and more from the best one's is a solution of its own, and
// no rival only where it costs this much more.
constexpr double kOtherWay = 0.5, kRival = 25;

// Multiplies the focal lengths of both views by `factor`, and computes the rays anew.
void scale_focal_length(TwoViewProblem& problem, double factor, Matches* matches) {
  const double no_shift[2] = {0, 0};
  for (Camera& camera : problem.camera) {
    camera.model.fx *= factor;
    camera.model.fy *= factor;
  }
  move_principal_points(problem, no_shift, matches);
}

}  // namespace

void search_focal_length(TwoViewProblem& problem, Matches* matches, Arena& arena,
                         TwoViewModel* model) {
  const double sigma = calibration_of(problem, 0).focal_sigma;
  const double threshold = problem.options.max_error_px;
  double least = 0, best = 0, now = 0, costs[kNumStarts];
  double directions[kNumStarts][3];
  int num_iterations = 0, num_found = 0;
  for (const double start : kStarts) {
    TwoViewModel found;
    scale_focal_length(problem, exp((start - now) * sigma), matches);
    now = start;
    search_two_view(problem, *matches, arena, &found);
    num_iterations += found.num_iterations;
    if (!found.epipolar.has_pose) continue;
    int inliers;
    const PoseEstimator scorer{matches->pairs, threshold, nullptr, nullptr};
    const double of_matches =
        static_cast<double>(scorer.full_cost(found.epipolar.pose, &inliers)) / kCostOne;
    const double cost = of_matches / kLessSure + start * start;
    costs[num_found] = cost;
    for (int r = 0; r < 3; ++r) directions[num_found][r] = found.epipolar.pose.t[r];
    ++num_found;
    if (model->epipolar.has_pose && !(cost < least)) continue;
    least = cost;
    best = start;
    *model = found;
  }
  scale_focal_length(problem, exp((best - now) * sigma), matches);
  problem.focal_log_scale = best * sigma;
  for (int k = 0; k < num_found; ++k) {
    if (costs[k] < least + kRival &&
        dot(directions[k], model->epipolar.pose.t.data()) < kOtherWay) {
      problem.focal_is_ambiguous = true;
    }
  }
  model->num_iterations = num_iterations;
}

void place_focal_length(Fit& f) {
  constexpr int kSteps = 8;
  constexpr double kSmallStep = 1e-5;
  TwoViewProblem& problem = f.problem;
  if (!refines_focal_length(problem)) return;
  Pose& pose = f.out->epipolar.pose;
  double growth = 0, step = 1;
  for (int k = 0; k < kSteps && std::fabs(step) > kSmallStep; ++k) {
    if (!step_focal_length(f.refiner, &growth, &pose, &step)) break;
    problem.focal_log_scale += step;
    scale_focal_length(problem, exp(step), &f.refiner.matches);
  }
  f.refiner.focal_is_free = problem.focal_log_scale != 0;
  if (!f.refiner.focal_is_free) return;
  f.out->focal_scale = exp(problem.focal_log_scale);
  pose = refined_pose(f.refiner, pose);
}

}  // namespace tv
