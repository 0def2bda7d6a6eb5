#include "robust/place_focal_length.h"

#include <cmath>

#include "base/math.h"
#include "robust/calibration.h"

namespace tv {

void place_focal_length(Fit& f) {
  constexpr int kSteps = 8;
  constexpr double kSmallStep = 1e-5, kMostSigmas = 4;
  TwoViewProblem& problem = f.problem;
  const double sigma = problem.options.focal_sigma0;
  if (!problem.one_camera || !(sigma > kUncertainFocal)) return;
  Pose& pose = f.out->epipolar.pose;
  const Pose as_given = pose;
  const tv_camera given = problem.camera[0].model;
  const double no_shift[2] = {0, 0};
  double log_scale = 0, growth = 0, step = 1;
  bool moved = false;
  const auto apply = [&](double scale) {
    for (Camera& camera : problem.camera) {
      camera.model.fx = given.fx * scale;
      camera.model.fy = given.fy * scale;
    }
    move_principal_points(problem, no_shift, &f.refiner.matches);
  };
  for (int k = 0; k < kSteps && std::fabs(step) > kSmallStep; ++k) {
    if (!step_focal_length(f.refiner, sigma, log_scale, &growth, &pose, &step)) break;
    log_scale += step;
    apply(exp(log_scale));
    moved = true;
  }
  if (!moved) return;
  if (!(std::fabs(log_scale) < kMostSigmas * sigma)) {
    pose = as_given;
    apply(1);
    return;
  }
  f.refiner.focal_is_free = true;
  f.out->focal_scale = exp(log_scale);
  pose = refined_pose(f.refiner, pose);
}

}  // namespace tv
