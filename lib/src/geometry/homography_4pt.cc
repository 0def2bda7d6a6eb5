// Four points: the direct linear transform, Hartley & Zisserman 4.1. Decomposition: Y. Ma, S.
// Soatto, J. Kosecka, S. Sastry, "An Invitation to 3-D Vision", algorithm 5.2.
#include "geometry/homography_4pt.h"

#include <algorithm>
#include <cmath>

#include "geometry/null_space.h"

namespace tv {

bool homography_4pt(const Vec3 rays0[4], const Vec3 rays1[4], Mat3* H) {
  double rows[8][9], basis[1][9];
  for (int k = 0; k < 4; ++k) {
    // Two directions orthogonal to f1: each is orthogonal to H f0, too, which gives an equation.
    const Vec3 f0 = rays0[k].normalized();
    Vec3 across, other;
    tangent_basis(rays1[k].normalized(), &across, &other);
    epipolar_row(f0, across, rows[2 * k]);
    epipolar_row(f0, other, rows[2 * k + 1]);
  }
  if (!null_space(rows, 8, basis)) return false;
  *H = matrix_of(basis[0]);
  int positive = 0;
  for (int k = 0; k < 4; ++k) positive += rays1[k].dot(*H * rays0[k]) > 0;
  if (positive == 0) *H = -*H;
  return positive == 0 || positive == 4;
}

int decompose_homography(const Mat3& H, const Vec3& mean_ray0, PlanarPose poses[2]) {
  const Svd3 svd = svd3(H);
  if (!(svd.s[2] > 1e-9 * svd.s[0])) return 0;
  // The largest and the smallest singular value, in units of the middle one.
  const double s1 = svd.s[0] / svd.s[1], s3 = svd.s[2] / svd.s[1];
  if (!(s1 - s3 > 1e-9)) return 0;
  const Mat3 unit = H / svd.s[1];
  const Vec3 v1 = svd.V.col(0), v2 = svd.V.col(1), v3 = svd.V.col(2);
  const double p = std::sqrt(std::max(0.0, (1 - s3) * (1 + s3))),
               q = std::sqrt(std::max(0.0, (s1 - 1) * (s1 + 1))),
               length = std::sqrt((s1 - s3) * (s1 + s3));
  int count = 0;
  for (int k = 0; k < 2; ++k) {
    // v2 and u span a plane of vectors whose length `unit` keeps.
    const Vec3 u = (p * v1 + (k == 0 ? q : -q) * v3) / length;
    Vec3 normal = v2.cross(u);
    Mat3 before, after;
    before.col(0) = v2;
    before.col(1) = u;
    before.col(2) = normal;
    const Vec3 hv = unit * v2, hu = unit * u;
    after.col(0) = hv;
    after.col(1) = hu;
    after.col(2) = hv.cross(hu);
    const Mat3 R = orthonormalised(after * before.transpose());
    if (normal.dot(mean_ray0) < 0) normal = -normal;
    const Vec3 t = (unit - R) * normal;
    const double size = t.norm();
    if (!(size > 0)) continue;
    poses[count].pose = Pose{R, t / size};
    poses[count].normal = normal;
    poses[count].baseline_over_depth = size;
    ++count;
  }
  return count;
}

}  // namespace tv
