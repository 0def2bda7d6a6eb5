// Nonlinear refinement of a model on its inliers, by Levenberg-Marquardt with analytic Jacobians.
#pragma once

#include "geometry/essential.h"
#include "geometry/null_space.h"
#include "geometry/residuals.h"

namespace tv {

// A pose; five parameters (w0, w1, w2, a, b): R <- exp([w]) R, t <- normalise(t + a b1 + b b2).
// Sampson's distance.
struct PoseModel {
  static constexpr int kParameters = 5;
  Pose pose;
  double normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                          const RobustLoss& loss, double* upper, double* gradient) const;
  PoseModel stepped(const double* step) const;
};

// d ([t]x R) / d each of the five.
void pose_columns(const Pose& pose, Mat3 columns[5]);

// A fundamental matrix U diag(1, s, 0) V' with rotations U, V: seven parameters (A. Bartoli, P.
// Sturm, "Nonlinear estimation of the fundamental matrix with minimal parameters", PAMI 2004).
struct FundamentalModel {
  static constexpr int kParameters = 7;
  Mat3 U, V;
  double s;
  Mat3 matrix() const;
  double normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                          const RobustLoss& loss, double* upper, double* gradient) const;
  FundamentalModel stepped(const double* step) const;
};
FundamentalModel fundamental_model(const Mat3& M);

// A homography by its nine entries; the scale is free, which damping takes care of. Transfer
// residual.
struct HomographyModel {
  static constexpr int kParameters = 9;
  Mat3 H;
  double normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                          const RobustLoss& loss, double* upper, double* gradient) const;
  HomographyModel stepped(const double* step) const;
};

// A rotation. Transfer residual.
struct RotationModel {
  static constexpr int kParameters = 3;
  Mat3 R;
  double normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                          const RobustLoss& loss, double* upper, double* gradient) const;
  RotationModel stepped(const double* step) const;
};

// A pose and the plane n . X = 1 (in units of |t|) that the points lie on, H = R + t n': eight
// parameters, those of PoseModel and n's. Transfer residual.
struct PlaneModel {
  static constexpr int kParameters = 8;
  Pose pose;
  Vec3 plane;
  Mat3 matrix() const;
  double normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                          const RobustLoss& loss, double* upper, double* gradient) const;
  PlaneModel stepped(const double* step) const;
};

// Solves (A + lambda diag(A)) step = -gradient for the packed upper triangle of a symmetric
// non-negative A of at most nine rows, by LDL'. False when it is singular.
bool solve_damped(int num, const double* upper, const double* gradient, double lambda,
                  double* step);

// The inverse of the packed symmetric A, full row-major. False when it is singular.
bool invert_symmetric(int num, const double* upper, double* inverse);

// Lowers the robust cost over the listed matches, until a step gains less than small_gain of it.
// stretch: of each step. Reweighted least squares divide by the weights' mean where the loss itself
// curves by the mean of psi': their ratio is what the steps are too short by. Returns the final
// cost, in units of scale^2.
inline constexpr double kSmallGain = 1e-9;
template <typename Model>
double refine(const RayPairs& pairs, const int32_t* indices, int count, const RobustLoss& loss,
              int max_iterations, Model* model, double small_gain = kSmallGain, double stretch = 1);

}  // namespace tv
