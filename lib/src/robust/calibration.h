// What the uncertainty of the cameras' focal lengths and principal points adds to the covariance of
// a pose, and the focal length as an unknown. docs/algorithms/covariance.md.
#pragma once

#include "robust/covariance.h"
#include "robust/pose_refiner.h"

namespace tv {

// Above this relative standard deviation the focal length of one camera is refined with the pose.
inline constexpr double kUncertainFocal = 0.02;

// How uncertain the camera of a view is; the same for both views of one camera.
inline const tv_calibration& calibration_of(const TwoViewProblem& problem, int view) {
  return view == 0 ? problem.options.calibration0 : problem.options.calibration1;
}

// Whether one camera saw both views, and its focal length is refined with the pose.
inline bool refines_focal_length(const TwoViewProblem& problem) {
  const tv_calibration& given = calibration_of(problem, 0);
  return problem.one_camera && (given.refine & TV_REFINE_FOCAL_LENGTH) != 0 &&
         given.focal_sigma > kUncertainFocal;
}

// Whether the options give the cameras a standard deviation.
bool has_calibration_sigmas(const TwoViewProblem& problem);

// The number of a view's parameters: the logarithm of its focal length, and its principal point in
// focal lengths, x and y.
inline constexpr int kOfView = 3;

// The normal equations J' W J of the pose over the listed matches, and its products J' W d with the
// slopes d of the residuals by each view's parameters; the square and the gradient of the focal
// length that both views share.
struct CalibrationEquations {
  double of_pose[15];
  double with_pose[2 * kOfView][PoseModel::kParameters];
  double focal_sq, focal_gradient;
};
void calibration_equations(const PoseRefiner& refiner, int count, const Pose& pose,
                           const RobustLoss& loss, CalibrationEquations* equations);

// The steps of the pose's five parameters for a unit step of each of the views' parameters; of one
// camera only the first three, which both views share.
struct CalibrationSlopes {
  double by[2 * kOfView][PoseModel::kParameters];
};

// The slopes of a pose that minimises the loss: -(J' W J)^-1 J' W d. focal_information: what the
// matches say of the focal length that both views share, d' W d less what the pose takes of it, in
// the units of J' W J. False where the pose is not determined.
bool pose_slopes(const TwoViewProblem& problem, const CalibrationEquations& equations,
                 CalibrationSlopes* slopes, double* focal_information);

// The slopes of a pose that was read off the homography of a plane: a camera that changes moves the
// homography of rays as x -> K'^-1 K x says, and the pose is read off anew. Differences.
void plane_slopes(const TwoViewProblem& problem, const Mat3& H, const Vec3& mean_ray0,
                  const Pose& pose, CalibrationSlopes* slopes);

// Adds sum s^2 g g' over the parameters to `covariance`, with their standard deviations s and the
// slopes g. focal_variance: that of a refined focal length, in place of the given one's; negative:
// it is not refined. only_focal: the others' are left out.
void add_calibration(const TwoViewProblem& problem, const CalibrationSlopes& slopes,
                     double focal_variance, bool only_focal, double covariance[25]);

}  // namespace tv
