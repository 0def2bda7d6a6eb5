// The entry points of triangulation and of corrected matches: they validate and call
// triangulation/triangulation.h.
#include "twoview/triangulate.h"

#include <cstddef>
#include <cstdint>

#include "api/enum_value.h"
#include "api/validate.h"
#include "geometry/essential.h"
#include "triangulation/triangulation.h"

namespace {

// The checks of cameras and pose that both entry points share.
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
  const tv::Bytes arrays[3] = {
      {points, n * sizeof(tv_point)}, {pixels0, 16 * n}, {pixels1, 16 * n}};
  if (tv::outputs_overlap(arrays, 1, 3)) return TV_ERR_OVERLAP;

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
  const tv::Bytes arrays[5] = {
      {corrected0, 16 * n}, {corrected1, 16 * n}, {valid, n}, {pixels0, 16 * n}, {pixels1, 16 * n}};
  if (tv::outputs_overlap(arrays, 3, 5)) return TV_ERR_OVERLAP;

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
