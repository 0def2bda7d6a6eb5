// Test: test/unit/test_triangulation.cc, test_triangulation_opencv.cc.
#include "triangulation/linear.h"

namespace tv {
namespace {

constexpr int kMaxReweightings = 10;  // the bound that Hartley & Sturm use
constexpr double kSettled = 1e-10;    // relative change of both depths that ends the reweighting

// ---- Linear-LS and Iterative-LS ----
//
// Each camera gives two equations n . X = 0 whose vectors n are orthogonal to its ray. On the image
// plane they are Hartley & Sturm's u p3 - p1 and v p3 - p2, in pixels of the undistorted image; for
// a camera that sees beyond a half space, where that plane does not exist, they are two directions
// of the plane tangent to the viewing sphere at the ray. With X = depth ray0 + across . basis, the
// equations of camera 0 read across = 0, those of camera 1 A across + m depth + b = 0, and least
// squares over (across, depth) with row weights needs one division for the depth. No normal matrix
// in X is formed, because its condition number grows with the square of the depth; that of this
// system does not. LinearSystem holds camera 1's two equations in these unknowns.
struct LinearSystem {
  double A[2][2], m[2], b[2];
  double cov0[3], cov1[3];  // entries xx, xy, yy of the residuals' covariance at unit weights
  Vec3 depth1_of;           // the depth in camera 1 is depth1_of . X + depth1_of_t
  double depth1_of_t;
};

LinearSystem linear_system(const TriangulationPair& pair, const RayFrame& frame0,
                           const RayFrame& frame1) {
  LinearSystem s;
  for (int row = 0; row < 2; ++row) {
    const Vec3 n = rotate(pair.cam0_from_cam1_R, frame1.rows[row]);
    s.A[row][0] = dot(n, frame0.basis[0]);
    s.A[row][1] = dot(n, frame0.basis[1]);
    s.m[row] = dot(n, frame0.ray);
    s.b[row] = dot(frame1.rows[row], pair.direction);
  }
  const double f0[2] = {frame0.pixel[0] * frame0.pixel[0], frame0.pixel[1] * frame0.pixel[1]};
  s.cov0[0] = s.A[0][0] * s.A[0][0] * f0[0] + s.A[0][1] * s.A[0][1] * f0[1];
  s.cov0[1] = s.A[0][0] * s.A[1][0] * f0[0] + s.A[0][1] * s.A[1][1] * f0[1];
  s.cov0[2] = s.A[1][0] * s.A[1][0] * f0[0] + s.A[1][1] * s.A[1][1] * f0[1];
  s.cov1[0] = frame1.pixel[0] * frame1.pixel[0];
  s.cov1[1] = 0.0;
  s.cov1[2] = frame1.pixel[1] * frame1.pixel[1];
  s.depth1_of = rotate(pair.cam0_from_cam1_R, frame1.depth);
  s.depth1_of_t = dot(frame1.depth, pair.direction);
  return s;
}

// Least squares with the equations of camera i weighted by 1 / depth_i: the residuals m depth + b
// have the covariance C = depth0^2 cov0 + depth1^2 cov1, so depth = -(m C^-1 b) / (m C^-1 m), and
// the remaining residual, carried into camera 0's image by A, gives `across`. The division of C^-1
// by det C is left out where only a ratio matters.
struct Solution {
  double depth0, depth1;
  Vec3 position;
};

Solution solve_weighted(const LinearSystem& s, const RayFrame& frame0, double weight0_sq,
                        double weight1_sq) {
  const double xx = weight0_sq * s.cov0[0] + weight1_sq * s.cov1[0];
  const double xy = weight0_sq * s.cov0[1] + weight1_sq * s.cov1[1];
  const double yy = weight0_sq * s.cov0[2] + weight1_sq * s.cov1[2];
  const double m0 = yy * s.m[0] - xy * s.m[1];  // C^-1 m times det C
  const double m1 = xx * s.m[1] - xy * s.m[0];
  Solution out;
  out.depth0 = -(m0 * s.b[0] + m1 * s.b[1]) / (m0 * s.m[0] + m1 * s.m[1]);
  const double e0 = s.m[0] * out.depth0 + s.b[0];
  const double e1 = s.m[1] * out.depth0 + s.b[1];
  const double factor = -weight0_sq / (xx * yy - xy * xy);
  const double r0 = factor * (yy * e0 - xy * e1);
  const double r1 = factor * (xx * e1 - xy * e0);
  const double* pixel = frame0.pixel;
  const double across0 = pixel[0] * pixel[0] * (s.A[0][0] * r0 + s.A[1][0] * r1);
  const double across1 = pixel[1] * pixel[1] * (s.A[0][1] * r0 + s.A[1][1] * r1);
  const Vec3 across = combine(across0, frame0.basis[0], across1, frame0.basis[1]);
  out.position = combine(out.depth0, frame0.ray, 1.0, across);
  out.depth1 = dot(s.depth1_of, out.position) + s.depth1_of_t;
  return out;
}

bool has_settled(double now, double before) {
  return std::fabs(now - before) <= kSettled * std::fabs(now);
}

// Returns |depth0| and |depth1|, both divided by the larger one: only the ratio of the weights 1 /
// depth matters, and the squares of the scaled depths cannot overflow.
struct Depths {
  double first, second;
};

Depths scaled_depths(double depth0, double depth1) {
  const double size0 = std::fabs(depth0), size1 = std::fabs(depth1);
  const double largest = size0 > size1 ? size0 : size1;
  return Depths{size0 / largest, size1 / largest};
}

// ---- Linear-Eigen and Iterative-Eigen ----
//
// The unit 4-vector (X, W) of the least |A (X, W)|^2, A the same four equations. In coordinates
// along camera 0's ray and across it, still orthonormal, camera 0's rows are [N 0] and camera 1's
// [B D], 2x2 blocks: N is well conditioned; det D is small, of the order of the parallax times the
// distance of the rays. The smallest singular vector is found by inverse iteration with (A^T A)^-1,
// without its division by (det D)^2: the length of the vector does not matter, and for exact
// matches det D is 0.
struct Homogeneous {
  double n[2][2], b[2][2], d[2][2];
  Vec3 across[2], along;
  Vec3 depth1_of;
  double depth0_of[3], depth1_of_t;
};

struct Vec4 {
  double x[4];
};

Homogeneous homogeneous_system(const TriangulationPair& pair, const RayFrame& frame0,
                               const RayFrame& frame1) {
  Homogeneous s;
  const double scale = 1.0 / std::sqrt(dot(frame0.ray, frame0.ray));
  s.along = Vec3(frame0.ray[0] * scale, frame0.ray[1] * scale, frame0.ray[2] * scale);
  complete_basis(s.along, &s.across[0], &s.across[1]);
  for (int row = 0; row < 2; ++row) {
    const Vec3 n1 = rotate(pair.cam0_from_cam1_R, frame1.rows[row]);
    for (int k = 0; k < 2; ++k) {
      s.n[row][k] = dot(frame0.rows[row], s.across[k]) / frame0.pixel[row];
      s.b[row][k] = dot(n1, s.across[k]) / frame1.pixel[row];
    }
    s.d[row][0] = dot(n1, s.along) / frame1.pixel[row];
    s.d[row][1] = dot(frame1.rows[row], pair.direction) / frame1.pixel[row];
  }
  for (int k = 0; k < 2; ++k) s.depth0_of[k] = dot(frame0.depth, s.across[k]);
  s.depth0_of[2] = dot(frame0.depth, s.along);
  s.depth1_of = rotate(pair.cam0_from_cam1_R, frame1.depth);
  s.depth1_of_t = dot(frame1.depth, pair.direction);
  return s;
}

Vec3 direction_of(const Homogeneous& s, const Vec4& v) {
  const Vec3 across = combine(v.x[0], s.across[0], v.x[1], s.across[1]);
  return combine(1.0, across, v.x[2], s.along);
}

// (det D)^2 (A^T A)^-1 v, with camera 0's rows of A divided by w0 and camera 1's by w1.
Vec4 inverse_times(const Homogeneous& s, double w0, double w1, const Vec4& v) {
  const double det_d = s.d[0][0] * s.d[1][1] - s.d[0][1] * s.d[1][0];
  const double det_n = s.n[0][0] * s.n[1][1] - s.n[0][1] * s.n[1][0];
  // det(D) y, where A^T y = v, for rows without weights.
  const double y2 = s.d[1][1] * v.x[2] - s.d[1][0] * v.x[3];
  const double y3 = s.d[0][0] * v.x[3] - s.d[0][1] * v.x[2];
  const double a0 = det_d * v.x[0] - (s.b[0][0] * y2 + s.b[1][0] * y3);
  const double a1 = det_d * v.x[1] - (s.b[0][1] * y2 + s.b[1][1] * y3);
  const double y0 = (s.n[1][1] * a0 - s.n[1][0] * a1) / det_n;
  const double y1 = (s.n[0][0] * a1 - s.n[0][1] * a0) / det_n;
  // det(D)^2 z, where A z = y; each row's weight enters squared.
  const double f0 = w0 * w0, f1 = w1 * w1;
  const double z0 = f0 * (s.n[1][1] * y0 - s.n[0][1] * y1) / det_n;
  const double z1 = f0 * (s.n[0][0] * y1 - s.n[1][0] * y0) / det_n;
  const double c0 = f1 * y2 - (s.b[0][0] * z0 + s.b[0][1] * z1);
  const double c1 = f1 * y3 - (s.b[1][0] * z0 + s.b[1][1] * z1);
  return Vec4{
      {det_d * z0, det_d * z1, s.d[1][1] * c0 - s.d[0][1] * c1, s.d[0][0] * c1 - s.d[1][0] * c0}};
}

double product(const Vec4& a, const Vec4& b) {
  return (a.x[0] * b.x[0] + a.x[1] * b.x[1]) + (a.x[2] * b.x[2] + a.x[3] * b.x[3]);
}

Vec4 scaled(const Vec4& v, double by) {
  return Vec4{{v.x[0] * by, v.x[1] * by, v.x[2] * by, v.x[3] * by}};
}

// The smallest singular vector where the two smallest singular values are so close that inverse
// iteration has not converged. Each squaring of (A^T A)^-1 squares their ratio: after thirteen
// squarings the matrix has rank one, or the two are equal within rounding and the vector is not
// unique.
Vec4 by_squaring(const Homogeneous& s, double w0, double w1) {
  Vec4 column[4];
  for (int k = 0; k < 4; ++k) {
    Vec4 unit{{0.0, 0.0, 0.0, 0.0}};
    unit.x[k] = 1.0;
    column[k] = inverse_times(s, w0, w1, unit);
  }
  int largest = 0;
  for (int round = 0; round <= 12; ++round) {
    largest = 0;
    for (int k = 1; k < 4; ++k) {
      if (column[k].x[k] > column[largest].x[largest]) largest = k;
    }
    const double by = 1.0 / column[largest].x[largest];
    Vec4 before[4];
    for (int k = 0; k < 4; ++k) before[k] = scaled(column[k], by);
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 4; ++k) column[i].x[k] = product(before[i], before[k]);
    }
  }
  return scaled(column[largest], 1.0 / std::sqrt(product(column[largest], column[largest])));
}

Vec4 smallest_singular_vector(const Homogeneous& s, double w0, double w1, Vec4 v) {
  for (int i = 0; i < 12; ++i) {
    Vec4 next = inverse_times(s, w0, w1, v);
    next = scaled(next, 1.0 / std::sqrt(product(next, next)));
    const double turned = product(next, v);
    Vec4 step;
    for (int k = 0; k < 4; ++k) step.x[k] = turned < 0.0 ? next.x[k] + v.x[k] : next.x[k] - v.x[k];
    v = next;
    if (i > 0 && product(step, step) <= 1e-26) return v;
  }
  return by_squaring(s, w0, w1);
}

}  // namespace

Vec3 solve_least_squares(const TriangulationPair& pair, const RayFrame& frame0,
                         const RayFrame& frame1, bool iterative) {
  const LinearSystem system = linear_system(pair, frame0, frame1);
  const Solution linear = solve_weighted(system, frame0, 1.0, 1.0);
  Solution before = linear;
  for (int i = 0; iterative && i < kMaxReweightings; ++i) {
    const Depths w = scaled_depths(before.depth0, before.depth1);
    const Solution now = solve_weighted(system, frame0, w.first * w.first, w.second * w.second);
    if (has_settled(now.depth0, before.depth0) && has_settled(now.depth1, before.depth1)) {
      return now.position;
    }
    before = now;
  }
  return linear.position;
}

Vec3 solve_eigen(const TriangulationPair& pair, const RayFrame& frame0, const RayFrame& frame1,
                 bool iterative) {
  const Homogeneous system = homogeneous_system(pair, frame0, frame1);
  const Vec4 linear = smallest_singular_vector(system, 1.0, 1.0, Vec4{{0.0, 0.0, 1.0, 1.0}});
  Vec4 now = linear;
  Depths before{1.0, 1.0};
  bool settled = !iterative;
  for (int i = 0; !settled && i < kMaxReweightings; ++i) {
    const double depth0 = (system.depth0_of[0] * now.x[0] + system.depth0_of[1] * now.x[1]) +
                          system.depth0_of[2] * now.x[2];
    const double depth1 =
        dot(system.depth1_of, direction_of(system, now)) + system.depth1_of_t * now.x[3];
    const Depths w = scaled_depths(depth0, depth1);
    settled = i > 0 && has_settled(w.first, before.first) && has_settled(w.second, before.second);
    if (settled) break;
    before = w;
    now = smallest_singular_vector(system, w.first, w.second, now);
  }
  if (!settled) now = linear;
  const Vec3 direction = direction_of(system, now);
  return Vec3(direction[0] / now.x[3], direction[1] / now.x[3], direction[2] / now.x[3]);
}

}  // namespace tv
