/* Pictures of a room for tests of the odometry: a box with walls of random grey tiles, cast ray by
   ray for a pinhole camera. The world's axes are those of a camera without rotation: x right, y
   down, z forward. */
#ifndef TEST_SUPPORT_ROOM_SCENE_H
#define TEST_SUPPORT_ROOM_SCENE_H

#include <math.h>
#include <stdint.h>

#include "twoview/camera.h"

enum { ROOM_WIDTH = 320, ROOM_HEIGHT = 240 };

static inline tv_camera room_camera(void) {
  const tv_camera camera = {
      TV_CAMERA_PINHOLE, ROOM_WIDTH, ROOM_HEIGHT, 0, 260, 260, 159.5, 119.5, {0}};
  return camera;
}

/* The grey of the tile that holds the point (u, v) of a wall, in metres. */
static inline int room_tile(int wall, double u, double v, double side) {
  uint64_t h = (uint64_t)(int64_t)floor(u / side) * 0x9E3779B97F4A7C15u;
  h ^= (uint64_t)(int64_t)floor(v / side) * 0xC2B2AE3D27D4EB4Fu;
  h ^= (uint64_t)(wall + 8 * (int)(100 * side)) * 0x165667B19E3779F9u;
  h = (h ^ (h >> 29)) * 0xBF58476D1CE4E5B9u;
  return (int)(h >> 57);
}

/* Draws what a camera at `centre` sees that is turned by yaw_rad to the right. The room reaches 2 m
   to the sides, 1.2 m up and down and 3 m forward and back. */
static inline void room_draw(const double centre[3], double yaw_rad, uint8_t *pixels) {
  static const double reach[3] = {2, 1.2, 3};
  const double c = cos(yaw_rad), s = sin(yaw_rad);
  const tv_camera camera = room_camera();
  int x, y, k, axis;
  for (y = 0; y < ROOM_HEIGHT; ++y) {
    for (x = 0; x < ROOM_WIDTH; ++x) {
      const double a = (x - camera.cx) / camera.fx;
      const double ray[3] = {c * a + s, (y - camera.cy) / camera.fy, c - s * a};
      double least = 1e9, at[3];
      axis = 0;
      for (k = 0; k < 3; ++k) {
        const double wall = ray[k] > 0 ? reach[k] : -reach[k];
        const double distance = ray[k] != 0 ? (wall - centre[k]) / ray[k] : 1e9;
        if (distance < least) least = distance, axis = k;
      }
      for (k = 0; k < 3; ++k) at[k] = centre[k] + least * ray[k];
      k = 2 * axis + (ray[axis] > 0);
      pixels[y * ROOM_WIDTH + x] =
          (uint8_t)(room_tile(k, at[(axis + 1) % 3], at[(axis + 2) % 3], 0.11) +
                    room_tile(k, at[(axis + 1) % 3], at[(axis + 2) % 3], 0.29));
    }
  }
}

/* Picture number n of a flight of as many as are wished: sideways in a slow wave, with turns of a
   few degrees. */
static inline void room_flight(int n, uint8_t *pixels) {
  const double centre[3] = {0.9 * sin(0.07 * n) - 0.3, 0.15 * sin(0.11 * n), 0.3 * sin(0.05 * n)};
  room_draw(centre, 0.12 * sin(0.06 * n), pixels);
}

#endif
