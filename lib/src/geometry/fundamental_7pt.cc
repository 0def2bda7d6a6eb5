// Hartley & Zisserman, "Multiple View Geometry", 2nd edition, 11.1.2: seven equations determine M
// up to one unknown x, M = A + x B; det M = 0 is a cubic in x.
#include "geometry/fundamental_7pt.h"

#include "geometry/null_space.h"
#include "geometry/polynomial.h"

namespace tv {

int fundamental_7pt(const Vec3 rays0[7], const Vec3 rays1[7], Mat3 models[3]) {
  double rows[7][9], basis[2][9];
  for (int k = 0; k < 7; ++k) {
    epipolar_row(rays0[k].normalized(), rays1[k].normalized(), rows[k]);
  }
  if (!null_space(rows, 7, basis)) return 0;
  const Mat3 A = matrix_of(basis[0]), B = matrix_of(basis[1]);
  // det(A + x B) = det A + x tr(adj(A) B) + x^2 tr(adj(B) A) + x^3 det B; the columns' triple
  // products give each term.
  const Vec3 a0 = A.col(0), a1 = A.col(1), a2 = A.col(2);
  const Vec3 b0 = B.col(0), b1 = B.col(1), b2 = B.col(2);
  const double cubic[4] = {
      a0.dot(a1.cross(a2)), (b0.dot(a1.cross(a2)) + a0.dot(b1.cross(a2))) + a0.dot(a1.cross(b2)),
      (a0.dot(b1.cross(b2)) + b0.dot(a1.cross(b2))) + b0.dot(b1.cross(a2)), b0.dot(b1.cross(b2))};
  double roots[3];
  const int num_roots = real_roots(cubic, 3, roots);
  for (int r = 0; r < num_roots; ++r) models[r] = (A + roots[r] * B).normalized();
  return num_roots;
}

}  // namespace tv
