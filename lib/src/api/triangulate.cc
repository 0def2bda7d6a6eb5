// The entry points of triangulation and of corrected matches: they validate and call
// triangulation/triangulation.h.
#include "twoview/triangulate.h"

#include <cstddef>
#include <cstdint>

#include "api/camera_pair.h"
#include "api/enum_value.h"
#include "api/validate.h"
#include "triangulation/triangulation.h"

namespace {

tv::Vec2 pixel_at(const double *pixels, size_t i) {
  return tv::Vec2(pixels[2 * i], pixels[2 * i + 1]);
}

}  // namespace

tv_status tv_triangulate(const tv_camera_pair *pair, const tv_pixel_pairs *pixels,
                         tv_triangulation method, tv_point *points) {
  if (pair == nullptr) return TV_ERR_NULL;
  tv_pixel_pairs given;
  tv_status status = tv::read_pixels(pixels, &given);
  if (status != TV_OK) return status;
  if (given.num > 0 && points == nullptr) return TV_ERR_NULL;
  if (!tv::is_triangulation_method(tv::enum_value(method))) return TV_ERR_ARGUMENT;
  status = tv::check_pair(*pair);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(given.num);
  const tv::Bytes arrays[5] = {{points, n * sizeof(tv_point)},
                               {given.pixels0, 16 * n},
                               {given.pixels1, 16 * n},
                               {pair, sizeof *pair},
                               {pixels, pixels->struct_size}};
  if (tv::outputs_overlap(arrays, 1, 5)) return TV_ERR_OVERLAP;

  const tv::Camera camera0 = tv::prepare_camera(pair->camera0);
  const tv::Camera camera1 = tv::prepare_camera(pair->camera1);
  const tv::TriangulationPair prepared = tv::prepare_triangulation(camera0, camera1, *pair);
  tv::triangulate_points(method, prepared, given.pixels0, given.pixels1, n, points);
  return TV_OK;
}

tv_status tv_correct_matches(const tv_camera_pair *pair, const tv_pixel_pairs *pixels,
                             tv_triangulation cost, double *corrected0, double *corrected1,
                             uint8_t *valid) {
  if (pair == nullptr) return TV_ERR_NULL;
  tv_pixel_pairs given;
  tv_status status = tv::read_pixels(pixels, &given);
  if (status != TV_OK) return status;
  if (given.num > 0 && (corrected0 == nullptr || corrected1 == nullptr || valid == nullptr)) {
    return TV_ERR_NULL;
  }
  const int method = tv::enum_value(cost);
  if (method != TV_TRIANGULATION_POLY && method != TV_TRIANGULATION_POLY_ABS) {
    return TV_ERR_ARGUMENT;
  }
  status = tv::check_pair(*pair);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(given.num);
  const tv::Bytes arrays[7] = {
      {corrected0, 16 * n},         {corrected1, 16 * n},    {valid, n},
      {given.pixels0, 16 * n},      {given.pixels1, 16 * n}, {pair, sizeof *pair},
      {pixels, pixels->struct_size}};
  if (tv::outputs_overlap(arrays, 3, 7)) return TV_ERR_OVERLAP;

  const tv::Camera camera0 = tv::prepare_camera(pair->camera0);
  const tv::Camera camera1 = tv::prepare_camera(pair->camera1);
  const tv::TriangulationPair prepared = tv::prepare_triangulation(camera0, camera1, *pair);
  for (size_t i = 0; i < n; ++i) {
    tv::Vec2 moved[2] = {tv::Vec2(0, 0), tv::Vec2(0, 0)};
    valid[i] = tv::correct_pixels(cost, prepared, pixel_at(given.pixels0, i),
                                  pixel_at(given.pixels1, i), moved);
    for (size_t k = 0; k < 2; ++k) {
      corrected0[2 * i + k] = moved[0][static_cast<int>(k)];
      corrected1[2 * i + k] = moved[1][static_cast<int>(k)];
    }
  }
  return TV_OK;
}
