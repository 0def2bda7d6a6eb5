#include "robust/place_principal_point.h"

#include <algorithm>
#include <cmath>

#include "robust/calibration.h"

namespace tv {

void place_principal_point(Fit& f) {
  constexpr int kSteps = 6;
  constexpr double kSmallStepPx = 0.01, kMostSigmas = 6;
  Pose& pose = f.out->epipolar.pose;
  PrincipalPoint& point = f.refiner.principal_point;
  const tv_camera& camera = f.problem.camera[0].model;
  if (!f.problem.one_camera) return;
  // Where the focal length is uncertain, the principal point does not move in its stead.
  const tv_calibration& given = calibration_of(f.problem, 0);
  const bool may_move =
      (given.refine & TV_REFINE_PRINCIPAL_POINT) != 0 && !(given.focal_sigma > kUncertainFocal);
  const double sigma = may_move ? given.center_sigma : 0;
  point.sigma_px[0] = sigma * camera.fx;
  point.sigma_px[1] = sigma * camera.fy;
  point.is_free =
      principal_point_is_off(f.refiner, pose, point.sigma_px, &f.out->evidence->principal_point);
  if (!point.is_free) return;
  const Pose as_given = pose;
  double step[2] = {1, 1};
  for (int k = 0; k < kSteps && std::fabs(step[0]) + std::fabs(step[1]) > kSmallStepPx; ++k) {
    if (!move_together(f.refiner, &pose, step)) break;
    for (int i = 0; i < 2; ++i) point.shift_px[i] += step[i];
    move_principal_points(f.problem, point.shift_px, &f.refiner.matches);
  }
  // A larger shift is no error of a calibration: the principal point stays where it was.
  if (!(std::fabs(point.shift_px[0]) < kMostSigmas * point.sigma_px[0] &&
        std::fabs(point.shift_px[1]) < kMostSigmas * point.sigma_px[1])) {
    point = PrincipalPoint{};
    pose = as_given;
    move_principal_points(f.problem, point.shift_px, &f.refiner.matches);
    return;
  }
  pose = refined_pose(f.refiner, pose);
  std::copy(point.shift_px, point.shift_px + 2, f.out->principal_point_shift_px);
}

}  // namespace tv
