// Pixels that see points in space, made ready for the absolute pose: sorted, repeated ones last, in
// units of their sigmas, and the points moved and scaled to about one around the origin.
//
// The error of a point p = R X + t of the camera's frame is, in pixels and to first order in it,
//     e = (J p) / (a . p),  J = d pixel / d point at the ray f of the pixel, a . f = 1,
// and infinite where a . p <= 0. With f on the plane z = 1 and a = z it is exact for a pinhole; for
// a wide lens f is the unit ray, and a = f. Tests: test/unit/test_absolute_pose.cc.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "geometry/camera.h"
#include "geometry/essential.h"
#include "kernels/odometry.h"

namespace tv {

// What the caller gave (tv_pixel_points); all that is per match has num entries.
struct SightingInput {
  const tvk_set* kernels;
  Camera camera;
  const double *pixels, *points;
  const float *ratios, *sigmas;  // null: no order, 1 for all
  int num;
  double sigma(int i) const { return sigmas != nullptr ? sigmas[i] : 1; }
};

struct Sighting {
  double point[3];
  double rows[2][3];  // J divided by the pixel's sigma
  double axis[3];     // a
};

inline constexpr int kSightingBlock = TVK_SIGHTING_BLOCK;  // matches that are scored at a time

struct Sightings {
  const tvk_odometry_table* kernels;
  Sighting* all;  // the different matches, then those that repeat one of them
  int num, num_all;
  int32_t* order;  // match k is the caller's order[k]
  // The different matches once more, for scoring, in single precision and in an order in which the
  // first few, however many, are spread over all: the numbers of a Sighting, one array each.
  float* fast[12];
  double centre[3] = {0, 0, 0};  // a point X of the caller is scale (X - centre) here
  double scale = 1;              // a power of two
};

// By which matches are sorted: the first coordinate of the pixel, or the ratio.
struct SightingKey {
  double key;
  int32_t index;
};

inline size_t sightings_bytes(size_t n) {
  const size_t padded = (n + kSightingBlock - 1) / kSightingBlock * kSightingBlock;
  return arena_bytes<Sighting>(n) + arena_bytes<int32_t>(n) + 12 * arena_bytes<float>(padded) +
         arena_bytes<SightingKey>(n) + arena_bytes<double>(n);
}

// Drops matches that are not finite or outside the lens model, or whose point is farther than 1e9
// times the median distance of all points from their middle.
void prepare_sightings(const SightingInput& input, Arena& arena, Sightings* sightings);

// A pose of the caller's points from one of the points as Sightings has them, and back.
void write_pose(const Sightings& sightings, const Pose& pose, double R[9], double t[3]);
Pose read_pose(const Sightings& sightings, const double R[9], const double t[3]);

void unit_ray(const Sighting& sighting, double ray[3]);  // that of the pixel

}  // namespace tv
