// D. W. Marquardt, "An algorithm for least-squares estimation of nonlinear parameters", 1963. With
// a robust loss the weights are those of the current residuals (iteratively reweighted).
#include "robust/refine.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "robust/gravity.h"

namespace tv {

void pose_columns(const Pose& pose, Mat3 columns[5]) {
  const Mat3 translation = cross_matrix(pose.t);
  Vec3 b1, b2;
  tangent_basis(pose.t, &b1, &b2);
  for (int k = 0; k < 3; ++k) {
    Vec3 axis = Vec3::Zero();
    axis[k] = 1;
    columns[k] = translation * (cross_matrix(axis) * pose.R);
  }
  columns[3] = cross_matrix(b1) * pose.R;
  columns[4] = cross_matrix(b2) * pose.R;
}

double PoseModel::normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                   const RobustLoss& loss, double* upper, double* gradient) const {
  Mat3 columns[5];
  pose_columns(pose, columns);
  return sampson_normal_equations(pairs, indices, count, essential_from_pose(pose), columns,
                                  kParameters, loss, upper, gradient);
}

PoseModel PoseModel::stepped(const double* step) const {
  Vec3 b1, b2;
  tangent_basis(pose.t, &b1, &b2);
  PoseModel result;
  result.pose.R = orthonormalised(rotation_step(Vec3(step[0], step[1], step[2])) * pose.R);
  result.pose.t = (pose.t + step[3] * b1 + step[4] * b2).normalized();
  return result;
}

FundamentalModel fundamental_model(const Mat3& M) {
  const Svd3 svd = svd3(M);
  return FundamentalModel{svd.U, svd.V, svd.s[0] > 0 ? svd.s[1] / svd.s[0] : 0.0};
}

Mat3 FundamentalModel::matrix() const {
  return U.col(0) * V.col(0).transpose() + s * (U.col(1) * V.col(1).transpose());
}

double FundamentalModel::normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                          const RobustLoss& loss, double* upper,
                                          double* gradient) const {
  Mat3 columns[7];
  Mat3 S = Mat3::Zero();
  S(0, 0) = 1;
  S(1, 1) = s;
  for (int k = 0; k < 3; ++k) {
    Vec3 axis = Vec3::Zero();
    axis[k] = 1;
    const Mat3 turn = cross_matrix(axis);
    columns[k] = U * turn * S * V.transpose();
    columns[3 + k] = -(U * S * turn * V.transpose());
  }
  columns[6] = U.col(1) * V.col(1).transpose();
  return sampson_normal_equations(pairs, indices, count, matrix(), columns, kParameters, loss,
                                  upper, gradient);
}

FundamentalModel FundamentalModel::stepped(const double* step) const {
  FundamentalModel result;
  result.U = orthonormalised(U * rotation_step(Vec3(step[0], step[1], step[2])));
  result.V = orthonormalised(V * rotation_step(Vec3(step[3], step[4], step[5])));
  result.s = s + step[6];
  return result;
}

double HomographyModel::normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                         const RobustLoss& loss, double* upper,
                                         double* gradient) const {
  return transfer_normal_equations(pairs, indices, count, H, nullptr, kParameters, loss, upper,
                                   gradient);
}

HomographyModel HomographyModel::stepped(const double* step) const {
  HomographyModel result;
  for (int k = 0; k < 9; ++k) result.H(k / 3, k % 3) = H(k / 3, k % 3) + step[k];
  result.H /= result.H.norm();
  return result;
}

double RotationModel::normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                       const RobustLoss& loss, double* upper,
                                       double* gradient) const {
  Mat3 columns[3];
  for (int k = 0; k < 3; ++k) {
    Vec3 axis = Vec3::Zero();
    axis[k] = 1;
    columns[k] = cross_matrix(axis) * R;
  }
  return transfer_normal_equations(pairs, indices, count, R, columns, kParameters, loss, upper,
                                   gradient);
}

RotationModel RotationModel::stepped(const double* step) const {
  return RotationModel{orthonormalised(rotation_step(Vec3(step[0], step[1], step[2])) * R)};
}

Mat3 PlaneModel::matrix() const { return pose.R + pose.t * plane.transpose(); }

double PlaneModel::normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                    const RobustLoss& loss, double* upper, double* gradient) const {
  Vec3 b1, b2;
  tangent_basis(pose.t, &b1, &b2);
  Mat3 columns[8];
  for (int k = 0; k < 3; ++k) {
    Vec3 axis = Vec3::Zero();
    axis[k] = 1;
    columns[k] = cross_matrix(axis) * pose.R;
    columns[5 + k] = pose.t * axis.transpose();
  }
  columns[3] = b1 * plane.transpose();
  columns[4] = b2 * plane.transpose();
  return transfer_normal_equations(pairs, indices, count, matrix(), columns, kParameters, loss,
                                   upper, gradient);
}

PlaneModel PlaneModel::stepped(const double* step) const {
  return PlaneModel{PoseModel{pose}.stepped(step).pose, plane + Vec3(step[5], step[6], step[7])};
}

namespace {

constexpr int kMost = 9;  // parameters

// A = L D L' in place of a full lower triangle; false when a pivot is not above `smallest`.
bool factorise(int num, double A[kMost][kMost], double* D, double smallest) {
  for (int j = 0; j < num; ++j) {
    double pivot = A[j][j];
    for (int k = 0; k < j; ++k) pivot -= A[j][k] * A[j][k] * D[k];
    if (!(pivot > smallest)) return false;
    D[j] = pivot;
    for (int i = j + 1; i < num; ++i) {
      double value = A[i][j];
      for (int k = 0; k < j; ++k) value -= A[i][k] * A[j][k] * D[k];
      A[i][j] = value / pivot;
    }
  }
  return true;
}

void solve_factorised(int num, const double A[kMost][kMost], const double* D, double* x) {
  for (int i = 0; i < num; ++i) {
    for (int k = 0; k < i; ++k) x[i] -= A[i][k] * x[k];
  }
  for (int i = 0; i < num; ++i) x[i] /= D[i];
  for (int i = num - 1; i >= 0; --i) {
    for (int k = i + 1; k < num; ++k) x[i] -= A[k][i] * x[k];
  }
}

// Returns the largest entry of the diagonal, at least 0.
double unpack_lower(int num, const double* upper, double A[kMost][kMost]) {
  double largest = 0;
  for (int i = 0, slot = 0; i < num; ++i) {
    for (int j = i; j < num; ++j) A[j][i] = upper[slot++];
    if (A[i][i] > largest) largest = A[i][i];
  }
  return largest;
}

}  // namespace

bool solve_damped(int num, const double* upper, const double* gradient, double lambda,
                  double* step) {
  double A[kMost][kMost], D[kMost];
  const double largest = unpack_lower(num, upper, A);
  if (!(largest > 0)) return false;
  for (int i = 0; i < num; ++i) A[i][i] += lambda * (A[i][i] + 1e-9 * largest);
  if (!factorise(num, A, D, 0.0)) return false;
  for (int i = 0; i < num; ++i) step[i] = -gradient[i];
  solve_factorised(num, A, D, step);
  return true;
}

bool invert_symmetric(int num, const double* upper, double* inverse) {
  double A[kMost][kMost], D[kMost];
  const double largest = unpack_lower(num, upper, A);
  if (!factorise(num, A, D, 1e-13 * largest)) return false;
  for (int c = 0; c < num; ++c) {
    double x[kMost] = {};
    x[c] = 1;
    solve_factorised(num, A, D, x);
    for (int r = 0; r < num; ++r) inverse[num * r + c] = x[r];
  }
  for (int r = 0; r < num; ++r) {  // exactly symmetric
    for (int c = 0; c < r; ++c) inverse[num * r + c] = inverse[num * c + r];
  }
  return true;
}

namespace {

// A model without its type: one loop for all of them.
struct AnyModel {
  int num_parameters;
  double (*normal_equations)(const void* model, const RayPairs& pairs, const int32_t* indices,
                             int count, const RobustLoss& loss, double* upper, double* gradient);
  void (*make_step)(const void* model, const double* step, void* moved);
};

// Refines *model with `moved` as scratch, another of its kind; *model ends as one of the two, the
// better.
double refine_any(const AnyModel& any, const RayPairs& pairs, const int32_t* indices, int count,
                  const RobustLoss& loss, int max_iterations, void** model, void* moved,
                  double small_gain, double stretch) {
  constexpr double kSmallStep = 1e-9;
  const int num = any.num_parameters, packed = num * (num + 1) / 2;
  double upper[2][kMost * (kMost + 1) / 2], gradient[2][kMost], step[kMost];
  double cost = any.normal_equations(*model, pairs, indices, count, loss, upper[0], gradient[0]);
  double lambda = 1e-4;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    if (!solve_damped(num, upper[0], gradient[0], lambda, step)) break;
    double step_sq = 0;
    for (int p = 0; p < num; ++p) {
      step[p] *= stretch;
      step_sq += step[p] * step[p];
    }
    if (!(step_sq > kSmallStep * kSmallStep)) break;
    any.make_step(*model, step, moved);
    const double new_cost =
        any.normal_equations(moved, pairs, indices, count, loss, upper[1], gradient[1]);
    if (!(new_cost < cost)) {
      lambda *= 10;
      if (lambda > 1e6) break;
      continue;
    }
    const double gain = cost - new_cost;
    std::swap(*model, moved);
    cost = new_cost;
    lambda *= 0.1;
    if (lambda < 1e-10) lambda = 1e-10;
    std::copy(upper[1], upper[1] + packed, upper[0]);
    std::copy(gradient[1], gradient[1] + num, gradient[0]);
    if (gain < small_gain * cost) break;
  }
  return cost;
}

}  // namespace

template <typename Model>
double refine(const RayPairs& pairs, const int32_t* indices, int count, const RobustLoss& loss,
              int max_iterations, Model* model, double small_gain, double stretch) {
  const AnyModel any = {
      Model::kParameters,
      [](const void* of, const RayPairs& p, const int32_t* i, int n, const RobustLoss& l, double* u,
         double* g) { return static_cast<const Model*>(of)->normal_equations(p, i, n, l, u, g); },
      [](const void* of, const double* step, void* moved) {
        *static_cast<Model*>(moved) = static_cast<const Model*>(of)->stepped(step);
      }};
  Model scratch = *model;
  void* best = model;
  const double cost = refine_any(any, pairs, indices, count, loss, max_iterations, &best, &scratch,
                                 small_gain, stretch);
  if (best != model) *model = scratch;
  return cost;
}

template double refine<PoseModel>(const RayPairs&, const int32_t*, int, const RobustLoss&, int,
                                  PoseModel*, double, double);
template double refine<GravityPoseModel>(const RayPairs&, const int32_t*, int, const RobustLoss&,
                                         int, GravityPoseModel*, double, double);
template double refine<FundamentalModel>(const RayPairs&, const int32_t*, int, const RobustLoss&,
                                         int, FundamentalModel*, double, double);
template double refine<HomographyModel>(const RayPairs&, const int32_t*, int, const RobustLoss&,
                                        int, HomographyModel*, double, double);
template double refine<PlaneModel>(const RayPairs&, const int32_t*, int, const RobustLoss&, int,
                                   PlaneModel*, double, double);
template double refine<RotationModel>(const RayPairs&, const int32_t*, int, const RobustLoss&, int,
                                      RotationModel*, double, double);

}  // namespace tv
