// The boundary of triangulation: validate, call.
#include "twoview/triangulate.h"

#include <cstddef>
#include <cstdint>

#include "api/enum_value.h"
#include "api/validate.h"
#include "geometry/triangulation.h"

namespace {

// What both entry points ask of cameras and pose.
tv_status check_pair(const tv_camera *camera0, const tv_camera *camera1, const double R[9],
                     const double t[3]) {
  if (tv_camera_check(camera0) != TV_OK || tv_camera_check(camera1) != TV_OK) return TV_ERR_CAMERA;
  if (!tv::all_finite(R, 9) || !tv::all_finite(t, 3)) return TV_ERR_NOT_FINITE;
  if (!tv::is_rotation(R)) return TV_ERR_ARGUMENT;
  if (t[0] == 0.0 && t[1] == 0.0 && t[2] == 0.0) return TV_ERR_ARGUMENT;
  return TV_OK;
}

tv::TriangulationPair prepare_pair(const tv::Camera &camera0, const tv::Camera &camera1,
                                   const double R[9], const double t[3]) {
  tv::Mat3 rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = R[i];
  return tv::prepare_triangulation(camera0, camera1, rotation, tv::Vec3(t[0], t[1], t[2]));
}

tv::Vec2 pixel_at(const double *pixels, size_t i) {
  return tv::Vec2(pixels[2 * i], pixels[2 * i + 1]);
}

bool any_overlap(const void *const *arrays, const size_t *bytes, int num_arrays, int first_output) {
  for (int i = first_output; i < num_arrays; ++i) {
    for (int k = 0; k < i; ++k) {
      if (tv::overlap(arrays[i], bytes[i], arrays[k], bytes[k])) return true;
    }
  }
  return false;
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
  const tv_status status = check_pair(camera0, camera1, R, t);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_points);
  const void *arrays[3] = {pixels0, pixels1, points};
  const size_t bytes[3] = {16 * n, 16 * n, n * sizeof(tv_point)};
  if (any_overlap(arrays, bytes, 3, 2)) return TV_ERR_OVERLAP;

  const tv::Camera prepared0 = tv::prepare_camera(*camera0);
  const tv::Camera prepared1 = tv::prepare_camera(*camera1);
  const tv::TriangulationPair pair = prepare_pair(prepared0, prepared1, R, t);
  tv::triangulate_points(method, pair, pixels0, pixels1, n, points);
  return TV_OK;
}

tv_status tv_correct_matches(tv_triangulation cost, const tv_camera *camera0,
                             const tv_camera *camera1, const double R[9], const double t[3],
                             const double *pixels0, const double *pixels1, int32_t num_points,
                             double *corrected0, double *corrected1, uint8_t *valid) {
  if (camera0 == nullptr || camera1 == nullptr || R == nullptr || t == nullptr) return TV_ERR_NULL;
  if (num_points < 0) return TV_ERR_ARGUMENT;
  if (num_points > 0 && (pixels0 == nullptr || pixels1 == nullptr || corrected0 == nullptr ||
                         corrected1 == nullptr || valid == nullptr)) {
    return TV_ERR_NULL;
  }
  const int method = tv::enum_value(cost);
  if (method != TV_TRIANGULATION_POLY && method != TV_TRIANGULATION_POLY_ABS) {
    return TV_ERR_ARGUMENT;
  }
  const tv_status status = check_pair(camera0, camera1, R, t);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_points);
  const void *arrays[5] = {pixels0, pixels1, corrected0, corrected1, valid};
  const size_t bytes[5] = {16 * n, 16 * n, 16 * n, 16 * n, n};
  if (any_overlap(arrays, bytes, 5, 2)) return TV_ERR_OVERLAP;

  const tv::Camera prepared0 = tv::prepare_camera(*camera0);
  const tv::Camera prepared1 = tv::prepare_camera(*camera1);
  const tv::TriangulationPair pair = prepare_pair(prepared0, prepared1, R, t);
  for (size_t i = 0; i < n; ++i) {
    tv::Vec2 moved[2] = {tv::Vec2(0, 0), tv::Vec2(0, 0)};
    valid[i] = tv::correct_pixels(cost, pair, pixel_at(pixels0, i), pixel_at(pixels1, i), moved);
    for (size_t k = 0; k < 2; ++k) {
      corrected0[2 * i + k] = moved[0][static_cast<int>(k)];
      corrected1[2 * i + k] = moved[1][static_cast<int>(k)];
    }
  }
  return TV_OK;
}
