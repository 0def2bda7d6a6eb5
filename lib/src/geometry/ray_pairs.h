// The matches of a pair as two rays each with their pixel scale: the storage of these arrays, how
// they are filled, and the order in which a sample of them is scored.
//
// A match is a pair of rays f0, f1 and, for each, the 3x2 Jacobian J = d ray / d pixel, by which a
// residual of rays becomes one in pixels of the images as they are, whatever the lens. Rays are
// points (x, y, 1) of the plane z = 1 where the model allows this, and unit vectors for a fisheye.
// The residuals of models are in geometry/sampson.h, geometry/transfer.h and geometry/parallax.h.
// Tests: test/unit/test_residuals.cc.
#pragma once

#include <cstddef>

#include "base/arena.h"
#include "geometry/camera.h"
#include "geometry/vector3.h"
#include "kernels/kernels.h"

namespace tv {

inline constexpr int kScoreBlock = TVK_SCORE_BLOCK;

// A structure of arrays, component by component, so that a loop over matches can be vectorised.
struct RayPairs {
  const tvk_geometry_table* kernels;
  int num;
  bool on_plane;  // all rays have z = 1, so the third rows of the Jacobians are zero
  double* ray[2][3];
  double* jacobian[2][6];  // d ray / d pixel, row-major 3x2
  // The standard deviation of the angle between the two rays, in radians, under noise of one pixel
  // in each coordinate of both images.
  double* pixel_angle;
  // For scoring only: single precision, padded with zeros to a multiple of kScoreBlock, in an order
  // of their own in which the first few matches are spread evenly over all.
  // On the plane: x0 y0 x1 y1, then J J' of view 0 and of view 1 (xx, xy, yy).
  // Otherwise: the rays (6) and the Jacobians (12).
  float* fast[18];
};

size_t ray_pairs_bytes(int max_matches);
RayPairs alloc_ray_pairs(Arena& arena, int max_matches, bool on_plane);

// How many entries each array of `fast` has for this many scored matches.
inline size_t padded_to_blocks(int num_scored) {
  return (static_cast<size_t>(num_scored) + kScoreBlock - 1) / kScoreBlock * kScoreBlock;
}

// The standard deviation of the i-th pixel, relative to a common unit (tv_pixel_pairs); null: 1 for
// all. A Jacobian that is multiplied by it makes residuals that are in units of it.
double sigma_at(const float* sigmas, int32_t i);

inline Vec3 ray_of(const RayPairs& pairs, int view, int i) {
  return Vec3(pairs.ray[view][0][i], pairs.ray[view][1][i], pairs.ray[view][2][i]);
}
inline Mat32 jacobian_of(const RayPairs& pairs, int view, int i) {
  Mat32 jacobian;
  for (int k = 0; k < 6; ++k) jacobian(k / 2, k % 2) = pairs.jacobian[view][k][i];
  return jacobian;
}
// Writes R times the ray of match i in view 0.
inline void turn_ray0(const RayPairs& pairs, int i, const Mat3& R, double turned[3]) {
  const double x = pairs.ray[0][0][i], y = pairs.ray[0][1][i], z = pairs.ray[0][2][i];
  for (int r = 0; r < 3; ++r) turned[r] = (R(r, 0) * x + R(r, 1) * y) + R(r, 2) * z;
}

// A step near 0.618 n (the golden section), n > 0, that has no common factor with n. The places
// (k step) mod n for k = 0, 1, .. then visit all of 0 .. n - 1, and the first few of them, however
// many, are spread evenly.
int even_step(int n);

void set_ray(RayPairs& pairs, int view, int i, const Vec3& ray, const Mat32& jacobian);
void set_ray(RayPairs& pairs, int view, int i, const double ray[3], const double jacobian[6]);
// Call this after the last set_ray: it computes pixel_angle of the first num_all matches, which is
// at least pairs.num, and `fast` of the first pairs.num, the matches that msac_cost_fast scores.
void finish_rays(RayPairs& pairs, int num_all);

// The arguments of the kernels on doubles (kernels/kernels.h): the arrays of the rays, 3 for each
// view, then those of the Jacobians, 6 for each view.
struct KernelArrays {
  const double* p[18];
};
KernelArrays kernel_arrays(const RayPairs& pairs);

// A model's entries, row by row, as the kernels read them.
struct KernelModel {
  double m[9];
};
inline KernelModel kernel_model(const Mat3& M) {
  KernelModel model;
  write_matrix(M, model.m);
  return model;
}

}  // namespace tv
