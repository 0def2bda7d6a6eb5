#include "robust/models.h"

namespace tv {

namespace {

// [a]x M.
void cross_columns(const Vec3& a, const Mat3& M, Mat3* product) {
  for (int c = 0; c < 3; ++c) {
    const double x = M(0, c), y = M(1, c), z = M(2, c);
    (*product)(0, c) = a[1] * z - a[2] * y;
    (*product)(1, c) = a[2] * x - a[0] * z;
    (*product)(2, c) = a[0] * y - a[1] * x;
  }
}

}  // namespace

void pose_columns(const Pose& pose, Mat3 columns[5]) {
  Vec3 b1, b2;
  tangent_basis(pose.t, &b1, &b2);
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3, last = (k + 2) % 3;
    Mat3 turned;  // [axis k]x R
    for (int c = 0; c < 3; ++c) {
      turned(k, c) = 0;
      turned(next, c) = -pose.R(last, c);
      turned(last, c) = pose.R(next, c);
    }
    cross_columns(pose.t, turned, columns + k);
  }
  cross_columns(b1, pose.R, columns + 3);
  cross_columns(b2, pose.R, columns + 4);
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
  result.pose.R = orthonormal_product(rotation_step(Vec3(step[0], step[1], step[2])), pose.R);
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
  result.U = orthonormal_product(U, rotation_step(Vec3(step[0], step[1], step[2])));
  result.V = orthonormal_product(V, rotation_step(Vec3(step[3], step[4], step[5])));
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
  result.H = H + matrix_of(step);
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
  return RotationModel{orthonormal_product(rotation_step(Vec3(step[0], step[1], step[2])), R)};
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

}  // namespace tv
