#include "geometry/rotation_2pt.h"

#include <cmath>

namespace tv {
namespace {

bool triad(const Vec3 rays[2], Mat3* axes) {
  const Vec3 a = rays[0].normalized(), b = rays[1].normalized();
  const Vec3 sum = a + b, difference = a - b;
  const double sum_sq = sum.squaredNorm(), difference_sq = difference.squaredNorm();
  if (!(sum_sq > 1e-16) || !(difference_sq > 1e-16)) return false;
  axes->col(0) = sum / std::sqrt(sum_sq);
  axes->col(1) = difference / std::sqrt(difference_sq);
  axes->col(2) = axes->col(0).cross(axes->col(1));
  return true;
}

}  // namespace

bool rotation_2pt(const Vec3 rays0[2], const Vec3 rays1[2], Mat3* R) {
  Mat3 axes0, axes1;
  if (!triad(rays0, &axes0) || !triad(rays1, &axes1)) return false;
  *R = axes1 * axes0.transpose();
  return true;
}

}  // namespace tv
