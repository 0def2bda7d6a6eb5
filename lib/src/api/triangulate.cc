// The boundary of triangulation: validate, call.
#include "twoview/triangulate.h"

#include <cmath>
#include <cstdint>
#include <limits>

#include "geometry/triangulation.h"

namespace {

constexpr double kRotationTolerance = 1e-6;

bool all_finite(const double *values, int num_values) {
  for (int i = 0; i < num_values; ++i) {
    if (!(std::fabs(values[i]) < std::numeric_limits<double>::infinity())) return false;
  }
  return true;
}

// R R^T = I and det R > 0.
bool is_rotation(const double R[9]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      const double *a = R + 3 * i;
      const double *b = R + 3 * j;
      const double product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
      if (!(std::fabs(product - (i == j ? 1.0 : 0.0)) <= kRotationTolerance)) return false;
    }
  }
  const double det = R[0] * (R[4] * R[8] - R[5] * R[7]) - R[1] * (R[3] * R[8] - R[5] * R[6]) +
                     R[2] * (R[3] * R[7] - R[4] * R[6]);
  return det > 0.0;
}

// Whether [a, a + a_bytes) and [b, b + b_bytes) share a byte.
bool overlap(const void *a, uint64_t a_bytes, const void *b, uint64_t b_bytes) {
  const uint64_t a_first = reinterpret_cast<uintptr_t>(a);
  const uint64_t b_first = reinterpret_cast<uintptr_t>(b);
  return a_first < b_first ? b_first - a_first < a_bytes : a_first - b_first < b_bytes;
}

}  // namespace

tv_status tv_triangulate(tv_triangulation method, const tv_camera *camera0,
                         const tv_camera *camera1, const double R[9], const double t[3],
                         const double *pixels0, const double *pixels1, int32_t num_points,
                         tv_point *points) {
  if (camera0 == nullptr || camera1 == nullptr || R == nullptr || t == nullptr) return TV_ERR_NULL;
  if (num_points < 0) return TV_ERR_ARGUMENT;
  if (num_points > 0 && (pixels0 == nullptr || pixels1 == nullptr || points == nullptr)) {
    return TV_ERR_NULL;
  }
  if (!tv::is_triangulation_method(method)) return TV_ERR_ARGUMENT;
  if (tv_camera_check(camera0) != TV_OK || tv_camera_check(camera1) != TV_OK) return TV_ERR_CAMERA;
  if (!all_finite(R, 9) || !all_finite(t, 3)) return TV_ERR_NOT_FINITE;
  if (!is_rotation(R)) return TV_ERR_ARGUMENT;
  if (t[0] == 0.0 && t[1] == 0.0 && t[2] == 0.0) return TV_ERR_ARGUMENT;

  const uint64_t count = static_cast<uint64_t>(num_points);
  const uint64_t points_bytes = count * sizeof(tv_point);
  const uint64_t pixels_bytes = count * 2 * sizeof(double);
  if (overlap(points, points_bytes, pixels0, pixels_bytes) ||
      overlap(points, points_bytes, pixels1, pixels_bytes)) {
    return TV_ERR_OVERLAP;
  }

  const tv::Camera prepared0 = tv::prepare_camera(*camera0);
  const tv::Camera prepared1 = tv::prepare_camera(*camera1);
  tv::Mat3 rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = R[i];
  const tv::TriangulationPair pair = tv::prepare_triangulation(
      prepared0, prepared1, rotation, tv::Vec3(t[0], t[1], t[2]));
  for (int32_t i = 0; i < num_points; ++i) {
    const tv::Vec2 pixel0(pixels0[2 * i], pixels0[2 * i + 1]);
    const tv::Vec2 pixel1(pixels1[2 * i], pixels1[2 * i + 1]);
    tv::triangulate_point(method, pair, pixel0, pixel1, &points[i]);
  }
  return TV_OK;
}
