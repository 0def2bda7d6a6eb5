// Pairs for the tests of bundle adjustment: up to 5000 points, a start pose that differs from the
// true one, and points triangulated with the start pose. Storage is static throughout, since a
// failing Unity test leaves by longjmp, which skips destructors.
#ifndef TEST_SUPPORT_BUNDLE_SCENE_H
#define TEST_SUPPORT_BUNDLE_SCENE_H

#include "support/calls.h"
#include "support/scene.h"
#include "twoview/bundle.h"
#include "twoview/triangulate.h"

namespace bundle_scene {

using scene::normal;
using scene::uniform;
using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr int kMaxPoints = 5000;

enum class Geometry { kGeneral, kSideways, kForward };

struct Options {
  Geometry geometry = Geometry::kGeneral;
  int num = 500;
  double noise_px = 0.5;
  double outlier_share = 0;
  // The rotation and the direction of t at the start of the adjustment are wrong by this angle.
  double start_off_rad = 0.01;
  double baseline = 1;
  tv_camera camera[2] = {scene::pinhole(), scene::pinhole()};
  uint64_t seed = 1;
};

struct Scene {
  Options options;
  Mat3 R;
  Vec3 t;
  Vec3 truth[kMaxPoints];
  bool outlier[kMaxPoints];
  double pixels[2][2 * kMaxPoints];
  double start_R[9], start_t[3];
  tv_point start[kMaxPoints];
};

inline void store_matrix(const Mat3& m, double out[9]) {
  for (int i = 0; i < 9; ++i) out[i] = m(i / 3, i % 3);
}

inline void store_vector(const Vec3& v, double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = v[i];
}

inline Vec2 noisy(tv::Random* random, const Vec2& pixel, double noise_px) {
  const double x = noise_px * normal(random);
  const double y = noise_px * normal(random);
  return pixel + Vec2(x, y);
}

// Makes match i, from a point at a distance of 2 to 8 baselines from camera 0.
inline void make_match(tv::Random* random, const tv::Camera cameras[2], int i, Scene* s) {
  const Options& o = s->options;
  for (int tries = 0;; ++tries) {
    TEST_ASSERT_TRUE(tries < 10000);
    Vec2 p[2];
    Vec3 ray;
    p[0] = scene::random_pixel(random, o.camera[0]);
    if (!tv::unproject(cameras[0], p[0], &ray, nullptr)) continue;
    s->truth[i] = uniform(random, 2, 8) * o.baseline * ray;
    if (!tv::project(cameras[1], s->R * s->truth[i] + s->t, &p[1], nullptr)) continue;
    if (!(p[1][0] > 0 && p[1][0] < o.camera[1].width - 1 && p[1][1] > 0 &&
          p[1][1] < o.camera[1].height - 1)) {
      continue;
    }
    s->outlier[i] = i < static_cast<int>(o.outlier_share * o.num + 0.5);
    for (int v = 0; v < 2; ++v) {
      p[v] = s->outlier[i] ? scene::random_pixel(random, o.camera[v])
                           : noisy(random, p[v], o.noise_px);
      s->pixels[v][2 * i] = p[v][0];
      s->pixels[v][2 * i + 1] = p[v][1];
    }
    return;
  }
}

inline void triangulate(const Options& o, Scene* s) {
  const tv_camera_pair pair = pair_of(&o.camera[0], &o.camera[1], s->start_R, s->start_t);
  TEST_ASSERT_EQUAL_INT(TV_OK, triangulate_pixels(&pair, s->pixels[0], s->pixels[1], o.num,
                                                  TV_TRIANGULATION_ITERATIVE_LS, s->start));
}

inline void make(const Options& options, Scene* s) {
  TEST_ASSERT_TRUE(options.num <= kMaxPoints);
  s->options = options;
  tv::Random random = tv::random_seeded(options.seed);
  const Vec3 axis = scene::direction(&random);
  s->R = tv::rotation_about(axis, uniform(&random, 0.02, 0.15));
  Vec3 t = scene::direction(&random);
  if (options.geometry == Geometry::kSideways) t = Vec3(-1, 0.05, 0.1).normalized();
  if (options.geometry == Geometry::kForward) t = Vec3(0.1, -0.05, -1).normalized();
  s->t = options.baseline * t;
  const tv::Camera cameras[2] = {tv::prepare_camera(options.camera[0]),
                                 tv::prepare_camera(options.camera[1])};
  for (int i = 0; i < options.num; ++i) make_match(&random, cameras, i, s);
  const Vec3 axis_R = scene::direction(&random), axis_t = scene::direction(&random);
  store_matrix(tv::rotation_about(axis_R, options.start_off_rad) * s->R, s->start_R);
  store_vector(tv::rotation_about(axis_t, options.start_off_rad) * s->t, s->start_t);
  triangulate(options, s);
}

}  // namespace bundle_scene

#endif
