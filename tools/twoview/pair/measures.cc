#include "pair/measures.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace cli {
namespace {

constexpr double kDegrees = 57.29577951308232;  // degrees in a radian

// Scales a vector so that the square of its length neither overflows nor underflows. The direction
// is kept; a zero vector stays zero.
Vector3 of_medium_length(const Vector3& v) {
  const double largest = std::max({std::abs(v[0]), std::abs(v[1]), std::abs(v[2])});
  return largest > 0 ? Vector3{v[0] / largest, v[1] / largest, v[2] / largest} : v;
}

}  // namespace

double rotation_error_deg(const Matrix3& R_est, const Matrix3& R_gt) {
  const Matrix3 d = product(R_est, transposed(R_gt));
  // The sine comes from the skew part and the cosine from the trace. Unlike acos of the trace, this
  // keeps full precision near 0 degrees.
  const double sine = norm({d[7] - d[5], d[2] - d[6], d[3] - d[1]}) / 2;
  const double cosine = (d[0] + d[4] + d[8] - 1) / 2;
  return std::atan2(sine, cosine) * kDegrees;
}

double translation_error_signed_deg(const Vector3& t_est, const Vector3& t_gt) {
  const Vector3 est = of_medium_length(t_est), gt = of_medium_length(t_gt);
  if (norm(est) == 0 || norm(gt) == 0) return std::numeric_limits<double>::infinity();
  return std::atan2(norm(cross(est, gt)), dot(est, gt)) * kDegrees;
}

double translation_error_deg(const Vector3& t_est, const Vector3& t_gt) {
  const double error = translation_error_signed_deg(t_est, t_gt);
  return std::isfinite(error) ? std::min(error, 180 - error) : error;
}

double auc_percent(std::vector<double> errors_deg, double threshold_deg) {
  if (errors_deg.empty()) return 0;
  std::sort(errors_deg.begin(), errors_deg.end());
  const double count = static_cast<double>(errors_deg.size());
  double area = 0, error = 0, recall = 0;
  for (size_t i = 0; i < errors_deg.size() && errors_deg[i] < threshold_deg; ++i) {
    const double next = static_cast<double>(i + 1) / count;
    area += (errors_deg[i] - error) * (recall + next) / 2;
    error = errors_deg[i];
    recall = next;
  }
  area += (threshold_deg - error) * recall;
  return 100 * area / threshold_deg;
}

double percentile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const double place = share * static_cast<double>(values.size() - 1);
  const size_t below = static_cast<size_t>(place);
  const size_t above = std::min(below + 1, values.size() - 1);
  return values[below] + (place - static_cast<double>(below)) * (values[above] - values[below]);
}

double match_precision(const tv_camera& camera0, const tv_camera& camera1, const Matrix3& R,
                       const Vector3& t, const tv_reconstruction& reconstruction) {
  if (reconstruction.num_matches == 0) return 0;
  const Matrix3 skew = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
  const Matrix3 E = product(skew, R);
  // SuperGlue's t is not normalised, but this measure does not depend on its length.
  int right = 0;
  for (int32_t i = 0; i < reconstruction.num_matches; ++i) {
    const tv_correspondence& match = reconstruction.matches[i];
    const tv_keypoint& k0 = reconstruction.keypoints[0][match.idx0];
    const tv_keypoint& k1 = reconstruction.keypoints[1][match.idx1];
    const double pixel0[2] = {k0.x, k0.y}, pixel1[2] = {k1.x, k1.y};
    Vector3 x0, x1;
    if (tv_camera_unproject(&camera0, pixel0, x0.data(), nullptr) != TV_OK ||
        tv_camera_unproject(&camera1, pixel1, x1.data(), nullptr) != TV_OK || x0[2] <= 0 ||
        x1[2] <= 0)
      continue;
    for (Vector3* x : {&x0, &x1}) *x = {(*x)[0] / (*x)[2], (*x)[1] / (*x)[2], 1};
    const Vector3 line1 = applied(E, x0), line0 = applied(transposed(E), x1);
    const double residual = dot(x1, line1);
    const double error = residual * residual *
                         (1 / (line1[0] * line1[0] + line1[1] * line1[1]) +
                          1 / (line0[0] * line0[0] + line0[1] * line0[1]));
    if (error < 5e-4) ++right;
  }
  return static_cast<double>(right) / reconstruction.num_matches;
}

bool has_full_pose(const tv_two_view& two_view) { return two_view.has_R && two_view.has_t; }

Matrix3 rotation_of(const tv_two_view& two_view) {
  Matrix3 R;
  std::copy(two_view.R, two_view.R + 9, R.begin());
  return R;
}

Vector3 translation_of(const tv_two_view& two_view) {
  return {two_view.t[0], two_view.t[1], two_view.t[2]};
}

double distance_sigma_of_pose(const tv_two_view& two_view, const Vector3& point) {
  if (!two_view.has_covariance) return 0;
  // Both rays and the baseline t, in the axes of camera 1.
  const Vector3 t = translation_of(two_view), from0 = applied(rotation_of(two_view), point);
  Vector3 ray0, ray1;
  const Vector3 from1 = {from0[0] + t[0], from0[1] + t[1], from0[2] + t[2]};
  for (size_t i = 0; i < 3; ++i) {
    ray0[i] = from0[i] / norm(from0);
    ray1[i] = from1[i] / norm(from1);
  }
  const Vector3 normal = cross(t, ray0);
  const double sine0 = norm(normal), sine1 = norm(cross(ray1, t));
  const double sine = norm(cross(ray0, ray1)), cosine = dot(ray0, ray1);
  const double by_ray0 = sine1 * cosine / (sine * sine * sine0);
  const double by_ray1 = sine0 / (sine * sine * sine1);
  // The basis in which the covariance has the direction of t (tv_two_view.covariance).
  size_t least = 0;
  for (size_t i = 1; i < 3; ++i)
    if (std::abs(t[i]) < std::abs(t[least])) least = i;
  Vector3 axis = {0, 0, 0};
  axis[least] = 1;
  Vector3 side = cross(axis, t);
  const double length = norm(side);
  for (double& part : side) part /= length;
  const Vector3 up = cross(t, side);
  double slope[5];
  for (size_t i = 0; i < 3; ++i) slope[i] = -by_ray0 * normal[i];
  slope[3] = by_ray0 * dot(ray0, side) - by_ray1 * dot(ray1, side);
  slope[4] = by_ray0 * dot(ray0, up) - by_ray1 * dot(ray1, up);
  double variance = 0;
  for (size_t i = 0; i < 5; ++i)
    for (size_t k = 0; k < 5; ++k) variance += slope[i] * two_view.covariance[5 * i + k] * slope[k];
  return std::sqrt(std::max(variance, 0.0));
}

}  // namespace cli
