// Simulated pairs of every kind that a verdict names, drawn from stated ranges. What a pair is made
// of (lens, number of matches, noise, share of wrong ones, motion) is drawn anew for each.
#ifndef TEST_SUPPORT_PAIR_KINDS_H
#define TEST_SUPPORT_PAIR_KINDS_H

#include <algorithm>

#include "geometry/homography_4pt.h"
#include "support/scene.h"

namespace pair_kinds {

using scene::normal;
using scene::uniform;
using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr int kMaxMatches = 1024;

enum Kind {
  kGeneral,       // points at depths of 2 to 10 baselines
  kPlanar,        // a plane 2 to 8 baselines away, tilted by up to 50 degrees
  kPureRotation,  // the camera turns by 1 to 20 degrees
  kNoMotion,
  kLowParallax,   // as kGeneral, with a median parallax of 5 to 8 times the noise
  kTooFew,        // as kGeneral, but only 0 to 12 matches in all
  kSecondMotion,  // as kGeneral, but 30 per cent of the true matches lie on an object that moves by
                  // itself
  kLattice,       // as kGeneral, with a wall of equal cells, about half of it matched one or two
                  // cells off, away from the epipolar lines: along these lines two views cannot
                  // show that a match is wrong
  // Two kinds that no verdict names, in which a view shows the scene smaller than the other:
  kForwardMove,  // a move along the optical axis, which makes the scene 1.5 to 8 times as large
  kScaleChange,  // one view shows the scene twice as large: half of the distance, or twice the
                 // focal length
};
constexpr int kNumKinds = 8;  // the kinds that a verdict names
constexpr int kNumAllKinds = 10;

inline const char* name_of(int kind) {
  static const char* const names[kNumAllKinds] = {
      "general", "planar",        "pure rotation", "no motion",    "low parallax",
      "too few", "second motion", "lattice",       "forward move", "scale change"};
  return names[kind];
}

struct Ranges {
  int fewest = 100, most = 500;  // number of matches, wrong ones included
  double most_wrong = 0.5;       // the share of wrong matches is drawn from 0 to this
  double least_noise_px = 0.2, most_noise_px = 0.6;
  double most_rotation_deg = 20;
};

struct Pair {
  Kind kind;
  tv_camera camera[2];
  Mat3 R;
  Vec3 t;  // length 1, or 0 if the camera does not move
  int num;
  double pixels[2][2 * kMaxMatches];
  double noise_px;
  // For kPlanar: the plane n . X = 1 in camera 0, and whether the plane's other motion puts more
  // than an eighth of the points behind a camera, so that the matches exclude that motion.
  Vec3 plane;
  bool other_motion_excluded;
};

// Draws EuRoC's camera with its distortion, a fisheye, or a pinhole with a focal length of 380 to
// 650 pixels.
inline tv_camera draw_camera(tv::Random* random) {
  switch (tv::random_below(*random, 3)) {
    case 0: return scene::distorted();
    case 1: return scene::fisheye();
    default: break;
  }
  tv_camera camera = scene::pinhole();
  camera.fx = camera.fy = uniform(random, 380, 650);
  return camera;
}

struct Maker {
  tv::Random random;
  tv::Camera cameras[2];
  Pair* pair;

  bool seen(int view, const Vec3& X, Vec2* pixel) const {
    const tv_camera& model = pair->camera[view];
    return tv::project(cameras[view], X, pixel, nullptr) && (*pixel)[0] > 2 &&
           (*pixel)[0] < model.width - 3 && (*pixel)[1] > 2 && (*pixel)[1] < model.height - 3;
  }

  // Draws a random pixel of view 0 and its ray; when half_size > 0 the pixel lies within a box
  // around `center`.
  bool ray_of_random_pixel(Vec2 center, double half_size, Vec2* pixel, Vec3* ray) {
    *pixel = scene::random_pixel(&random, pair->camera[0]);
    if (half_size > 0) {
      *pixel = center + scene::uniform2(&random, half_size, half_size);
    }
    return tv::unproject(cameras[0], *pixel, ray, nullptr) && (*ray)[2] > 0.3;
  }

  void put(const Vec2& p0, const Vec2& p1, double noise_px) {
    const Vec2 p[2] = {p0, p1};
    for (int v = 0; v < 2; ++v) {
      for (int k = 0; k < 2; ++k) {
        pair->pixels[v][2 * pair->num + k] = p[v][k] + noise_px * normal(&random);
      }
    }
    ++pair->num;
  }

  // Adds the match of a point X: its pixel p0 in view 0, and its projection in view 1, at R X + t.
  // False where view 1 does not see it.
  bool put_point(const Vec3& X, const Vec2& p0, const Mat3& R, const Vec3& t) {
    Vec2 p1;
    if (!seen(1, R * X + t, &p1)) return false;
    put(p0, p1, pair->noise_px);
    return true;
  }

  void put_wrong(int count) {
    for (int i = 0; i < count; ++i) {
      put(scene::random_pixel(&random, pair->camera[0]),
          scene::random_pixel(&random, pair->camera[1]), 0);
    }
  }

  // Adds matches of points at depths of `scale` times 2 to 10 baselines.
  bool put_general(int count, double scale) {
    for (int i = 0, tries = 0; i < count; ++tries) {
      if (tries > 40 * count + 200) return false;
      Vec2 p0;
      Vec3 ray;
      if (!ray_of_random_pixel(Vec2(0, 0), 0, &p0, &ray)) continue;
      i += put_point(uniform(&random, 2, 10) * scale / ray[2] * ray, p0, pair->R, pair->t);
    }
    return true;
  }

  // Adds matches of points at depths of `distance`, plus or minus `spread`, in baselines.
  bool put_layer(int count, double distance, double spread) {
    for (int i = 0, tries = 0; i < count; ++tries) {
      if (tries > 100 * count + 200) return false;
      Vec2 p0;
      Vec3 ray;
      if (!ray_of_random_pixel(Vec2(0, 0), 0, &p0, &ray)) continue;
      i += put_point((distance + uniform(&random, -spread, spread)) / ray[2] * ray, p0, pair->R,
                     pair->t);
    }
    return true;
  }

  bool put_plane(int count) {
    for (int i = 0, tries = 0; i < count; ++tries) {
      if (tries > 40 * count + 200) return false;
      Vec2 p0;
      Vec3 ray;
      if (!ray_of_random_pixel(Vec2(0, 0), 0, &p0, &ray)) continue;
      const double depth = 1 / pair->plane.dot(ray);
      if (!(depth > 0.5 && depth < 60)) continue;
      i += put_point(depth * ray, p0, pair->R, pair->t);
    }
    return true;
  }

  // Adds an object that moves by itself: a box with a half size of 60 to 150 pixels and points 2 to
  // 5 baselines away. It turns by 5 to 20 degrees about its middle and moves by a tenth to four
  // tenths of its distance.
  bool put_moving_object(int count) {
    const tv_camera& camera = pair->camera[0];
    const double half_size = uniform(&random, 60, 150);
    const double y = uniform(&random, half_size, camera.height - half_size);
    const Vec2 center(uniform(&random, half_size, camera.width - half_size), y);
    const double distance = uniform(&random, 2, 5);
    Vec3 middle;
    if (!tv::unproject(cameras[0], center, &middle, nullptr)) return false;
    middle *= distance;
    const Mat3 turn = scene::rotation(&random, 5 * tv::kPi / 180, 20 * tv::kPi / 180);
    const Vec3 way = scene::direction(&random);
    const Vec3 move = uniform(&random, 0.1, 0.4) * distance * way;
    const Mat3 R = pair->R * turn;
    const Vec3 t = pair->R * (middle - turn * middle + move) + pair->t;
    for (int i = 0, tries = 0; i < count; ++tries) {
      if (tries > 40 * count + 200) return false;
      Vec2 p0;
      Vec3 ray;
      if (!ray_of_random_pixel(center, half_size, &p0, &ray)) continue;
      i += put_point(distance * uniform(&random, 0.8, 1.2) * ray, p0, R, t);
    }
    return true;
  }

  // The approximate distance of Y's image in view 1 from the epipolar line of X, in pixels.
  double line_distance_px(const Vec3& X, const Vec3& Y) const {
    const Vec3 n = pair->t.cross(pair->R * X).normalized();
    const Vec3 seen_there = (pair->R * Y + pair->t).normalized();
    return std::fabs(n.dot(seen_there)) * pair->camera[1].fx;
  }

  // Adds the corners of a wall's cells. 60 to 100 per cent of the corners are found, and 40 to 60
  // per cent of the found ones are matched to a corner one or two cells off. False where too few
  // corners are in both views, or where more than a quarter of these wrong matches lie within 4
  // pixels of their epipolar lines.
  bool put_lattice(int count) {
    const Vec3 normal_of_wall = scene::uniform2(&random, 0.6, 0.3).homogeneous().normalized();
    const double distance = uniform(&random, 3, 8);
    const Vec3 u = Vec3(0, 1, 0).cross(normal_of_wall).normalized(), v = normal_of_wall.cross(u);
    // A cell is 14 to 40 px wide in the image.
    const double cell = distance * uniform(&random, 14, 40) / pair->camera[0].fx;
    const int shift_u = tv::random_below(random, 2) == 0 ? 1 : 2;
    const int shift_v = static_cast<int>(tv::random_below(random, 3)) - 1;
    const Vec3 middle = distance / normal_of_wall[2] * Vec3(0, 0, 1);
    const double shifted_share = uniform(&random, 0.4, 0.6);
    const double seen_share = uniform(&random, 0.6, 1);
    int done = 0, num_off = 0, num_on_lines = 0;
    for (int ring = 0; ring < 60 && done < count; ++ring) {
      for (int j = -ring; j <= ring && done < count; ++j) {
        for (int i = -ring; i <= ring && done < count; ++i) {
          if (std::max(std::abs(i), std::abs(j)) != ring) continue;
          if (uniform(&random, 0, 1) > seen_share) continue;
          const Vec3 X = middle + i * cell * u + j * cell * v;
          const bool off = uniform(&random, 0, 1) < shifted_share;
          const Vec3 Y = off ? Vec3(X + shift_u * cell * u + shift_v * cell * v) : X;
          Vec2 p0, p1;
          if (X[2] <= 0 || !seen(0, X, &p0) || !seen(1, pair->R * Y + pair->t, &p1)) continue;
          put(p0, p1, pair->noise_px);
          ++done;
          num_off += off;
          num_on_lines += off && line_distance_px(X, Y) < 4;
        }
      }
    }
    return 2 * done >= count && 4 * num_on_lines <= num_off;
  }

  void draw_motion(const Ranges& ranges) {
    pair->R = scene::rotation(&random, tv::kPi / 180, ranges.most_rotation_deg * tv::kPi / 180);
    pair->t = scene::direction(&random);
    if (pair->kind == kPureRotation || pair->kind == kNoMotion) pair->t.setZero();
    if (pair->kind == kNoMotion) pair->R = Mat3::Identity();
    if (pair->kind == kForwardMove || pair->kind == kScaleChange) {
      pair->R = scene::rotation(&random, 0, 3 * tv::kPi / 180);
      pair->t = (Vec3(0, 0, -1) + 0.1 * scene::direction(&random)).normalized();
    }
    const double tilt = uniform(&random, 0, 50) * tv::kPi / 180;
    const Vec2 direction = scene::uniform2(&random, 1, 1);
    const Vec3 axis = Vec3(direction[0], direction[1], 0).normalized();
    pair->plane = tv::rotation_about(axis, tilt) * Vec3(0, 0, 1) / uniform(&random, 2, 8);
  }

  // The median over the points of the number of pixels by which the baseline moves a point.
  double median_parallax_px() const {
    static double values[kMaxMatches];
    for (int i = 0; i < pair->num; ++i) {
      Vec3 f0, f1;
      tv::unproject(cameras[0], Vec2(pair->pixels[0][2 * i], pair->pixels[0][2 * i + 1]), &f0,
                    nullptr);
      tv::unproject(cameras[1], Vec2(pair->pixels[1][2 * i], pair->pixels[1][2 * i + 1]), &f1,
                    nullptr);
      values[i] = (pair->R * f0).cross(f1).norm() * pair->camera[1].fx;
    }
    std::nth_element(values, values + pair->num / 2, values + pair->num);
    return values[pair->num / 2];
  }

  bool other_motion_is_excluded() const {
    const Mat3 H = pair->R + pair->t * pair->plane.transpose();
    tv::PlanarPose poses[2];
    Vec3 mean(0, 0, 1);
    const int count = tv::decompose_homography(H, mean, poses);
    int behind = 0, num = 0;
    const tv::Pose* other = nullptr;
    for (int k = 0; k < count; ++k) {
      if ((poses[k].pose.t - pair->t).norm() > 1e-3) other = &poses[k].pose;
    }
    if (other == nullptr) return true;
    for (int i = 0; i < pair->num; ++i) {
      Vec3 f0, f1;
      if (!tv::unproject(cameras[0], Vec2(pair->pixels[0][2 * i], pair->pixels[0][2 * i + 1]), &f0,
                         nullptr) ||
          !tv::unproject(cameras[1], Vec2(pair->pixels[1][2 * i], pair->pixels[1][2 * i + 1]), &f1,
                         nullptr)) {
        continue;
      }
      ++num;
      behind += tv::depth_vote(tv::depth_signs(*other, f0, f1, 1e-3)) < 0;
    }
    return 8 * behind > num;
  }

  bool make(const Ranges& ranges) {
    pair->num = 0;
    pair->other_motion_excluded = true;
    const tv_camera camera = draw_camera(&random);
    for (int v = 0; v < 2; ++v) {
      pair->camera[v] = camera;
      cameras[v] = tv::prepare_camera(camera);
    }
    const bool doubled = pair->kind == kScaleChange && camera.model == TV_CAMERA_PINHOLE;
    if (doubled) {
      pair->camera[1].fx = pair->camera[1].fy = 2 * camera.fx;
      cameras[1] = tv::prepare_camera(pair->camera[1]);
    }
    pair->noise_px = uniform(&random, ranges.least_noise_px, ranges.most_noise_px);
    draw_motion(ranges);
    const int most = ranges.most - ranges.fewest + 1;
    int num =
        ranges.fewest + static_cast<int>(tv::random_below(random, static_cast<uint32_t>(most)));
    double wrong = uniform(&random, 0, ranges.most_wrong);
    if (pair->kind == kTooFew) num = static_cast<int>(tv::random_below(random, 13));
    if (pair->kind == kSecondMotion || pair->kind == kLattice) wrong *= 0.3;
    const int num_wrong = static_cast<int>(num * wrong);
    const int num_true = num - num_wrong;
    bool made = true;
    switch (pair->kind) {
      case kGeneral:
      case kTooFew: made = put_general(num_true, 1); break;
      case kPlanar: made = put_plane(num_true); break;
      case kPureRotation:
      case kNoMotion: made = put_general(num_true, 1); break;
      case kLowParallax: {
        // The parallax is proportional to 1 / scale, so it is measured once and then set.
        const double wanted = uniform(&random, 5, 8) * pair->noise_px;
        const double noise = pair->noise_px;
        const tv::Random start = random;
        double scale = 40;
        for (int round = 0; round < 2 && made; ++round) {
          random = start;
          pair->num = 0;
          pair->noise_px = round == 0 ? 0 : noise;
          made = put_general(num_true, scale);
          if (round == 0 && made) scale *= median_parallax_px() / wanted;
        }
        break;
      }
      case kSecondMotion:
        made = put_general(num_true - num_true * 3 / 10, 1) && put_moving_object(num_true * 3 / 10);
        break;
      case kLattice: made = put_lattice(num_true / 2 + 20) && put_general(num_true / 2, 1); break;
      case kForwardMove: {
        // left: the depth after the move, which has length 1.
        const double zoom = uniform(&random, 1.5, 8), left = 1 / (zoom - 1);
        made = put_layer(num_true, 1 + left, 0.3 * left);
        break;
      }
      case kScaleChange: made = put_layer(num_true, doubled ? 6 : 2, doubled ? 2 : 0.3); break;
    }
    if (!made) return false;
    if (pair->kind == kPlanar) pair->other_motion_excluded = other_motion_is_excluded();
    put_wrong(num_wrong);
    return true;
  }
};

inline void make(Kind kind, const Ranges& ranges, uint64_t seed, Pair* pair) {
  Maker maker{tv::random_seeded(seed), {}, pair};
  pair->kind = kind;
  for (int tries = 0; !maker.make(ranges); ++tries) TEST_ASSERT_TRUE(tries < 1000);
}

}  // namespace pair_kinds

#endif
