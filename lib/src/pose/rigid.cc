#include "pose/rigid.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/essential.h"
#include "geometry/vector3.h"

namespace tv {

Rigid rigid_of(const double R[9], const double t[3]) {
  Rigid rigid;
  std::copy_n(R, 9, rigid.R);
  std::copy_n(t, 3, rigid.t);
  return rigid;
}

void write_rigid(const Rigid& rigid, double R[9], double t[3]) {
  std::copy_n(rigid.R, 9, R);
  std::copy_n(rigid.t, 3, t);
}

Rigid compose(const Rigid& outer, const Rigid& inner) {
  Rigid product;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      product.R[3 * r + c] = (outer.R[3 * r] * inner.R[c] + outer.R[3 * r + 1] * inner.R[3 + c]) +
                             outer.R[3 * r + 2] * inner.R[6 + c];
    }
  }
  transform(outer, inner.t, product.t);
  return product;
}

Rigid inverse(const Rigid& rigid) {
  Rigid result;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) result.R[3 * r + c] = rigid.R[3 * c + r];
  }
  for (int r = 0; r < 3; ++r) result.t[r] = -dot(result.R + 3 * r, rigid.t);
  return result;
}

void centre_of(const Rigid& cam_from_world, double centre[3]) {
  const Rigid world_from_cam = inverse(cam_from_world);
  for (int k = 0; k < 3; ++k) centre[k] = world_from_cam.t[k];
}

double rotation_angle(const Rigid& rigid) {
  const double* R = rigid.R;
  const double sine[3] = {R[7] - R[5], R[2] - R[6], R[3] - R[1]};
  return atan2(length_of(sine), R[0] + R[4] + R[8] - 1);
}

double distance_between(const double a[3], const double b[3]) {
  const double difference[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return length_of(difference);
}

Rigid motion_between(const Rigid& cam0_from_world, const Rigid& cam1_from_world) {
  return compose(cam1_from_world, inverse(cam0_from_world));
}

double turn_between(const Rigid& cam0_from_world, const Rigid& cam1_from_world) {
  return rotation_angle(motion_between(cam0_from_world, cam1_from_world));
}

double way_between(const Rigid& cam0_from_world, const Rigid& cam1_from_world) {
  double centre0[3], centre1[3];
  centre_of(cam0_from_world, centre0);
  centre_of(cam1_from_world, centre1);
  return distance_between(centre0, centre1);
}

bool are_near(const Rigid& cam0_from_world, const Rigid& cam1_from_world, double way,
              double turn_rad) {
  return way_between(cam0_from_world, cam1_from_world) <= way &&
         turn_between(cam0_from_world, cam1_from_world) <= turn_rad;
}

Rigid orthonormalised(const Rigid& rigid) {
  Rigid result = rigid;
  write_matrix(orthonormalised(matrix_of(rigid.R)), result.R);
  return result;
}

Rigid scaled_motion(const Rigid& rigid, double factor) {
  const double* R = rigid.R;
  Vec3 axis(R[7] - R[5], R[2] - R[6], R[3] - R[1]);
  const double length = std::sqrt(axis.dot(axis));
  Rigid result = kIdentity;
  if (length > 1e-12) {
    axis /= length;
    write_matrix(rotation_about(axis, factor * rotation_angle(rigid)), result.R);
  }
  for (int k = 0; k < 3; ++k) result.t[k] = factor * rigid.t[k];
  return result;
}

}  // namespace tv
