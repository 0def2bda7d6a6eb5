#include "geometry/ray_pairs.h"

#include <cmath>

#include "twoview/context.h"

namespace tv {
namespace {

// The square root of half the sum, over both views and both coordinates, of the squared angle by
// which a step of one pixel turns the ray. Only the component of a Jacobian's column orthogonal to
// the ray turns it.
double pixel_angle(const RayPairs& pairs, int i) {
  double sum = 0;
  for (int v = 0; v < 2; ++v) {
    const double x = pairs.ray[v][0][i], y = pairs.ray[v][1][i], z = pairs.ray[v][2][i];
    const double inverse_sq = 1 / (x * x + (y * y + z * z));
    for (int k = 0; k < 2; ++k) {
      const double a = pairs.jacobian[v][k][i], b = pairs.jacobian[v][2 + k][i],
                   c = pairs.jacobian[v][4 + k][i];
      const double along = a * x + (b * y + c * z);
      sum += ((a * a + (b * b + c * c)) - along * along * inverse_sq) * inverse_sq;
    }
  }
  return std::sqrt(0.5 * sum);
}

void set_fast(RayPairs& pairs, int slot, int i) {
  for (int v = 0; v < 2; ++v) {
    if (pairs.on_plane) {
      for (int k = 0; k < 2; ++k) {
        pairs.fast[2 * v + k][slot] = static_cast<float>(pairs.ray[v][k][i]);
      }
      double* const* J = pairs.jacobian[v];
      const double a = J[0][i], b = J[1][i], c = J[2][i], d = J[3][i];
      const double metric[3] = {a * a + b * b, a * c + b * d, c * c + d * d};
      for (int k = 0; k < 3; ++k) {
        pairs.fast[4 + 3 * v + k][slot] = static_cast<float>(metric[k]);
      }
    } else {
      for (int k = 0; k < 3; ++k) {
        pairs.fast[3 * v + k][slot] = static_cast<float>(pairs.ray[v][k][i]);
      }
      for (int k = 0; k < 6; ++k) {
        pairs.fast[6 + 6 * v + k][slot] = static_cast<float>(pairs.jacobian[v][k][i]);
      }
    }
  }
}

}  // namespace

int even_step(int n) {
  int step = static_cast<int>(0.6180339887498949 * n);
  for (;; ++step) {
    int a = n, b = step;
    while (b > 0) {
      const int remainder = a % b;
      a = b;
      b = remainder;
    }
    if (a == 1) return step;
  }
}

size_t ray_pairs_bytes(int max_matches) {
  return 19 * arena_bytes<double>(static_cast<size_t>(max_matches)) +
         18 * arena_bytes<float>(padded_to_blocks(max_matches));
}

RayPairs alloc_ray_pairs(Arena& arena, int max_matches, bool on_plane) {
  RayPairs pairs{};
  pairs.kernels = tvk_geometry_of(tvk_select(TV_KERNELS_C));
  const size_t n = static_cast<size_t>(max_matches);
  pairs.on_plane = on_plane;
  for (int v = 0; v < 2; ++v) {
    for (int k = 0; k < 3; ++k) pairs.ray[v][k] = arena_alloc<double>(arena, n);
    for (int k = 0; k < 6; ++k) pairs.jacobian[v][k] = arena_alloc<double>(arena, n);
  }
  pairs.pixel_angle = arena_alloc<double>(arena, n);
  for (int k = 0; k < (on_plane ? 10 : 18); ++k) {
    pairs.fast[k] = arena_alloc<float>(arena, padded_to_blocks(max_matches));
  }
  return pairs;
}

double sigma_at(const float* sigmas, int32_t i) { return sigmas != nullptr ? sigmas[i] : 1; }

void set_ray(RayPairs& pairs, int view, int i, const Vec3& ray, const Mat32& jacobian) {
  double entries[6];
  for (int k = 0; k < 6; ++k) entries[k] = jacobian(k / 2, k % 2);
  set_ray(pairs, view, i, ray.data(), entries);
}

void set_ray(RayPairs& pairs, int view, int i, const double ray[3], const double jacobian[6]) {
  for (int k = 0; k < 3; ++k) pairs.ray[view][k][i] = ray[k];
  for (int k = 0; k < 6; ++k) pairs.jacobian[view][k][i] = jacobian[k];
}

void finish_rays(RayPairs& pairs, int num_all) {
  const int num_scored = pairs.num;
  for (int i = 0; i < num_all; ++i) pairs.pixel_angle[i] = pixel_angle(pairs, i);
  const int step = num_scored > 0 ? even_step(num_scored) : 0;
  for (int slot = 0, i = 0; slot < num_scored; ++slot) {
    set_fast(pairs, slot, i);
    i = i < num_scored - step ? i + step : i - (num_scored - step);
  }
  const int end = static_cast<int>(padded_to_blocks(num_scored));
  for (int k = 0; k < (pairs.on_plane ? 10 : 18); ++k) {
    for (int slot = num_scored; slot < end; ++slot) pairs.fast[k][slot] = 0;
  }
}

KernelArrays kernel_arrays(const RayPairs& pairs) {
  KernelArrays a;
  for (int v = 0; v < 2; ++v) {
    for (int k = 0; k < 3; ++k) a.p[3 * v + k] = pairs.ray[v][k];
    for (int k = 0; k < 6; ++k) a.p[6 + 6 * v + k] = pairs.jacobian[v][k];
  }
  return a;
}

}  // namespace tv
