// R. Hartley, "In defense of the eight-point algorithm", PAMI 1997. Eight equations determine M
// linearly, up to its scale. Each view's points are normalised for the step after that: the matrix
// of rank 2 nearest to M is sought in the normalised frames.
#include "geometry/fundamental_8pt.h"

#include "geometry/null_space.h"

namespace tv {
namespace {

// The map of the plane z = 1 that moves the points' centroid to the origin and scales their mean
// squared distance from it to 2. The identity when a ray has z <= 0.1 (fisheye), because distances
// on that plane mean little there.
Mat3 hartley_normalisation(const Vec3 rays[8]) {
  Vec2 sum = Vec2::Zero();
  for (int k = 0; k < 8; ++k) {
    if (!(rays[k][2] > 0.1)) return Mat3::Identity();
    sum += rays[k].head<2>() / rays[k][2];
  }
  const Vec2 mean = sum / 8;
  double spread = 0;
  for (int k = 0; k < 8; ++k) spread += (rays[k].head<2>() / rays[k][2] - mean).squaredNorm();
  if (!(spread > 0)) return Mat3::Identity();
  const double scale = std::sqrt(16 / spread);
  Mat3 T;
  T << scale, 0, -scale * mean[0], 0, scale, -scale * mean[1], 0, 0, 1;
  return T;
}

}  // namespace

bool nearest_rank2(const Mat3& M, Mat3* rank2) {
  const Svd3 svd = svd3(M);
  const double norm = std::sqrt(svd.s[0] * svd.s[0] + svd.s[1] * svd.s[1]);
  if (!(norm > 1e-300) || !(norm < 1e300)) return false;
  *rank2 = (svd.s[0] / norm) * (svd.U.col(0) * svd.V.col(0).transpose()) +
           (svd.s[1] / norm) * (svd.U.col(1) * svd.V.col(1).transpose());
  return true;
}

bool fundamental_8pt(const Vec3 rays0[8], const Vec3 rays1[8], Mat3* M) {
  const Mat3 T0 = hartley_normalisation(rays0), T1 = hartley_normalisation(rays1);
  double rows[8][9], basis[1][9];
  for (int k = 0; k < 8; ++k) {
    epipolar_row((T0 * rays0[k]).normalized(), (T1 * rays1[k]).normalized(), rows[k]);
  }
  if (!null_space(rows, 8, basis)) return false;
  Mat3 normalised;
  if (!nearest_rank2(matrix_of(basis[0]), &normalised)) return false;
  *M = T1.transpose() * normalised * T0;
  const double norm = M->norm();
  if (!(norm > 1e-300) || !(norm < 1e300)) return false;
  *M /= norm;
  return true;
}

}  // namespace tv
