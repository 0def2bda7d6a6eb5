#include "geometry/essential.h"

#include <cmath>

#include "base/math.h"

namespace tv {
namespace {

constexpr double kRotationTolerance = 1e-6;

}  // namespace

Mat3 cross_matrix(const Vec3& v) {
  Mat3 m;
  m << 0, -v[2], v[1], v[2], 0, -v[0], -v[1], v[0], 0;
  return m;
}

Mat3 essential_from_pose(const Pose& pose) { return cross_matrix(pose.t) * pose.R; }

Mat3 rotation_step(const Vec3& w) {
  const double scale = 1.0 / std::sqrt(1.0 + 0.25 * w.squaredNorm());
  const double qw = scale, x = 0.5 * w[0] * scale, y = 0.5 * w[1] * scale, z = 0.5 * w[2] * scale;
  Mat3 R;
  R << 1 - 2 * (y * y + z * z), 2 * (x * y - qw * z), 2 * (x * z + qw * y), 2 * (x * y + qw * z),
      1 - 2 * (x * x + z * z), 2 * (y * z - qw * x), 2 * (x * z - qw * y), 2 * (y * z + qw * x),
      1 - 2 * (x * x + y * y);
  return R;
}

Mat3 orthonormalised(const Mat3& R) {
  const Vec3 x = R.row(0).transpose().normalized();
  Vec3 y = R.row(1).transpose();
  y = (y - y.dot(x) * x).normalized();
  Mat3 result;
  result.row(0) = x.transpose();
  result.row(1) = y.transpose();
  result.row(2) = x.cross(y).transpose();
  return result;
}

Mat3 orthonormal_product(const Mat3& A, const Mat3& B) {
  Mat3 product;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {  // in the order in which Eigen adds
      product(i, j) = A(i, 0) * B(0, j) + (A(i, 1) * B(1, j) + A(i, 2) * B(2, j));
    }
  }
  return orthonormalised(product);
}

bool is_rotation(const double R[9]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      const double* a = R + 3 * i;
      const double* b = R + 3 * j;
      const double product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
      if (!(std::fabs(product - (i == j ? 1.0 : 0.0)) <= kRotationTolerance)) return false;
    }
  }
  const double det = R[0] * (R[4] * R[8] - R[5] * R[7]) - R[1] * (R[3] * R[8] - R[5] * R[6]) +
                     R[2] * (R[3] * R[7] - R[4] * R[6]);
  return det > 0.0;
}

void tangent_basis(const Vec3& t, Vec3* b1, Vec3* b2) {
  int k = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::fabs(t[i]) < std::fabs(t[k])) k = i;
  }
  Vec3 axis = Vec3::Zero();
  axis[k] = 1;
  *b1 = axis.cross(t).normalized();
  *b2 = t.cross(*b1);
}

Mat3 rotation_about(const Vec3& unit_axis, double angle_rad) {
  double sine, cosine;
  sincos(angle_rad, &sine, &cosine);
  const Mat3 K = cross_matrix(unit_axis);
  Mat3 R;  // I + sine K + (1 - cosine) K^2; the loops are a third of Eigen's code
  for (int r = 0; r < 3; ++r) {
    const Vec3 scaled = (1 - cosine) * K.row(r).transpose();
    for (int c = 0; c < 3; ++c) {
      R(r, c) = ((r == c ? 1.0 : 0.0) + sine * K(r, c)) + scaled.dot(K.col(c));
    }
  }
  return R;
}

bool decompose_essential(const Mat3& E, Mat3 R[2], Vec3* t) {
  const double norm_sq = E.squaredNorm();
  if (!(norm_sq > 1e-300) || !(norm_sq < 1e300)) return false;
  const Mat3 unit = E * std::sqrt(2.0 / norm_sq);  // its singular values are 1, 1 and 0
  // Rows of cof(E) are cross products of E's rows; cof(E) = t t' R.
  const Vec3 r0 = unit.row(0), r1 = unit.row(1), r2 = unit.row(2);
  Mat3 cofactors;
  cofactors.row(0) = r1.cross(r2).transpose();
  cofactors.row(1) = r2.cross(r0).transpose();
  cofactors.row(2) = r0.cross(r1).transpose();
  // t is E's left null vector: the longest cross product of two columns, at unit length.
  const Vec3 c0 = unit.col(0), c1 = unit.col(1), c2 = unit.col(2);
  const Vec3 candidates[3] = {c1.cross(c2), c2.cross(c0), c0.cross(c1)};
  int best = 0;
  for (int i = 1; i < 3; ++i) {
    if (candidates[i].squaredNorm() > candidates[best].squaredNorm()) best = i;
  }
  if (!(candidates[best].squaredNorm() > 1e-24)) return false;
  *t = candidates[best].normalized();
  const Mat3 product = cross_matrix(*t) * unit;
  R[0] = cofactors - product;
  R[1] = cofactors + product;
  return true;
}

DepthSigns depth_signs(const Pose& pose, const Vec3& ray0, const Vec3& ray1, double angle_rad) {
  double a[3];
  for (int r = 0; r < 3; ++r) {
    a[r] = (pose.R(r, 0) * ray0[0] + pose.R(r, 1) * ray0[1]) + pose.R(r, 2) * ray0[2];
  }
  const double aa = (a[0] * a[0] + a[1] * a[1]) + a[2] * a[2];
  const double ff = (ray1[0] * ray1[0] + ray1[1] * ray1[1]) + ray1[2] * ray1[2];
  const double af = (a[0] * ray1[0] + a[1] * ray1[1]) + a[2] * ray1[2];
  const double at = (a[0] * pose.t[0] + a[1] * pose.t[1]) + a[2] * pose.t[2];
  const double ft = (ray1[0] * pose.t[0] + ray1[1] * pose.t[1]) + ray1[2] * pose.t[2];
  DepthSigns d;
  d.depth0 = af * ft - ff * at;
  d.depth1 = aa * ft - af * at;
  // depth0 / (ff |a|) = -p . t, where p is the component of a / |a| perpendicular to ray1. A turn
  // of a by angle_rad changes it by at most angle_rad times the length of the component of t
  // perpendicular to ray1. The same holds for depth1 with a and ray1 exchanged.
  const double turn = angle_rad * angle_rad * aa * ff;
  d.tolerance0_sq = turn * (ff - ft * ft);
  d.tolerance1_sq = turn * (aa - at * at);
  return d;
}

}  // namespace tv
