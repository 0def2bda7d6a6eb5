// Rigid motions as plain numbers, which lie in the caller's memory and are copied as bytes: a point
// X becomes R X + t. Their names say the frames, such as cam_from_world; a `world` is that of the
// map's segment. Pose (geometry/essential.h) is the form with which the estimators calculate.
// Tests: test/unit/test_odometry_map.cc.
#pragma once

#include "geometry/camera.h"
#include "geometry/vector3.h"

namespace tv {

struct Rigid {
  double R[9];  // row-major
  double t[3];
};

inline constexpr Rigid kIdentity = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};

Rigid rigid_of(const double R[9], const double t[3]);
void write_rigid(const Rigid& rigid, double R[9], double t[3]);

inline void transform(const Rigid& rigid, const double X[3], double x[3]) {
  const double *R = rigid.R, *t = rigid.t;
  const double y[3] = {dot(R, X) + t[0], dot(R + 3, X) + t[1], dot(R + 6, X) + t[2]};
  for (int k = 0; k < 3; ++k) x[k] = y[k];
}
Rigid compose(const Rigid& outer, const Rigid& inner);  // x = outer(inner(X))
Rigid inverse(const Rigid& rigid);
void centre_of(const Rigid& cam_from_world, double centre[3]);
double rotation_angle(const Rigid& rigid);  // in radians
double distance_between(const double a[3], const double b[3]);

// Of two cameras: cam1_from_cam0, the angle of its rotation in radians, and the distance of the
// centres.
Rigid motion_between(const Rigid& cam0_from_world, const Rigid& cam1_from_world);
double turn_between(const Rigid& cam0_from_world, const Rigid& cam1_from_world);
double way_between(const Rigid& cam0_from_world, const Rigid& cam1_from_world);
// Whether they are no farther from each other than these two.
bool are_near(const Rigid& cam0_from_world, const Rigid& cam1_from_world, double way,
              double turn_rad);

// `rigid` with the rotation's rounding errors removed.
Rigid orthonormalised(const Rigid& rigid);

// `rigid` carried out `factor` times, for factors of at most a few.
Rigid scaled_motion(const Rigid& rigid, double factor);

}  // namespace tv
