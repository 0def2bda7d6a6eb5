// What the methods of triangulation share: products of vectors that add in a fixed order, two unit
// vectors perpendicular to an axis, and the plane on which a camera's pixel errors are measured.
#pragma once

#include <cmath>

#include "geometry/camera.h"

namespace tv {

// These products are written out, because another version of Eigen may form its sums in another
// order, which would change the last bits.
inline double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return Vec3(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}

inline Vec3 rotate(const Mat3& R, const Vec3& v) {
  return Vec3(R(0, 0) * v[0] + R(0, 1) * v[1] + R(0, 2) * v[2],
              R(1, 0) * v[0] + R(1, 1) * v[1] + R(1, 2) * v[2],
              R(2, 0) * v[0] + R(2, 1) * v[1] + R(2, 2) * v[2]);
}

inline Vec3 combine(double a, const Vec3& u, double b, const Vec3& v) {
  return Vec3(a * u[0] + b * v[0], a * u[1] + b * v[1], a * u[2] + b * v[2]);
}

// Writes two unit vectors u, v that make a right-handed frame (axis, u, v) with a unit axis. They
// are constructed from the coordinate axis that makes the largest angle with it.
inline void complete_basis(const Vec3& axis, Vec3* u, Vec3* v) {
  const double size[3] = {std::fabs(axis[0]), std::fabs(axis[1]), std::fabs(axis[2])};
  Vec3 start(1.0, 0.0, 0.0);
  if (size[1] < size[0] && size[1] <= size[2]) start = Vec3(0.0, 1.0, 0.0);
  if (size[2] < size[0] && size[2] < size[1]) start = Vec3(0.0, 0.0, 1.0);
  const Vec3 side = cross(axis, start);
  const double scale = 1.0 / std::sqrt(dot(side, side));
  *u = Vec3(side[0] * scale, side[1] * scale, side[2] * scale);
  *v = cross(axis, *u);
}

// The plane of a camera's undistorted image, where a pixel is 1/fx by 1/fy; or, for a camera that
// sees beyond a half space and has no such plane, the plane that touches the viewing sphere at the
// ray, where a pixel is 1 / sqrt(fx fy) wide and high.
struct RayFrame {
  Vec3 ray;         // scaled to depth 1: z = 1 on the image plane, unit length on the sphere
  Vec3 rows[2];     // two vectors n orthogonal to the ray: n . X = 0 for its points X
  Vec3 basis[2];    // spans the plane of equal depth: -rows[i] . basis[j] = (i == j)
  Vec3 depth;       // the depth of a point X is depth . X
  double pixel[2];  // length of a pixel along basis[i]
};

// ray must be a unit vector.
RayFrame frame_of(const Camera& camera, const Vec3& ray);

}  // namespace tv
