// Synthetic pairs for tests of the geometry; a motion is drawn again if both views see too few
// common points. Storage is static throughout, since a failing Unity test leaves by longjmp, which
// skips destructors.
#ifndef TEST_SUPPORT_SCENE_H
#define TEST_SUPPORT_SCENE_H

#include <Eigen/LU>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "base/math.h"
#include "base/random.h"
#include "geometry/camera.h"
#include "geometry/essential.h"
#include "twoview/two_view.h"
#include "unity.h"

namespace scene {

using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr int kMaxMatches = 2000;

inline double uniform(tv::Random* random, double low, double high) {
  return low + (high - low) * (tv::random_next(*random) * 0x1p-32);
}

// Returns an approximately standard normal number, the sum of 12 uniform ones less 6.
inline double normal(tv::Random* random) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) sum += uniform(random, 0, 1);
  return sum;
}

// A point of the box |x| <= extent_x, |y| <= extent_y. Here and below each number has a statement
// of its own, because compilers evaluate arguments in different orders.
inline Vec2 uniform2(tv::Random* random, double extent_x, double extent_y) {
  const double y = uniform(random, -extent_y, extent_y);
  return Vec2(uniform(random, -extent_x, extent_x), y);
}

inline Vec3 direction(tv::Random* random) {
  for (;;) {
    const double z = uniform(random, -1, 1);
    const Vec2 xy = uniform2(random, 1, 1);
    const Vec3 v(xy[0], xy[1], z);
    if (v.squaredNorm() < 1 && v.squaredNorm() > 0.01) return v.normalized();
  }
}

inline Mat3 rotation(tv::Random* random, double least_rad, double most_rad) {
  const double angle = uniform(random, least_rad, most_rad);
  return tv::rotation_about(direction(random), angle);
}

inline tv_camera pinhole() {
  return tv_camera{TV_CAMERA_PINHOLE, 640, 480, 0, 500, 505, 321, 238, {}};
}

inline tv_camera distorted() {  // the lens of the EuRoC data set's camera
  return tv_camera{TV_CAMERA_BROWN_CONRADY,
                   752,
                   480,
                   0,
                   458.654,
                   457.296,
                   367.215,
                   248.375,
                   {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}};
}

inline tv_camera fisheye() {
  return tv_camera{TV_CAMERA_KANNALA_BRANDT, 640, 640, 0, 190, 190, 319.5, 319.5,
                   {0.01, -0.003, 0.0002, 0}};
}

enum class Kind { kGeneral, kPlanar, kForward, kRotation, kStill };

struct Options {
  Kind kind = Kind::kGeneral;
  int num = 300;
  double inlier_share = 1;
  double noise_px = 0.5;
  tv_camera camera[2] = {pinhole(), pinhole()};
  uint64_t seed = 1;
};

struct Scene {
  Options options;
  Mat3 R;
  Vec3 t;  // length 1, or 0 if the camera does not move
  double pixels[2][2 * kMaxMatches];
  float ratios[kMaxMatches];
  uint8_t inlier[kMaxMatches];
};

// A random pixel in the inner part of the image.
inline Vec2 random_pixel(tv::Random* random, const tv_camera& camera) {
  const double y = uniform(random, 5, camera.height - 6);
  return Vec2(uniform(random, 5, camera.width - 6), y);
}

inline void choose_motion(tv::Random* random, Scene* s) {
  const Kind kind = s->options.kind;
  s->R = rotation(random, 0.02, 0.2);
  s->t = direction(random);
  if (kind == Kind::kForward) s->t = Vec3(0.1, -0.05, -1).normalized();
  if (kind == Kind::kRotation || kind == Kind::kStill) s->t.setZero();
  if (kind == Kind::kStill) s->R = Mat3::Identity();
}

// Points at depths of 2 to 8 baselines, or on a plane four baselines away.
inline bool true_match(tv::Random* random, const tv::Camera* cameras, const Vec3& normal_of_plane,
                       Scene* s, Vec2* p0, Vec2* p1) {
  *p0 = random_pixel(random, s->options.camera[0]);
  Vec3 ray;
  if (!tv::unproject(cameras[0], *p0, &ray, nullptr)) return false;
  double depth = uniform(random, 2, 8);
  if (s->options.kind == Kind::kPlanar) depth = 4 / normal_of_plane.dot(ray);
  if (!(depth > 1 && depth < 20)) return false;
  if (!tv::project(cameras[1], s->R * (depth * ray) + s->t, p1, nullptr)) return false;
  const tv_camera& second = s->options.camera[1];
  return (*p1)[0] > 0 && (*p1)[0] < second.width - 1 && (*p1)[1] > 0 &&
         (*p1)[1] < second.height - 1;
}

inline void make(const Options& options, Scene* s) {
  TEST_ASSERT_TRUE(options.num <= kMaxMatches);
  s->options = options;
  tv::Random random = tv::random_seeded(options.seed);
  choose_motion(&random, s);
  const tv::Camera cameras[2] = {tv::prepare_camera(options.camera[0]),
                                 tv::prepare_camera(options.camera[1])};
  const Vec3 plane = uniform2(&random, 0.4, 0.4).homogeneous().normalized();
  const int num_true = static_cast<int>(options.num * options.inlier_share + 0.5);
  int restarts = 0;
  for (int i = 0; i < options.num; ++i) {
    Vec2 p[2];
    s->inlier[i] = i < num_true;
    if (s->inlier[i]) {
      int tries = 0;
      while (tries < 1000 && !true_match(&random, cameras, plane, s, &p[0], &p[1])) ++tries;
      if (tries == 1000) {  // this motion leaves too few points in both views
        TEST_ASSERT_TRUE(++restarts < 100);
        choose_motion(&random, s);
        i = -1;
        continue;
      }
      for (int v = 0; v < 2; ++v) {
        for (int k = 0; k < 2; ++k) p[v][k] += options.noise_px * normal(&random);
      }
    } else {
      for (int v = 0; v < 2; ++v) p[v] = random_pixel(&random, options.camera[v]);
    }
    for (int v = 0; v < 2; ++v) {
      for (int k = 0; k < 2; ++k) s->pixels[v][2 * i + k] = p[v][k];
    }
    s->ratios[i] = static_cast<float>(uniform(&random, s->inlier[i] ? 0.2 : 0.5, 0.8));
  }
}

inline double degrees(double rad) { return rad * 180 / tv::kPi; }

// The rotation error in degrees: the angle of R truth'.
inline double rotation_error_deg(const double R[9], const Mat3& truth) {
  Mat3 estimate;
  for (int k = 0; k < 9; ++k) estimate(k / 3, k % 3) = R[k];
  const Mat3 d = estimate * truth.transpose();
  const Vec3 axis(d(2, 1) - d(1, 2), d(0, 2) - d(2, 0), d(1, 0) - d(0, 1));
  return degrees(tv::atan2(axis.norm(), d.trace() - 1));
}

// The angle between t and truth in degrees, 0 to 180: opposite directions give 180.
inline double translation_error_deg(const double t[3], const Vec3& truth) {
  const Vec3 estimate(t[0], t[1], t[2]);
  return degrees(tv::atan2(estimate.cross(truth).norm(), estimate.dot(truth)));
}

using Vec5 = Eigen::Matrix<double, 5, 1>;

// The error of an estimate in the parameters of its covariance (two_view.h); very large where the
// directions of t are opposite.
inline Vec5 pose_error(const double R[9], const double t[3], const Mat3& true_R,
                       const Vec3& true_t) {
  Mat3 estimate;
  for (int k = 0; k < 9; ++k) estimate(k / 3, k % 3) = R[k];
  const Mat3 turn = true_R * estimate.transpose();
  Vec3 w(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1));
  const double twice_sine = w.norm();
  if (twice_sine > 0) w *= tv::atan2(twice_sine, turn.trace() - 1) / twice_sine;
  const Vec3 direction(t[0], t[1], t[2]);
  Vec3 b1, b2;
  tv::tangent_basis(direction, &b1, &b2);
  const double along = direction.dot(true_t);
  Vec5 e;
  e << w, b1.dot(true_t) / along, b2.dot(true_t) / along;
  return along > 0 ? e : Vec5(Vec5::Constant(1e3));
}

// Whether the truth lies in the 95 per cent ellipsoid (chi-square of 5 degrees of freedom).
inline bool within_ellipsoid_95(const tv_two_view& r, const Mat3& true_R, const Vec3& true_t) {
  if (!r.has_covariance) return false;
  const Vec5 e = pose_error(r.R, r.t, true_R, true_t);
  Eigen::Matrix<double, 5, 5> C;
  for (int k = 0; k < 25; ++k) C(k / 5, k % 5) = r.covariance[k];
  return e.dot(C.inverse() * e) < 11.0705;
}

}  // namespace scene

#endif
