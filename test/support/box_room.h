// Depth maps of surfaces that are known exactly: a room seen from inside, a ball, a plane.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "geometry/camera.h"
#include "twoview/room.h"

namespace box_room {

using tv::Mat3;
using tv::Vec3;

// The distance from `from` along the unit vector `ray` to the nearest surface; 0 without one.
struct Scene {
  Vec3 low{0, 0, 0}, high{0, 0, 0};  // a box seen from inside; none where they are equal
  Vec3 centre{0, 0, 0};
  double radius = 0;  // of a ball; none where it is 0
  Vec3 normal{0, 0, 0};
  double offset = 0;  // of a plane normal . x = offset; none where the normal is zero

  double distance(const Vec3& from, const Vec3& ray) const {
    double nearest = 0;
    const auto take = [&nearest](double d) {
      if (d > 1e-9 && (nearest == 0 || d < nearest)) nearest = d;
    };
    if (low != high) {
      double out = 1e9;
      for (int i = 0; i < 3; ++i) {
        if (ray[i] != 0) out = std::fmin(out, ((ray[i] > 0 ? high : low)[i] - from[i]) / ray[i]);
      }
      take(out);
    }
    if (radius > 0) {
      const Vec3 m = from - centre;
      const double b = m.dot(ray), c = m.dot(m) - radius * radius;
      if (b * b - c >= 0) take(-b - std::sqrt(b * b - c));
    }
    if (normal.dot(normal) > 0) take((offset - normal.dot(from)) / normal.dot(ray));
    return nearest;
  }
};

inline tv_camera pinhole(int width, int height, double focal) {
  tv_camera camera = {};
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = (width - 1) / 2.0, camera.cy = (height - 1) / 2.0;
  return camera;
}

// world_from_cam of a camera at `from` that looks at `to`; the world's z axis points up.
inline void look_at(const Vec3& from, const Vec3& to, double R[9], double t[3]) {
  const Vec3 ahead = (to - from).normalized();
  const Vec3 up = std::fabs(ahead[2]) > 0.99 ? Vec3(0, 1, 0) : Vec3(0, 0, 1);
  const Vec3 right = ahead.cross(up).normalized(), down = ahead.cross(right);
  for (int i = 0; i < 3; ++i) {
    R[3 * i] = right[i], R[3 * i + 1] = down[i], R[3 * i + 2] = ahead[i];
    t[i] = from[i];
  }
}

// A map that owns its arrays, its camera and its pose.
struct Map {
  tv_camera camera = {};
  double R[9], t[3];
  std::vector<float> distance, sigma;
  std::vector<uint8_t> pixels;
  tv_depth_map map;
};

// The map as the library is given it.
inline tv_depth_map given(const Map& m) {
  tv_depth_map map = m.map;
  map.camera = &m.camera;
  std::copy(m.R, m.R + 9, map.world_from_cam_R);
  std::copy(m.t, m.t + 3, map.world_from_cam_t);
  return map;
}

inline void aim(Map* m) {
  tv_depth_map_init(&m->map);
  m->map.width = m->map.stride = m->camera.width;
  m->map.height = m->camera.height;
  m->map.distance = m->distance.data();
  m->map.sigma = m->sigma.data();
  m->map.pixels = m->pixels.empty() ? nullptr : m->pixels.data();
  m->map.channels = 3;
  m->map.pixel_stride_bytes = 3 * m->camera.width;
}

// The exact map of a scene, with that sigma. Colours are those of the world's position.
inline Map see(const Scene& scene, const tv_camera& camera, const Vec3& from, const Vec3& to,
               float sigma) {
  Map m;
  m.camera = camera;
  look_at(from, to, m.R, m.t);
  const tv::Camera lens = tv::prepare_camera(camera);
  const Eigen::Map<const Mat3> R(m.R);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      Vec3 ray;
      double d = 0;
      if (tv::unproject(lens, tv::Vec2(x, y), &ray, nullptr)) {
        ray = R * ray;
        d = scene.distance(from, ray);
      }
      m.distance.push_back(static_cast<float>(d));
      m.sigma.push_back(sigma);
      for (int i = 0; i < 3; ++i) {
        const double c = 128 + 20 * (from[i] + d * ray[i]);
        m.pixels.push_back(static_cast<uint8_t>(c < 0 ? 0 : c > 255 ? 255 : c));
      }
    }
  }
  aim(&m);
  return m;
}

}  // namespace box_room
