// The entry points of the camera models: they validate, call geometry/camera.h, and write the
// results.
#include "twoview/camera.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "api/validate.h"
#include "geometry/camera.h"

namespace {

using tv::is_finite;

// Checks the arguments in this order: null pointers, the camera, numbers that are not finite.
tv_status check_input(const tv_camera *camera, const double *values, int num_values,
                      const void *output) {
  if (camera == nullptr || values == nullptr || output == nullptr) return TV_ERR_NULL;
  const tv_status status = tv_camera_check(camera);
  if (status != TV_OK) return status;
  for (int i = 0; i < num_values; ++i) {
    if (!is_finite(values[i])) return TV_ERR_NOT_FINITE;
  }
  return TV_OK;
}

int32_t scaled_size(int32_t size, double scale) {
  const double rounded = size * scale + 0.5;
  return rounded < 1.0 ? 1 : static_cast<int32_t>(rounded);
}

// The checks of the calls on many points. Each point has `in_wide` numbers of input and `out_wide`
// of output.
tv_status check_many(const tv_camera *camera, const double *in, size_t in_wide, int32_t count,
                     const double *out, size_t out_wide, const uint8_t *inside) {
  if (camera == nullptr) return TV_ERR_NULL;
  if (count > 0 && (in == nullptr || out == nullptr || inside == nullptr)) return TV_ERR_NULL;
  if (count < 0) return TV_ERR_ARGUMENT;
  const tv_status status = tv_camera_check(camera);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(count);
  const tv::Bytes arrays[3] = {{out, 8 * out_wide * n}, {inside, n}, {in, 8 * in_wide * n}};
  return tv::outputs_overlap(arrays, 2, 3) ? TV_ERR_OVERLAP : TV_OK;
}

}  // namespace

tv_status tv_camera_check(const tv_camera *camera) {
  if (camera == nullptr) return TV_ERR_NULL;
  if (camera->model < TV_CAMERA_PINHOLE || camera->model > TV_CAMERA_KANNALA_BRANDT) {
    return TV_ERR_CAMERA;
  }
  if (camera->width < 1 || camera->height < 1 || camera->reserved != 0) return TV_ERR_CAMERA;
  if (!is_finite(camera->fx) || !is_finite(camera->fy)) return TV_ERR_CAMERA;
  if (!(camera->fx > 0.0) || !(camera->fy > 0.0)) return TV_ERR_CAMERA;
  if (!is_finite(camera->cx) || !is_finite(camera->cy)) return TV_ERR_CAMERA;
  for (double k : camera->k) {
    if (!is_finite(k)) return TV_ERR_CAMERA;
  }
  return TV_OK;
}

tv_status tv_camera_valid_angle(const tv_camera *camera, double *angle_rad) {
  if (camera == nullptr || angle_rad == nullptr) return TV_ERR_NULL;
  const tv_status status = tv_camera_check(camera);
  if (status != TV_OK) return status;
  *angle_rad = tv::prepare_camera(*camera).valid_angle_rad;
  return TV_OK;
}

tv_status tv_camera_project(const tv_camera *camera, const double point[3], double pixel[2],
                            double *jacobian) {
  const tv_status status = check_input(camera, point, 3, pixel);
  if (status != TV_OK) return status;
  tv::Vec2 projected;
  tv::Mat23 d_pixel;
  if (!tv::project(tv::prepare_camera(*camera), tv::Vec3(point[0], point[1], point[2]), &projected,
                   jacobian ? &d_pixel : nullptr)) {
    return TV_ERR_OUTSIDE;
  }
  // A focal length or a coordinate near the largest double makes the result overflow.
  if (!tv::all_finite(projected.data(), 2)) return TV_ERR_OUTSIDE;
  if (jacobian && !tv::all_finite(d_pixel.data(), 6)) return TV_ERR_OUTSIDE;
  pixel[0] = projected[0];
  pixel[1] = projected[1];
  if (jacobian) std::copy_n(d_pixel.data(), 6, jacobian);
  return TV_OK;
}

tv_status tv_camera_project_points(const tv_camera *camera, const double *points,
                                   int32_t num_points, double *pixels, uint8_t *inside) {
  const tv_status status = check_many(camera, points, 3, num_points, pixels, 2, inside);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_points);
  const tv::Camera prepared = tv::prepare_camera(*camera);
  for (size_t i = 0; i < n; ++i) {
    const double *p = points + 3 * i;
    tv::Vec2 pixel(0, 0);
    inside[i] = tv::all_finite(p, 3) &&
                tv::project(prepared, tv::Vec3(p[0], p[1], p[2]), &pixel, nullptr) &&
                tv::all_finite(pixel.data(), 2);
    if (!inside[i]) pixel.setZero();
    pixels[2 * i] = pixel[0];
    pixels[2 * i + 1] = pixel[1];
  }
  return TV_OK;
}

tv_status tv_camera_unproject(const tv_camera *camera, const double pixel[2], double ray[3],
                              double *jacobian) {
  const tv_status status = check_input(camera, pixel, 2, ray);
  if (status != TV_OK) return status;
  tv::Vec3 unprojected;
  tv::Mat32 d_ray;
  if (!tv::unproject(tv::prepare_camera(*camera), tv::Vec2(pixel[0], pixel[1]), &unprojected,
                     jacobian ? &d_ray : nullptr)) {
    return TV_ERR_OUTSIDE;
  }
  if (!tv::all_finite(unprojected.data(), 3)) return TV_ERR_OUTSIDE;
  if (jacobian && !tv::all_finite(d_ray.data(), 6)) return TV_ERR_OUTSIDE;
  for (int i = 0; i < 3; ++i) ray[i] = unprojected[i];
  if (jacobian) {
    for (int i = 0; i < 6; ++i) jacobian[i] = d_ray(i / 2, i % 2);
  }
  return TV_OK;
}

tv_status tv_camera_unproject_points(const tv_camera *camera, const double *pixels,
                                     int32_t num_pixels, double *rays, uint8_t *inside) {
  const tv_status status = check_many(camera, pixels, 2, num_pixels, rays, 3, inside);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_pixels);
  const tv::Camera prepared = tv::prepare_camera(*camera);
  for (size_t i = 0; i < n; ++i) {
    const double *p = pixels + 2 * i;
    tv::Vec3 ray(0, 0, 0);
    inside[i] = tv::all_finite(p, 2) &&
                tv::unproject(prepared, tv::Vec2(p[0], p[1]), &ray, nullptr) &&
                tv::all_finite(ray.data(), 3);
    if (!inside[i]) ray.setZero();
    for (size_t k = 0; k < 3; ++k) rays[3 * i + k] = ray[static_cast<int>(k)];
  }
  return TV_OK;
}

tv_status tv_camera_undistort(const tv_camera *camera, const double pixel[2],
                              double undistorted[2]) {
  const tv_status status = check_input(camera, pixel, 2, undistorted);
  if (status != TV_OK) return status;
  tv::Vec3 ray;
  if (!tv::unproject(tv::prepare_camera(*camera), tv::Vec2(pixel[0], pixel[1]), &ray, nullptr)) {
    return TV_ERR_OUTSIDE;
  }
  if (!(ray[2] > 0.0)) return TV_ERR_OUTSIDE;
  const double x = camera->fx * (ray[0] / ray[2]) + camera->cx;
  const double y = camera->fy * (ray[1] / ray[2]) + camera->cy;
  if (!is_finite(x) || !is_finite(y)) return TV_ERR_OUTSIDE;
  undistorted[0] = x;
  undistorted[1] = y;
  return TV_OK;
}

tv_status tv_camera_scale(const tv_camera *camera, double scale, tv_camera *scaled) {
  const tv_status status = check_input(camera, &scale, 1, scaled);
  if (status != TV_OK) return status;
  if (!(scale > 0.0 && scale <= 16.0)) return TV_ERR_ARGUMENT;
  const double largest = std::numeric_limits<int32_t>::max();
  if (camera->width * scale + 0.5 > largest || camera->height * scale + 0.5 > largest) {
    return TV_ERR_ARGUMENT;
  }
  tv_camera result = *camera;
  result.fx = scale * camera->fx;
  result.fy = scale * camera->fy;
  result.cx = scale * (camera->cx + 0.5) - 0.5;
  result.cy = scale * (camera->cy + 0.5) - 0.5;
  result.width = scaled_size(camera->width, scale);
  result.height = scaled_size(camera->height, scale);
  // A product may overflow, or a focal length become 0.
  if (tv_camera_check(&result) != TV_OK) return TV_ERR_ARGUMENT;
  *scaled = result;
  return TV_OK;
}
