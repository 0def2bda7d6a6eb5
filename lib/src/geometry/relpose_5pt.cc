// D. Nister, "An efficient solution to the five-point relative pose problem", PAMI 2004.
//
// The five epipolar constraints leave E = x X + y Y + z Z + W. The cubic constraints det E = 0 and
// 2 E E' E - tr(E E') E = 0 are ten equations in twenty monomials; elimination leaves a 3x3 matrix
// of polynomials in z, whose determinant has degree ten. Its real roots give x and y. Measured
// against the definition in test/unit/test_relpose_5pt.cc.
#include "geometry/relpose_5pt.h"

#include "geometry/null_space.h"
#include "geometry/polynomial.h"

#include <cmath>

namespace tv {
namespace {

// Linear polynomials over (x, y, z, 1); quadratic ones over (xx xy xz x yy yz y zz z 1); cubic ones
// over Nister's order (xxx yyy xxy xyy xxz xx yyz yy xyz xy | xzz xz x yzz yz y zzz zz z 1).
inline void add_product(const double a[4], const double b[4], double out[10]) {
  out[0] += a[0] * b[0];
  out[1] += a[0] * b[1] + a[1] * b[0];
  out[2] += a[0] * b[2] + a[2] * b[0];
  out[3] += a[0] * b[3] + a[3] * b[0];
  out[4] += a[1] * b[1];
  out[5] += a[1] * b[2] + a[2] * b[1];
  out[6] += a[1] * b[3] + a[3] * b[1];
  out[7] += a[2] * b[2];
  out[8] += a[2] * b[3] + a[3] * b[2];
  out[9] += a[3] * b[3];
}

inline void add_cubic_product(const double q[10], const double l[4], double out[20]) {
  out[0] += q[0] * l[0];
  out[1] += q[4] * l[1];
  out[2] += q[0] * l[1] + q[1] * l[0];
  out[3] += q[1] * l[1] + q[4] * l[0];
  out[4] += q[0] * l[2] + q[2] * l[0];
  out[5] += q[0] * l[3] + q[3] * l[0];
  out[6] += q[4] * l[2] + q[5] * l[1];
  out[7] += q[4] * l[3] + q[6] * l[1];
  out[8] += (q[1] * l[2] + q[2] * l[1]) + q[5] * l[0];
  out[9] += (q[1] * l[3] + q[3] * l[1]) + q[6] * l[0];
  out[10] += q[2] * l[2] + q[7] * l[0];
  out[11] += (q[2] * l[3] + q[3] * l[2]) + q[8] * l[0];
  out[12] += q[3] * l[3] + q[9] * l[0];
  out[13] += q[5] * l[2] + q[7] * l[1];
  out[14] += (q[5] * l[3] + q[6] * l[2]) + q[8] * l[1];
  out[15] += q[6] * l[3] + q[9] * l[1];
  out[16] += q[7] * l[2];
  out[17] += q[7] * l[3] + q[8] * l[2];
  out[18] += q[8] * l[3] + q[9] * l[2];
  out[19] += q[9] * l[3];
}

// The ten cubic constraints, a row each.
void cubic_constraints(const double basis[4][9], double rows[10][20]) {
  double e[9][4];  // E's entries as linear polynomials
  for (int i = 0; i < 9; ++i) {
    for (int b = 0; b < 4; ++b) e[i][b] = basis[b][i];
  }
  double gram[6][10] = {};  // E E': entries 00 01 02 11 12 22
  static constexpr int kGram[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) add_product(e[3 * i + k], e[3 * j + k], gram[kGram[i][j]]);
    }
  }
  for (int m = 0; m < 10; ++m) {  // E E' - tr(E E') / 2
    const double half_trace = 0.5 * ((gram[0][m] + gram[3][m]) + gram[5][m]);
    gram[0][m] -= half_trace;
    gram[3][m] -= half_trace;
    gram[5][m] -= half_trace;
  }
  for (int r = 0; r < 10; ++r) {
    for (int m = 0; m < 20; ++m) rows[r][m] = 0;
  }
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) {
        add_cubic_product(gram[kGram[i][k]], e[3 * k + j], rows[3 * i + j]);
      }
    }
  }
  for (int j = 0; j < 3; ++j) {  // determinant, by the first row
    const int a = (j + 1) % 3, b = (j + 2) % 3;
    double minor[10] = {}, negative[10] = {};
    add_product(e[3 + a], e[6 + b], minor);
    add_product(e[3 + b], e[6 + a], negative);
    for (int m = 0; m < 10; ++m) minor[m] -= negative[m];
    add_cubic_product(minor, e[j], rows[9]);
  }
}

// Gaussian elimination with partial pivoting of the left ten columns, then back substitution within
// the last six rows only: the first four are never used. False when singular.
bool eliminate(double rows[10][20]) {
  for (int k = 0; k < 10; ++k) {
    int pivot = k;
    double largest = std::fabs(rows[k][k]);
    for (int r = k + 1; r < 10; ++r) {
      const double value = std::fabs(rows[r][k]);
      if (value > largest) {
        largest = value;
        pivot = r;
      }
    }
    if (!(largest > 1e-14)) return false;
    if (pivot != k) {
      for (int c = k; c < 20; ++c) {
        const double swapped = rows[k][c];
        rows[k][c] = rows[pivot][c];
        rows[pivot][c] = swapped;
      }
    }
    const double inverse = 1.0 / rows[k][k];
    for (int c = k + 1; c < 20; ++c) rows[k][c] *= inverse;
    for (int r = k + 1; r < 10; ++r) {
      const double factor = rows[r][k];
      for (int c = k + 1; c < 20; ++c) rows[r][c] -= factor * rows[k][c];
    }
  }
  for (int k = 9; k > 4; --k) {
    for (int r = 4; r < k; ++r) {
      const double factor = rows[r][k];
      for (int c = 10; c < 20; ++c) rows[r][c] -= factor * rows[k][c];
    }
  }
  return true;
}

// The 3x3 matrix of polynomials in z, lowest power first: columns multiply x, y and 1.
struct ZMatrix {
  double x[3][4], y[3][4], one[3][5];
};

ZMatrix z_matrix(const double rows[10][20]) {
  ZMatrix b;
  for (int k = 0; k < 3; ++k) {  // row - z * next row
    const double* e = rows[4 + 2 * k];
    const double* f = rows[5 + 2 * k];
    b.x[k][0] = e[12];
    b.x[k][1] = e[11] - f[12];
    b.x[k][2] = e[10] - f[11];
    b.x[k][3] = -f[10];
    b.y[k][0] = e[15];
    b.y[k][1] = e[14] - f[15];
    b.y[k][2] = e[13] - f[14];
    b.y[k][3] = -f[13];
    b.one[k][0] = e[19];
    b.one[k][1] = e[18] - f[19];
    b.one[k][2] = e[17] - f[18];
    b.one[k][3] = e[16] - f[17];
    b.one[k][4] = -f[16];
  }
  return b;
}

void determinant(const ZMatrix& b, double polynomial[11]) {
  for (int m = 0; m < 11; ++m) polynomial[m] = 0;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    double minor[7] = {};
    for (int p = 0; p < 4; ++p) {
      for (int q = 0; q < 4; ++q) minor[p + q] += b.x[i][p] * b.y[j][q] - b.x[j][p] * b.y[i][q];
    }
    for (int p = 0; p < 5; ++p) {
      for (int q = 0; q < 7; ++q) polynomial[p + q] += b.one[k][p] * minor[q];
    }
  }
}

// (x, y, 1) up to scale at a root z: the longest cross product of two rows of the matrix.
Vec3 null_vector(const ZMatrix& b, double z) {
  Vec3 rows[3];
  for (int k = 0; k < 3; ++k) {
    rows[k][0] = ((b.x[k][3] * z + b.x[k][2]) * z + b.x[k][1]) * z + b.x[k][0];
    rows[k][1] = ((b.y[k][3] * z + b.y[k][2]) * z + b.y[k][1]) * z + b.y[k][0];
    rows[k][2] =
        (((b.one[k][4] * z + b.one[k][3]) * z + b.one[k][2]) * z + b.one[k][1]) * z + b.one[k][0];
  }
  Vec3 best = Vec3::Zero();
  double best_sq = 0;
  for (int k = 0; k < 3; ++k) {
    const Vec3 cross = rows[k].cross(rows[(k + 1) % 3]);
    const double sq = cross.squaredNorm();
    if (sq > best_sq) {
      best_sq = sq;
      best = cross;
    }
  }
  return best;
}

// Turns the basis about, by a fixed reflection without zeros. The null space comes with ones and
// zeros in it; the essential matrix of a camera that moved exactly along an axis has zeros too, and
// where they meet W would have no part in it: a root at infinity, in every sample.
void mix_basis(double basis[4][9]) {
  constexpr double v[4] = {1.0, 1.3, 1.7, 2.3};
  constexpr double scale = 2.0 / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]);
  for (int i = 0; i < 9; ++i) {
    const double along = scale * ((v[0] * basis[0][i] + v[1] * basis[1][i]) +
                                  (v[2] * basis[2][i] + v[3] * basis[3][i]));
    for (int b = 0; b < 4; ++b) basis[b][i] -= along * v[b];
  }
}

}  // namespace

int relpose_5pt(const Vec3 rays0[5], const Vec3 rays1[5], Mat3 essentials[kMaxRelpose5pt]) {
  double constraints[5][9], basis[4][9];  // basis: X, Y, Z, W
  for (int k = 0; k < 5; ++k) epipolar_row(rays0[k], rays1[k], constraints[k]);
  if (!null_space<5>(constraints, basis)) return 0;
  mix_basis(basis);
  double rows[10][20];
  cubic_constraints(basis, rows);
  if (!eliminate(rows)) return 0;
  const ZMatrix b = z_matrix(rows);
  double polynomial[11], roots[10];
  determinant(b, polynomial);
  const int num_roots = real_roots<10>(polynomial, roots);
  int num_models = 0;
  for (int r = 0; r < num_roots; ++r) {
    const double z = roots[r];
    const Vec3 xy1 = null_vector(b, z);
    double entries[9];
    double sum = 0;
    for (int i = 0; i < 9; ++i) {
      entries[i] = (xy1[0] * basis[0][i] + xy1[1] * basis[1][i]) +
                   xy1[2] * (z * basis[2][i] + basis[3][i]);
      sum += entries[i] * entries[i];
    }
    if (!(sum > 0) || !(sum < 1e300)) continue;
    const double scale = 1.0 / std::sqrt(sum);
    for (int i = 0; i < 9; ++i) essentials[num_models](i / 3, i % 3) = entries[i] * scale;
    ++num_models;
  }
  return num_models;
}

}  // namespace tv
