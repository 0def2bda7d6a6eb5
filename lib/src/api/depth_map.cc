// The entry points of the depth map: they validate, and call pipeline/depth_map.h.
#include "pipeline/depth_map.h"

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "geometry/essential.h"

namespace tv {
namespace {

constexpr int32_t kMaxSide = 16384;
constexpr tv_depth_options kDefaults = {sizeof(tv_depth_options), 200000, 96, 5, 0.0, 0.0, 0.05};

// The options without the range.
tv_status read_options(const tv_depth_options* given, tv_depth_options* options) {
  *options = kDefaults;
  const tv_status status = read_sized(given, options);
  if (status != TV_OK) return status;
  if (!is_finite(options->near_depth) || !is_finite(options->far_depth) ||
      !is_finite(options->max_relative_sigma)) {
    return TV_ERR_NOT_FINITE;
  }
  const bool valid = within(options->max_pixels, 1024, 1 << 22) &&
                     within(options->max_planes, 16, 256) &&
                     within(options->max_views, 2, TV_DEPTH_MAX_VIEWS) &&
                     options->max_relative_sigma > 0 && options->max_relative_sigma <= 1;
  constexpr int32_t kBlock = TVK_DENSE_BLOCK;
  options->max_planes = (options->max_planes + kBlock - 1) / kBlock * kBlock;
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_reference(const tv_camera* camera) {
  const tv_status status = tv_camera_check(camera);
  if (status != TV_OK) return status;
  return camera->width > kMaxSide || camera->height > kMaxSide ? TV_ERR_CAMERA : TV_OK;
}

tv_status check_view(const tv_depth_view& view) {
  if (view.camera == nullptr || view.image.data == nullptr) return TV_ERR_NULL;
  tv_status status = check_reference(view.camera);
  if (status == TV_OK) status = check_camera_image(*view.camera, view.image);
  if (status != TV_OK) return status;
  if (!all_finite(view.world_from_cam_R, 9) || !all_finite(view.world_from_cam_t, 3)) {
    return TV_ERR_NOT_FINITE;
  }
  return is_rotation(view.world_from_cam_R) ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_overlap(const tv_depth_view* views, int32_t num_views, size_t pixels,
                        const tv_depth_arrays& arrays, void* memory, size_t size_bytes) {
  Bytes bytes[5 + TV_DEPTH_MAX_VIEWS] = {{arrays.distance, pixels * sizeof(float)},
                                         {arrays.sigma, pixels * sizeof(float)},
                                         {arrays.witnesses, pixels},
                                         {arrays.grey, arrays.grey == nullptr ? 0 : pixels},
                                         {memory, size_bytes}};
  for (int32_t v = 0; v < num_views; ++v) {
    bytes[5 + v] = {views[v].image.data, image_bytes(views[v].image)};
  }
  return outputs_overlap(bytes, 5, 5 + num_views) ? TV_ERR_OVERLAP : TV_OK;
}

}  // namespace
}  // namespace tv

void tv_depth_options_init_sized(tv_depth_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

tv_status tv_depth_map_camera(const tv_camera* reference, const tv_depth_options* options,
                              tv_camera* map_camera) {
  if (reference == nullptr || map_camera == nullptr) return TV_ERR_NULL;
  tv_depth_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status == TV_OK) status = tv::check_reference(reference);
  if (status == TV_OK) {
    *map_camera = tv::map_camera_of(tv::depth_grid(*reference, checked));
  }
  return status;
}

tv_status tv_depth_size(const tv_camera* reference, const tv_depth_options* options,
                        size_t* size_bytes) {
  if (reference == nullptr || size_bytes == nullptr) return TV_ERR_NULL;
  tv_depth_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status == TV_OK) status = tv::check_reference(reference);
  if (status == TV_OK) *size_bytes = tv::sweep_depth_bytes(*reference, checked);
  return status;
}

tv_status tv_sweep_depth(void* memory, size_t size_bytes, const tv_depth_view* views,
                         int32_t num_views, const tv_depth_options* options,
                         const tv_depth_arrays* arrays) {
  if (views == nullptr || options == nullptr || memory == nullptr || arrays == nullptr ||
      arrays->distance == nullptr || arrays->sigma == nullptr || arrays->witnesses == nullptr) {
    return TV_ERR_NULL;
  }
  tv_depth_options checked;
  tv_status status = tv::read_options(options, &checked);
  if (status != TV_OK) return status;
  if (!(checked.near_depth > 0 && checked.near_depth < checked.far_depth) ||
      !tv::within(num_views, 2, checked.max_views)) {
    return TV_ERR_ARGUMENT;
  }
  for (int32_t v = 0; v < num_views && status == TV_OK; ++v) status = tv::check_view(views[v]);
  if (status != TV_OK) return status;
  for (int32_t v = 1; v < num_views; ++v) {
    if (views[v].camera->width != views[0].camera->width ||
        views[v].camera->height != views[0].camera->height) {
      return TV_ERR_CAMERA;
    }
  }
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < tv::sweep_depth_bytes(*views[0].camera, checked)) return TV_ERR_MEMORY;
  const tv::MapGrid grid = tv::depth_grid(*views[0].camera, checked);
  const size_t pixels = static_cast<size_t>(grid.width) * static_cast<size_t>(grid.height);
  status = tv::check_overlap(views, num_views, pixels, *arrays, memory, size_bytes);
  if (status != TV_OK) return status;

  tv::Arena arena = tv::arena_over(memory, size_bytes);
  tv::sweep_depth(views, num_views, checked, arena, *arrays);
  return TV_OK;
}
