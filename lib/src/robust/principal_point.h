// Of a pair that one camera took: how well its matches agree with the given principal point, and
// which shift of it fits them best. docs/algorithms/principal_point.md.
#pragma once

#include "robust/gravity.h"
#include "robust/matches.h"

namespace tv {

struct PrincipalPoint {
  double shift_px[2] = {0, 0};  // principal point of the rays minus that of the calibration
  double sigma_px[2] = {0, 0};  // standard deviation of the calibration's principal point
  bool is_free = false;         // whether the principal point is refined with the pose
};

// The parameters of PoseModel, then the step of the principal point in x and y, in pixels.
inline constexpr int kShiftedParameters = PoseModel::kParameters + 2;

struct ShiftedEquations {
  double upper[kShiftedParameters * (kShiftedParameters + 1) / 2], gradient[kShiftedParameters];
};

// The normal equations of pose and principal point over the listed matches, at the rays as they
// are, with the priors of both. noise_px: the standard deviation of a residual, against which the
// prior of the principal point is weighed. A principal point that moves by d moves every ray by -J
// d, and its Jacobian by the lens's curvature.
void shifted_equations(const TwoViewProblem& problem, const Matches& matches,
                       const int32_t* indices, int count, const GravityPoseModel& model,
                       const PrincipalPoint& point, const RobustLoss& loss, double noise_px,
                       ShiftedEquations* equations);

// What is left of the equations for the shift alone, once the pose has taken its best step: the
// information xx, xy, yy and the gradient. False where the matches do not determine the shift.
bool eliminate_pose(const ShiftedEquations& equations, double information[3], double gradient[2]);

// Adds the uncertainty of the principal point to the covariance of a pose: C += G S G', S the
// covariance of the point and G the pose's slope by it. variance_px: of a residual of the listed
// matches, px^2.
bool add_shift_variance(const TwoViewProblem& problem, const Matches& matches,
                        const int32_t* indices, int count, const GravityPoseModel& model,
                        const PrincipalPoint& point, double variance_px, double covariance[25]);

}  // namespace tv
