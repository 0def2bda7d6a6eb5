#include "pose/absolute_pose_3pt.h"

#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/math.h"
#include "geometry/vector3.h"

namespace tv {
namespace {

// A power of two that is at least the cube root of x > 0, and less than four times as large.
double above_cube_root(double x) {
  uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  const int exponent = static_cast<int>(bits >> 52) - 1023;  // x < 2^(exponent + 1)
  const int third = exponent >= 0 ? exponent / 3 + 1 : -(-exponent / 3) + 1;
  bits = static_cast<uint64_t>(third + 1023) << 52;
  double root;
  std::memcpy(&root, &bits, sizeof root);
  return root;
}

// The real root of x^3 + a x^2 + b x + c that lies farthest from the inflection: it is never the
// double one. Newton's method from beyond the root, where the steps do not change their direction.
double outer_root(double a, double b, double c) {
  const double middle = -a / 3;
  const double p = b + a * middle, q = c + middle * (b + (2.0 / 3.0) * a * middle);
  if (q == 0 && !(p < 0)) return middle;  // x^3 + p x + q about the inflection
  const double sign = q > 0 ? -1 : 1;
  double x = (p < 0 ? std::sqrt(-p) : 0) + (q != 0 ? above_cube_root(std::fabs(q)) : 0);
  for (int iteration = 0; iteration < 40; ++iteration) {
    const double value = (x * x + p) * x - std::fabs(q), slope = 3 * x * x + p;
    if (!(value > 0) || !(slope > 0)) break;
    const double step = value / slope;
    x -= step;
    if (!(step > 1e-9 * x)) break;  // the next step would be below rounding
  }
  return middle + sign * x;
}

// A symmetric 3x3 matrix of a conic, xx xy xz yy yz zz.
struct Conic {
  double m[6];
};

constexpr int kPlace[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

Conic adjugate(const Conic& C) {
  const double* m = C.m;
  return {{m[3] * m[5] - m[4] * m[4], m[2] * m[4] - m[1] * m[5], m[1] * m[4] - m[2] * m[3],
           m[0] * m[5] - m[2] * m[2], m[1] * m[2] - m[0] * m[4], m[0] * m[3] - m[1] * m[1]}};
}

double trace_of_product(const Conic& A, const Conic& B) {
  return (A.m[0] * B.m[0] + A.m[3] * B.m[3] + A.m[5] * B.m[5]) +
         2 * (A.m[1] * B.m[1] + A.m[2] * B.m[2] + A.m[4] * B.m[4]);
}

void multiply(const Conic& C, const double v[3], double product[3]) {
  for (int i = 0; i < 3; ++i) {
    product[i] = (C.m[kPlace[i][0]] * v[0] + C.m[kPlace[i][1]] * v[1]) + C.m[kPlace[i][2]] * v[2];
  }
}

// Splits a degenerate conic into its lines l and m, l m' + m l' = C up to scale: with p the point
// where they meet, adj(C) = -k p p', and C + [p]x, for the right length of p, has rank one (J.
// Richter-Gebert, "Perspectives on projective geometry", 11.1). False where the lines are not real.
bool split(const Conic& C, double lines[2][3]) {
  const Conic B = adjugate(C);
  int k = 0;
  double size = 0;
  for (int i = 0; i < 3; ++i) {
    if (std::fabs(B.m[kPlace[i][i]]) > std::fabs(B.m[kPlace[k][k]])) k = i;
  }
  for (const double x : C.m) size += x * x;
  const double largest = B.m[kPlace[k][k]];
  if (!(size > 0) || largest > 1e-12 * size) return false;
  // With two equal lines the adjugate, and with it p, is zero.
  const double scale = largest < 0 ? 1 / std::sqrt(-largest) : 0;
  double N[3][3];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, l = (i + 2) % 3;
    const double p = scale * B.m[kPlace[k][i]];
    N[i][i] = C.m[kPlace[i][i]];
    N[j][l] = C.m[kPlace[j][l]] - p;
    N[l][j] = C.m[kPlace[j][l]] + p;
  }
  int place = 0;
  for (int i = 1; i < 9; ++i) {
    if (std::fabs(N[i / 3][i % 3]) > std::fabs(N[place / 3][place % 3])) place = i;
  }
  for (int i = 0; i < 3; ++i) {
    lines[0][i] = N[place / 3][i];
    lines[1][i] = N[i][place % 3];
  }
  return true;
}

// The directions of the points where a line meets a conic; both are the same where it touches.
bool meet(const double line[3], const Conic& C, double points[2][3]) {
  // Two points of the line: its products with the two axes along which it is the shorter.
  int k = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::fabs(line[i]) > std::fabs(line[k])) k = i;
  }
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  double u[3] = {}, v[3] = {}, Cu[3], Cv[3];
  u[i] = v[j] = line[k];
  u[k] = -line[i];
  v[k] = -line[j];
  multiply(C, u, Cu);
  multiply(C, v, Cv);
  // (a u + b v)' C (a u + b v) = A a^2 + 2 B a b + D b^2
  const double A = dot(u, Cu), B = dot(u, Cv), D = dot(v, Cv);
  double root_sq = B * B - A * D;
  // Rounding alone may separate two equal points.
  if (!(root_sq >= -1e-10 * (B * B + std::fabs(A * D)))) return false;
  if (root_sq < 0) root_sq = 0;
  const double root = std::sqrt(root_sq);
  const double q = B < 0 ? root - B : -(B + root);
  for (int c = 0; c < 3; ++c) {
    points[0][c] = q * u[c] + A * v[c];
    points[1][c] = D * u[c] + q * v[c];
  }
  return true;
}

// The three equations d_i^2 + d_j^2 - 2 c_ij d_i d_j = a_ij of the depths.
struct Triangle {
  double cosine[3], side_sq[3];  // of 01, 02, 12
};

constexpr int kFrom[3] = {0, 0, 1}, kTo[3] = {1, 2, 2};

void measure_sides(const double points[3][3], double side_sq[3]) {
  for (int k = 0; k < 3; ++k) {
    side_sq[k] = 0;
    for (int c = 0; c < 3; ++c) {
      const double difference = points[kFrom[k]][c] - points[kTo[k]][c];
      side_sq[k] += difference * difference;
    }
  }
}

double errors(const Triangle& triangle, const double d[3], double error[3]) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double a = d[kFrom[k]], b = d[kTo[k]];
    error[k] = (a * a + b * b) - 2 * triangle.cosine[k] * a * b - triangle.side_sq[k];
    sum += std::fabs(error[k]);
  }
  return sum;
}

// Newton's method on the depths, which removes the rounding errors of the pencil.
void polish(const Triangle& triangle, double d[3]) {
  double error[3];
  double size = errors(triangle, d, error);
  for (int iteration = 0; iteration < 2; ++iteration) {
    double J[3][2];  // the derivatives by the depths kFrom and kTo
    for (int k = 0; k < 3; ++k) {
      J[k][0] = d[kFrom[k]] - triangle.cosine[k] * d[kTo[k]];
      J[k][1] = d[kTo[k]] - triangle.cosine[k] * d[kFrom[k]];
    }
    // The rows (J00 J01 0), (J10 0 J11), (0 J20 J21) times the step are error / 2.
    const double determinant = -J[0][0] * J[1][1] * J[2][0] - J[0][1] * J[1][0] * J[2][1];
    const double inverse = 0.5 / determinant;
    const double e0 = error[0] * inverse, e1 = error[1] * inverse, e2 = error[2] * inverse;
    const double moved[3] = {
        d[0] + J[1][1] * J[2][0] * e0 + J[0][1] * (J[2][1] * e1 - J[1][1] * e2),
        d[1] + J[1][0] * J[2][1] * e0 + J[0][0] * (J[1][1] * e2 - J[2][1] * e1),
        d[2] + J[0][0] * J[2][0] * e1 + J[1][0] * (J[0][1] * e2 - J[2][0] * e0)};
    double moved_error[3];
    const double moved_size = errors(triangle, moved, moved_error);
    if (!(moved_size < size)) return;
    size = moved_size;
    for (int k = 0; k < 3; ++k) {
      d[k] = moved[k];
      error[k] = moved_error[k];
    }
  }
}

// An orthonormal frame, in rows, of the triangle of three points; false where they are on a line.
bool frame_of(const double points[3][3], double frame[3][3]) {
  double side[2][3];
  for (int k = 0; k < 3; ++k) {
    side[0][k] = points[1][k] - points[0][k];
    side[1][k] = points[2][k] - points[0][k];
  }
  cross(side[0], side[1], frame[2]);
  const double normal_sq = length_sq_of(frame[2]), side_sq = length_sq_of(side[0]);
  if (!(normal_sq > 1e-24 * side_sq * length_sq_of(side[1])) || !is_finite(normal_sq)) return false;
  const double of_side = 1 / std::sqrt(side_sq), of_normal = 1 / std::sqrt(normal_sq);
  for (int k = 0; k < 3; ++k) {
    frame[0][k] = side[0][k] * of_side;
    frame[2][k] *= of_normal;
  }
  cross(frame[2], frame[0], frame[1]);
  return true;
}

}  // namespace

int absolute_pose_3pt(const double rays_in[3][3], const double points_in[3][3],
                      Pose poses[kMaxAbsolutePose3pt]) {
  // Points 1 and 2 are those of the longest side, by which the other two equations are divided.
  double rays[3][3], points[3][3], side_sq[3];
  measure_sides(points_in, side_sq);
  int first = 0;
  if (side_sq[0] > side_sq[2] || side_sq[1] > side_sq[2]) first = side_sq[0] > side_sq[1] ? 2 : 1;
  for (int k = 0; k < 3; ++k) {
    const int from = (first + k) % 3;
    for (int c = 0; c < 3; ++c) {
      rays[k][c] = rays_in[from][c];
      points[k][c] = points_in[from][c];
    }
  }
  double world[3][3];
  if (!frame_of(points, world)) return 0;
  Triangle triangle;
  measure_sides(points, triangle.side_sq);
  for (int k = 0; k < 3; ++k) triangle.cosine[k] = dot(rays[kFrom[k]], rays[kTo[k]]);
  const double* c = triangle.cosine;
  const double ratio0 = triangle.side_sq[0] / triangle.side_sq[2];
  const double ratio1 = triangle.side_sq[1] / triangle.side_sq[2];
  const Conic D[2] = {{{1, -c[0], 0, 1 - ratio0, ratio0 * c[2], -ratio0}},
                      {{1, 0, -c[1], -ratio1, ratio1 * c[2], 1 - ratio1}}};
  // det(D1 + x D2); the conic of the larger determinant takes the leading place.
  const Conic A[2] = {adjugate(D[0]), adjugate(D[1])};
  double determinant[2];
  for (int k = 0; k < 2; ++k) determinant[k] = dot(D[k].m, A[k].m);
  const int one = std::fabs(determinant[0]) > std::fabs(determinant[1]) ? 1 : 0, two = 1 - one;
  double x = 0;  // with both determinants 0, D1 itself is degenerate
  if (std::fabs(determinant[two]) > 1e-300) {
    const double inverse = 1 / determinant[two];
    x = outer_root(trace_of_product(A[two], D[one]) * inverse,
                   trace_of_product(A[one], D[two]) * inverse, determinant[one] * inverse);
  }
  Conic pair = D[one];  // of lines, which meets both conics in the same points
  for (int k = 0; k < 6; ++k) pair.m[k] += x * D[two].m[k];
  double lines[2][3];
  if (!split(pair, lines)) return 0;
  const Conic& other = std::fabs(x) > 1 ? D[one] : D[two];
  const double sides = (side_sq[0] + side_sq[1]) + side_sq[2];
  int count = 0;
  double depths[4][3];
  int num_depths = 0;
  for (int l = 0; l < 2; ++l) num_depths += 2 * meet(lines[l], other, depths + num_depths);
  for (int l = 0; l < num_depths; ++l) {
    double* d = depths[l];
    const double sum_sq =
        2 * (length_sq_of(d) - c[0] * d[0] * d[1] - c[1] * d[0] * d[2] - c[2] * d[1] * d[2]);
    double scale = std::sqrt(sides / sum_sq);
    if (d[0] < 0) scale = -scale;
    if (!is_finite(scale)) continue;
    scale_by(scale, d);
    if (!(d[0] > 0 && d[1] > 0 && d[2] > 0)) continue;
    polish(triangle, d);
    double at[3][3], camera[3][3];
    for (int k = 0; k < 3; ++k) {
      for (int i = 0; i < 3; ++i) at[k][i] = d[k] * rays[k][i];
    }
    if (!(d[0] > 0 && d[1] > 0 && d[2] > 0) || !frame_of(at, camera)) continue;
    Pose& pose = poses[count++];
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) {
        pose.R(r, k) =
            (camera[0][r] * world[0][k] + camera[1][r] * world[1][k]) + camera[2][r] * world[2][k];
      }
    }
    double turned[3];
    rotate(pose.R, points[0], turned);
    for (int r = 0; r < 3; ++r) pose.t[r] = at[0][r] - turned[r];
  }
  return count;
}

}  // namespace tv
