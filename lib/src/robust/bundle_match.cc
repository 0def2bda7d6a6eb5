#include "robust/bundle_match.h"

#include <cmath>

#include "base/math.h"
#include "geometry/vector3.h"

namespace tv {

BundleFrame bundle_frame(const Pose& pose) {
  BundleFrame frame;
  frame.R = pose.R;
  frame.t = pose.t;
  tangent_basis(pose.t, &frame.b1, &frame.b2);
  return frame;
}

bool read_point(const tv_point& point, double baseline, BundlePoint* out) {
  if (point.status != TV_POINT_OK && point.status != TV_POINT_INFINITE) return false;
  double largest = 0.0;
  for (double x : point.position) {
    if (!is_finite(x)) return false;
    if (std::fabs(x) > largest) largest = std::fabs(x);
  }
  if (!(largest > 0.0)) return false;
  double scaled[3];
  for (int i = 0; i < 3; ++i) scaled[i] = point.position[i] / largest;
  const double length = length_of(scaled);
  for (int i = 0; i < 3; ++i) out->direction[i] = scaled[i] / length;
  out->inverse_distance = point.status == TV_POINT_INFINITE ? 0.0 : baseline / largest / length;
  return out->inverse_distance <= kMaxInverseDistance;
}

BundlePoint moved_point(const BundlePoint& point, const double move[3]) {
  double e1[3], e2[3];
  sphere_basis(point.direction, e1, e2);
  BundlePoint result;
  for (int i = 0; i < 3; ++i) {
    result.direction[i] = point.direction[i] + (move[0] * e1[i] + move[1] * e2[i]);
  }
  const double scale = 1.0 / length_of(result.direction);
  for (int i = 0; i < 3; ++i) result.direction[i] *= scale;
  result.inverse_distance = (point.inverse_distance + move[2]) * scale;
  return result;
}

bool linearise(const Camera cameras[2], const BundleFrame& frame, const BundlePoint& point,
               const Vec2& pixel0, const Vec2& pixel1, BundleMatch* match) {
  const double* d = point.direction;
  double X1[3];
  rotate(frame.R, d, X1);
  for (int i = 0; i < 3; ++i) X1[i] += point.inverse_distance * frame.t[i];
  Vec2 seen0, seen1;
  Mat23 J0, J1;
  if (!project(cameras[0], Vec3(d[0], d[1], d[2]), &seen0, &J0) ||
      !project(cameras[1], Vec3(X1[0], X1[1], X1[2]), &seen1, &J1)) {
    return false;
  }
  double e1[3], e2[3], A[2][2];
  sphere_basis(d, e1, e2);
  for (int i = 0; i < 2; ++i) {
    const double row[3] = {J0(i, 0), J0(i, 1), J0(i, 2)};
    A[i][0] = dot(row, e1);
    A[i][1] = dot(row, e2);
  }
  const double inverse = 1.0 / (A[0][0] * A[1][1] - A[0][1] * A[1][0]);
  if (!is_finite(inverse)) return false;
  match->point = point;
  match->from_pixel0[0][0] = A[1][1] * inverse;
  match->from_pixel0[0][1] = -A[0][1] * inverse;
  match->from_pixel0[1][0] = -A[1][0] * inverse;
  match->from_pixel0[1][1] = A[0][0] * inverse;
  for (int i = 0; i < 2; ++i) {
    match->error[0][i] = seen0[i] - pixel0[i];
    match->error[1][i] = seen1[i] - pixel1[i];
    for (int j = 0; j < 3; ++j) match->jacobian1[i][j] = J1(i, j);
  }
  return true;
}

static void scale(double* values, int count, double factor) {
  for (int k = 0; k < count; ++k) values[k] *= factor;
}

bool linearise(const BundleProblem& problem, const BundleFrame& frame, const BundlePoint& point,
               int32_t i, BundleMatch* match) {
  if (!linearise(problem.camera, frame, point, pixel_of(problem, 0, i), pixel_of(problem, 1, i),
                 match)) {
    return false;
  }
  const double sigma0 = sigma_of(problem, 0, i), sigma1 = sigma_of(problem, 1, i);
  scale(match->error[0], 2, 1 / sigma0);
  scale(match->error[1], 2, 1 / sigma1);
  scale(match->from_pixel0[0], 4, sigma0);
  scale(match->jacobian1[0], 6, 1 / sigma1);
  return true;
}

double error_sq(const BundleMatch& match) {
  const double(*e)[2] = match.error;
  return (e[0][0] * e[0][0] + e[0][1] * e[0][1]) + (e[1][0] * e[1][0] + e[1][1] * e[1][1]);
}

Elimination eliminate(const BundleFrame& frame, const BundleMatch& match) {
  Elimination e;
  const double* d = match.point.direction;
  double e1[3], e2[3], Re1[3], Re2[3], Rd[3];
  sphere_basis(d, e1, e2);
  rotate(frame.R, d, Rd);
  rotate(frame.R, e1, Re1);
  rotate(frame.R, e2, Re2);
  double c[2];
  for (int i = 0; i < 2; ++i) {
    const double* row = match.jacobian1[i];
    e.B[i][0] = dot(row, Re1);
    e.B[i][1] = dot(row, Re2);
    c[i] = dot(row, frame.t.data());
  }
  e.length = std::sqrt(c[0] * c[0] + c[1] * c[1]);
  if (!(e.length > 0.0)) {  // a point on the baseline, where any direction of the error is along it
    e.r = e.along[0] = e.along[1] = e.k[0] = e.k[1] = 0.0;
    for (double& a : e.a) a = 0.0;
    return e;
  }
  e.along[0] = c[0] / e.length;
  e.along[1] = c[1] / e.length;
  // What moves across `along` (unit n) does not depend on the depth: n.e1 + m.step, m = B'n; with
  // image 0's residual y = e0 + A step that is q + k.y, k = A^-T m and q = n.e1 - k.e0. Its least
  // square together with |y|^2 is q^2 / (1 + |k|^2).
  const double n[2] = {-e.along[1], e.along[0]};
  const double m[2] = {n[0] * e.B[0][0] + n[1] * e.B[1][0], n[0] * e.B[0][1] + n[1] * e.B[1][1]};
  for (int i = 0; i < 2; ++i) {
    e.k[i] = m[0] * match.from_pixel0[0][i] + m[1] * match.from_pixel0[1][i];
  }
  const double scale = 1.0 / std::sqrt(1.0 + (e.k[0] * e.k[0] + e.k[1] * e.k[1]));
  const double* e0 = match.error[0];
  const double* e1_px = match.error[1];
  e.r = scale * ((n[0] * e1_px[0] + n[1] * e1_px[1]) - (e.k[0] * e0[0] + e.k[1] * e0[1]));
  double j[3];
  for (int i = 0; i < 3; ++i) {
    j[i] = scale * (n[0] * match.jacobian1[0][i] + n[1] * match.jacobian1[1][i]);
  }
  for (int i = 0; i < 3; ++i) {
    const int u = (i + 1) % 3, v = (i + 2) % 3;
    e.a[i] = Rd[u] * j[v] - Rd[v] * j[u];
  }
  e.a[3] = match.point.inverse_distance * dot(j, frame.b1.data());
  e.a[4] = match.point.inverse_distance * dot(j, frame.b2.data());
  return e;
}

// Given y, the residual of image 0, the minimum of |y|^2 + (q + k.y)^2 is at
// y = -k q / (1 + |k|^2).
void linear_step(const BundleFrame& frame, const BundleMatch& match, const Elimination& e,
                 const double step[5], double move[3]) {
  const double rho = match.point.inverse_distance;
  double Rd[3], moved[3], g[2];
  rotate(frame.R, match.point.direction, Rd);
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const double slide = step[3] * frame.b1[i] + step[4] * frame.b2[i];
    moved[i] = (step[j] * Rd[k] - step[k] * Rd[j]) + rho * slide;
  }
  for (int i = 0; i < 2; ++i) g[i] = match.error[1][i] + dot(match.jacobian1[i], moved);
  const double* e0 = match.error[0];
  const double q = (e.along[0] * g[1] - e.along[1] * g[0]) - (e.k[0] * e0[0] + e.k[1] * e0[1]);
  const double share = -q / (1.0 + (e.k[0] * e.k[0] + e.k[1] * e.k[1]));
  const double y[2] = {share * e.k[0] - e0[0], share * e.k[1] - e0[1]};
  for (int i = 0; i < 2; ++i) {
    move[i] = match.from_pixel0[i][0] * y[0] + match.from_pixel0[i][1] * y[1];
  }
  double left = 0.0;
  for (int i = 0; i < 2; ++i) {
    left += e.along[i] * (g[i] + (e.B[i][0] * move[0] + e.B[i][1] * move[1]));
  }
  move[2] = e.length > 0.0 ? -left / e.length : 0.0;
}

// T. Duff et al., "Building an orthonormal basis, revisited", JCGT 2017.
void sphere_basis(const double d[3], double e1[3], double e2[3]) {
  const double sign = d[2] < 0.0 ? -1.0 : 1.0;
  const double a = -1.0 / (sign + d[2]);
  const double b = d[0] * d[1] * a;
  e1[0] = 1.0 + sign * d[0] * d[0] * a;
  e1[1] = sign * b;
  e1[2] = -sign * d[0];
  e2[0] = b;
  e2[1] = sign + d[1] * d[1] * a;
  e2[2] = -d[1];
}

}  // namespace tv
