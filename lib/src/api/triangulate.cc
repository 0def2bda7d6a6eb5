// The boundary of triangulation: validate, call.
#include "twoview/triangulate.h"

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "api/enum_value.h"
#include "api/validate.h"
#include "geometry/triangulation.h"

namespace {

constexpr double kRotationTolerance = 1e-6;

bool all_finite(const double *values, int num_values) {
  for (int i = 0; i < num_values; ++i) {
    if (!tv::is_finite(values[i])) return false;
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
  if (!tv::is_triangulation_method(tv::enum_value(method))) return TV_ERR_ARGUMENT;
  if (tv_camera_check(camera0) != TV_OK || tv_camera_check(camera1) != TV_OK) return TV_ERR_CAMERA;
  if (!all_finite(R, 9) || !all_finite(t, 3)) return TV_ERR_NOT_FINITE;
  if (!is_rotation(R)) return TV_ERR_ARGUMENT;
  if (t[0] == 0.0 && t[1] == 0.0 && t[2] == 0.0) return TV_ERR_ARGUMENT;

  const size_t points_bytes = static_cast<size_t>(num_points) * sizeof(tv_point);
  const size_t pixels_bytes = static_cast<size_t>(num_points) * 2 * sizeof(double);
  if (tv::overlap(points, points_bytes, pixels0, pixels_bytes) ||
      tv::overlap(points, points_bytes, pixels1, pixels_bytes)) {
    return TV_ERR_OVERLAP;
  }

  const tv::Camera prepared0 = tv::prepare_camera(*camera0);
  const tv::Camera prepared1 = tv::prepare_camera(*camera1);
  tv::Mat3 rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = R[i];
  const tv::TriangulationPair pair = tv::prepare_triangulation(
      prepared0, prepared1, rotation, tv::Vec3(t[0], t[1], t[2]));
  for (size_t i = 0; i < static_cast<size_t>(num_points); ++i) {
    const tv::Vec2 pixel0(pixels0[2 * i], pixels0[2 * i + 1]);
    const tv::Vec2 pixel1(pixels1[2 * i], pixels1[2 * i + 1]);
    tv::triangulate_point(method, pair, pixel0, pixel1, &points[i]);
  }
  return TV_OK;
}
