// The entry points of the dense cloud: they validate, and call pipeline/dense.h.
#include "pipeline/dense.h"

#include <initializer_list>

#include "api/camera_pair.h"
#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "kernels/dense.h"

namespace tv {
namespace {

constexpr int32_t kMaxSide = 16384;
constexpr tv_dense_options kDefaults = {
    sizeof(tv_dense_options), 400000, 256, 0, nullptr, 0.0, 0.0, 0.05};

tv_status read_options(const tv_dense_options* given, tv_dense_options* options) {
  *options = kDefaults;
  const tv_status status = read_sized(given, options);
  if (status != TV_OK) return status;
  if (!is_finite(options->min_parallax_rad) || !is_finite(options->max_parallax_rad) ||
      !is_finite(options->max_relative_sigma)) {
    return TV_ERR_NOT_FINITE;
  }
  if (options->sparse == nullptr && options->num_sparse > 0) return TV_ERR_NULL;
  const bool valid =
      within(options->max_cells, 1024, 1 << 24) && within(options->max_steps, 16, 512) &&
      options->num_sparse >= 0 && options->min_parallax_rad >= 0 &&
      options->max_parallax_rad <= kPi &&
      (options->max_parallax_rad == 0 || options->max_parallax_rad > options->min_parallax_rad) &&
      options->max_relative_sigma > 0 && options->max_relative_sigma <= 1;
  // The matcher takes a block of steps at a time.
  options->max_steps =
      (options->max_steps + TVK_DENSE_BLOCK - 1) / TVK_DENSE_BLOCK * TVK_DENSE_BLOCK;
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_cameras(const tv_camera* camera0, const tv_camera* camera1) {
  for (const tv_camera* camera : {camera0, camera1}) {
    const tv_status status = tv_camera_check(camera);
    if (status != TV_OK) return status;
    if (camera->width > kMaxSide || camera->height > kMaxSide) return TV_ERR_CAMERA;
  }
  return TV_OK;
}

}  // namespace
}  // namespace tv

void tv_dense_options_init_sized(tv_dense_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

tv_status tv_dense_size(const tv_camera* camera0, const tv_camera* camera1,
                        const tv_dense_options* options, size_t* size_bytes) {
  if (camera0 == nullptr || camera1 == nullptr || size_bytes == nullptr) return TV_ERR_NULL;
  tv_dense_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status == TV_OK) status = tv::check_cameras(camera0, camera1);
  if (status == TV_OK) *size_bytes = tv::densify_bytes(*camera0, *camera1, checked);
  return status;
}

tv_status tv_densify(void* memory, size_t size_bytes, const tv_camera_pair* pair,
                     const tv_image images[2], const tv_dense_options* options,
                     tv_dense_point* points, int32_t cap_points, int32_t* num_points) {
  if (memory == nullptr || pair == nullptr || images == nullptr || num_points == nullptr ||
      (points == nullptr && cap_points > 0)) {
    return TV_ERR_NULL;
  }
  const tv_camera &camera0 = pair->camera0, &camera1 = pair->camera1;
  tv_dense_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status == TV_OK) status = tv::check_cameras(&camera0, &camera1);
  if (status != TV_OK) return status;
  if (cap_points < 0) return TV_ERR_ARGUMENT;
  status = tv::check_camera_image(camera0, images[0]);
  if (status == TV_OK) status = tv::check_camera_image(camera1, images[1]);
  if (status == TV_OK) status = tv::check_pair(*pair);
  if (status != TV_OK) return status;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < tv::densify_bytes(camera0, camera1, checked)) return TV_ERR_MEMORY;
  const size_t num_sparse = static_cast<size_t>(checked.num_sparse);
  const tv::Bytes arrays[9] = {{points, static_cast<size_t>(cap_points) * sizeof(tv_dense_point)},
                               {num_points, sizeof *num_points},
                               {memory, size_bytes},
                               {images[0].data, tv::image_bytes(images[0])},
                               {images[1].data, tv::image_bytes(images[1])},
                               {checked.sparse, num_sparse * sizeof(tv_point)},
                               {pair, sizeof *pair},
                               {images, 2 * sizeof *images},
                               {options, options != nullptr ? options->struct_size : 0}};
  if (tv::outputs_overlap(arrays, 3, 9)) return TV_ERR_OVERLAP;

  tv::Arena arena = tv::arena_over(memory, size_bytes);
  *num_points = tv::densify(*pair, images, checked, arena, points, cap_points);
  return TV_OK;
}
