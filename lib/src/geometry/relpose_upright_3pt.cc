// O. Naroditsky, X. S. Zhou, J. Gallier, S. I. Roumeliotis, K. Daniilidis, "Two efficient solutions
// for visual odometry using directional correspondence", PAMI 2012: with one direction known in
// both views, three points give a quartic equation. The derivation here:
// docs/algorithms/gravity.md.
//
// In level frames x1 = Rz(yaw) x0 + t, so that t is orthogonal to the three vectors
// n_k = (Rz p_k) x q_k, and det(n_0, n_1, n_2) = 0 in the yaw alone. Written with complex numbers
// P = px + i py, Q = qx + i qy, u = exp(i yaw):
//   n_xy = i (pz Q - qz u P),   n_z = Im(conj(u P) Q),
//   det = sum over cyclic (i, j, k) of n_z,k Im(conj(n_xy,i) n_xy,j).
// In the second factor, every product u conj(u) is 1, so the determinant has degree 2 in (cos,
// sin), not 3, and is a quartic in tan(yaw / 2), not a polynomial of degree six.
#include "geometry/relpose_upright_3pt.h"

#include <cmath>

#include "geometry/polynomial.h"

namespace tv {
namespace {

// The function c cos + s sin + cc cos^2 + ss sin^2 + cs cos sin of the yaw.
struct YawPolynomial {
  double c, s, cc, ss, cs;
};

YawPolynomial yaw_polynomial(const Vec3 p[3], const Vec3 q[3]) {
  YawPolynomial f{0, 0, 0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    // conj(n_xy,i) n_xy,j = A + B u + C conj(u); its imaginary part is m0 + mc cos + ms sin.
    const double zz = p[i][2] * p[j][2], ww = q[i][2] * q[j][2];
    const double zw = p[i][2] * q[j][2], wz = q[i][2] * p[j][2];
    const double m0 =
        zz * (q[i][0] * q[j][1] - q[i][1] * q[j][0]) + ww * (p[i][0] * p[j][1] - p[i][1] * p[j][0]);
    const double mc =
        zw * (q[i][1] * p[j][0] - q[i][0] * p[j][1]) + wz * (p[i][1] * q[j][0] - p[i][0] * q[j][1]);
    const double ms =
        wz * (p[i][0] * q[j][0] + p[i][1] * q[j][1]) - zw * (q[i][0] * p[j][0] + q[i][1] * p[j][1]);
    // n_z,k = a cos - b sin
    const double a = p[k][0] * q[k][1] - p[k][1] * q[k][0];
    const double b = p[k][0] * q[k][0] + p[k][1] * q[k][1];
    f.c += a * m0;
    f.s -= b * m0;
    f.cc += a * mc;
    f.ss -= b * ms;
    f.cs += a * ms - b * mc;
  }
  return f;
}

// Returns f as a function of yaw - offset, given the offset's cosine and sine.
YawPolynomial turned(const YawPolynomial& f, double cosine, double sine) {
  const double c2 = cosine * cosine, s2 = sine * sine, product = cosine * sine;
  return YawPolynomial{f.c * cosine + f.s * sine, f.s * cosine - f.c * sine,
                       (f.cc * c2 + f.ss * s2) + f.cs * product,
                       (f.cc * s2 + f.ss * c2) - f.cs * product,
                       2 * (f.ss - f.cc) * product + f.cs * (c2 - s2)};
}

// The cosine and sine of multiples of 72 degrees. The unknown is the tangent of half of yaw -
// offset, with one of these as the offset; it is infinite half a turn from the offset. A polynomial
// with five coefficients cannot vanish at all of five angles, so an offset exists for which no root
// is there.
constexpr double kOffsets[5][2] = {{1, 0},
                                   {0.30901699437494745, 0.95105651629515353},
                                   {-0.80901699437494745, 0.58778525229247314},
                                   {-0.80901699437494745, -0.58778525229247314},
                                   {0.30901699437494745, -0.95105651629515353}};

double at_half_turn(const YawPolynomial& f, const double offset[2]) {
  const double c = -offset[0], s = -offset[1];
  return c * (f.c + f.cc * c) + s * (f.s + f.ss * s + f.cs * c);
}

int best_offset(const YawPolynomial& f) {
  int best = 0;
  double largest = 0;
  for (int k = 0; k < 5; ++k) {
    const double size = std::fabs(at_half_turn(f, kOffsets[k]));
    if (size > largest) {
      largest = size;
      best = k;
    }
  }
  return best;
}

// The direction orthogonal to all three n_k at a root: the longest cross product of two of them.
Vec3 translation(const Vec3 p[3], const Vec3 q[3], double cosine, double sine) {
  Vec3 n[3];
  for (int k = 0; k < 3; ++k) {
    const Vec3 turned(cosine * p[k][0] - sine * p[k][1], sine * p[k][0] + cosine * p[k][1],
                      p[k][2]);
    n[k] = turned.cross(q[k]);
  }
  Vec3 best = Vec3::Zero();
  double best_sq = 0;
  for (int k = 0; k < 3; ++k) {
    const Vec3 cross = n[k].cross(n[(k + 1) % 3]);
    const double sq = cross.squaredNorm();
    if (sq > best_sq) {
      best_sq = sq;
      best = cross;
    }
  }
  return best_sq > 0 && best_sq < 1e300 ? Vec3(best / std::sqrt(best_sq)) : Vec3(Vec3::Zero());
}

}  // namespace

Mat3 level_from_camera(const Vec3& down) {
  Vec3 b1, b2;
  tangent_basis(down, &b1, &b2);
  Mat3 level;
  level.row(0) = b1.transpose();
  level.row(1) = b2.transpose();
  level.row(2) = down.transpose();
  return level;
}

int relpose_upright_3pt(const Vec3 rays0[3], const Vec3 rays1[3], const Mat3& level0,
                        const Mat3& level1, Pose poses[kMaxRelposeUpright3pt]) {
  Vec3 p[3], q[3];
  for (int k = 0; k < 3; ++k) {
    p[k] = level0 * rays0[k];
    q[k] = level1 * rays1[k];
  }
  const YawPolynomial f = yaw_polynomial(p, q);
  const double* offset = kOffsets[best_offset(f)];
  const YawPolynomial g = turned(f, offset[0], offset[1]);
  // x = tan of half of yaw - offset: cos = (1 - x^2) / (1 + x^2), sin = 2 x / (1 + x^2).
  const double quartic[5] = {g.c + g.cc, 2 * (g.s + g.cs), 4 * g.ss - 2 * g.cc, 2 * (g.s - g.cs),
                             g.cc - g.c};
  double roots[4];
  const int num_roots = real_roots(quartic, 4, roots);
  int num_poses = 0;
  for (int r = 0; r < num_roots; ++r) {
    const double x = roots[r], scale = 1 / (1 + x * x);
    const double c = (1 - x * x) * scale, s = 2 * x * scale;
    const double cosine = offset[0] * c - offset[1] * s, sine = offset[1] * c + offset[0] * s;
    const Vec3 t = translation(p, q, cosine, sine);
    if (!(t.squaredNorm() > 0)) continue;
    Mat3 yaw;
    yaw << cosine, -sine, 0, sine, cosine, 0, 0, 0, 1;
    poses[num_poses].R = level1.transpose() * (yaw * level0);
    poses[num_poses].t = level1.transpose() * t;
    ++num_poses;
  }
  return num_poses;
}

}  // namespace tv
