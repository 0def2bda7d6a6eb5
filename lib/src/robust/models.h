// The models that are refined over matches: for each its parameters, its normal equations, and the
// model after a step. A pose, a fundamental matrix, a homography, a rotation, and a pose with the
// plane that the points lie on. The pose with a prior of gravity is in robust/gravity.h; the
// minimisation itself is in robust/refine.h. Tests: test/unit/test_residuals.cc.
#pragma once

#include "geometry/essential.h"
#include "geometry/normal_equations.h"
#include "geometry/null_space.h"

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

// The derivatives of [t]x R by each of the five parameters.
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

// A homography by its nine entries; its scale is not determined, so that its normal equations need
// damping. Transfer residual.
struct HomographyModel {
  static constexpr int kParameters = 9;
  Mat3 H;
  double normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                          const RobustLoss& loss, double* upper, double* gradient) const;
  HomographyModel stepped(const double* step) const;
};

// A rotation. The residual is the transfer residual.
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

}  // namespace tv
