// A scene of known depth for the tests of dense matching: a slanted, textured wall, and before it a
// ball, seen through any lens.
#pragma once

#include <algorithm>
#include <cmath>

#include "geometry/camera.h"
#include "support/scene.h"

namespace ball_scene {

inline double hashed(int x, int y, int z) {
  uint32_t h = static_cast<uint32_t>(x) * 73856093u ^ static_cast<uint32_t>(y) * 19349663u ^
               static_cast<uint32_t>(z) * 83492791u;
  h = (h ^ h >> 15) * 2246822519u;
  h = (h ^ h >> 13) * 3266489917u;
  return (h ^ h >> 16) * 0x1p-32;
}

// Trilinear noise of the scene's surfaces, [0, 1].
inline double noise(const tv::Vec3& at, double cell) {
  int base[3];
  double part[3], sum = 0;
  for (int i = 0; i < 3; ++i) {
    base[i] = static_cast<int>(std::floor(at[i] / cell));
    part[i] = at[i] / cell - base[i];
  }
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1;
    int where[3];
    for (int i = 0; i < 3; ++i) {
      const int on = corner >> i & 1;
      weight *= on ? part[i] : 1 - part[i];
      where[i] = base[i] + on;
    }
    sum += weight * hashed(where[0], where[1], where[2]);
  }
  return sum;
}

inline const tv::Vec3 kBall(0.3, -0.2, 3.0);
inline constexpr double kRadius = 0.7;

// The distance along a unit ray from `from` to the scene.
inline double distance_to_scene(const tv::Vec3& from, const tv::Vec3& ray) {
  const tv::Vec3 normal(0.25, -0.15, 1);  // of the wall normal . X = 5
  const double along = normal.dot(ray);
  double best = along > 1e-9 ? (5 - normal.dot(from)) / along : 1e9;
  if (best < 0) best = 1e9;
  const tv::Vec3 to = kBall - from;
  const double middle = to.dot(ray);
  const double under = kRadius * kRadius - to.dot(to) + middle * middle;
  if (under > 0 && middle - std::sqrt(under) > 0) best = std::min(best, middle - std::sqrt(under));
  return best;
}

inline void render(const tv_camera& camera, const tv::Mat3& R, const tv::Vec3& t,
                   tv::Random* random, uint8_t* image) {
  const tv::Camera prepared = tv::prepare_camera(camera);
  const tv::Vec3 centre = -(R.transpose() * t);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      double sum = 0;
      for (int part = 0; part < 4; ++part) {
        tv::Vec3 ray;
        const tv::Vec2 pixel(x + 0.5 * (part % 2) - 0.25, y + 0.5 * (part / 2) - 0.25);
        if (!tv::unproject(prepared, pixel, &ray, nullptr)) continue;
        ray = R.transpose() * ray;
        const double distance = distance_to_scene(centre, ray);
        if (distance > 100) continue;
        const tv::Vec3 at = centre + distance * ray;
        sum += 40 + 110 * noise(at, 0.05) + 60 * noise(at, 0.3);
      }
      const double grey = sum / 4 + scene::normal(random);
      image[y * camera.width + x] = static_cast<uint8_t>(std::min(std::max(grey, 0.0), 255.0));
    }
  }
}

}  // namespace ball_scene
