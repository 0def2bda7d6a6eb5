// Nonlinear refinement of a model on its inliers: Levenberg-Marquardt with analytic Jacobians (D.
// W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963). With a
// robust loss the weights are those of the current residuals (iteratively reweighted least
// squares). Tests: test/unit/test_residuals.cc, test/property/test_two_view_property.cc.
#pragma once

#include "geometry/normal_equations.h"

namespace tv {

// Lowers the robust cost over the listed matches until a step lowers it by less than small_gain of
// it. Model: one of robust/models.h, or GravityPoseModel. Returns the final cost, in units of
// scale^2. stretch: the factor on each step. Reweighted least squares take the mean of the weights
// as the curvature of the loss, which is the mean of psi'. Their steps are too short by the ratio
// of the two; give this ratio as stretch to lengthen them.
inline constexpr double kSmallGain = 1e-9;
template <typename Model>
double refine(const RayPairs& pairs, const int32_t* indices, int count, const RobustLoss& loss,
              int max_iterations, Model* model, double small_gain = kSmallGain, double stretch = 1);

}  // namespace tv
