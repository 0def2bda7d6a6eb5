// The entry point of guided matching: it validates, computes the keypoints' rays, and calls
// match/guided.h.
#include "match/guided.h"

#include <algorithm>

#include "api/scratch.h"
#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "geometry/camera.h"

namespace tv {
namespace {

constexpr tv_guided_options kDefaults = {sizeof(tv_guided_options), 4.0f, 0.87f, 180.0f, 4.0f};

tv_status read_guided_options(const tv_guided_options* options, tv_guided_options* checked) {
  *checked = kDefaults;
  const tv_status status = read_sized(options, checked);
  if (status != TV_OK) return status;
  const bool valid = within(checked->max_error_px, 0.01f, 1000.0f) && checked->ratio > 0.0f &&
                     checked->ratio <= 1.0f && checked->max_distance > 0.0f &&
                     checked->max_distance <= 3000.0f &&
                     within(checked->neighbourhood_px, 0.0f, 1000.0f);
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

// Reads the keypoints of one view. Without a camera (null) the ray of a pixel is (x, y, 1).
GuidedView make_view(const tv_camera* camera, const tv_features& features, Arena& arena) {
  const tv_keypoint* const keypoints = features.keypoints;
  const size_t n = static_cast<size_t>(features.num);
  double* rays = arena_alloc<double>(arena, 3 * n);
  double* slopes = arena_alloc<double>(arena, 6 * n);
  uint8_t* valid = arena_alloc<uint8_t>(arena, n);
  const Camera prepared = camera != nullptr ? prepare_camera(*camera) : Camera{};
  for (size_t k = 0; k < n; ++k) {
    const Vec2 pixel(keypoints[k].x, keypoints[k].y);
    Vec3 ray(pixel[0], pixel[1], 1);
    Mat32 slope;
    slope << 1, 0, 0, 1, 0, 0;
    valid[k] = camera == nullptr || unproject(prepared, pixel, &ray, &slope);
    double* const to = rays + 3 * k;
    for (int i = 0; i < 3; ++i) to[i] = ray[i];
    for (int i = 0; i < 6; ++i) slopes[6 * k + static_cast<size_t>(i)] = slope(i / 2, i % 2);
  }
  return GuidedView{keypoints, features.descriptors, rays, slopes, valid, features.num};
}

}  // namespace

}  // namespace tv

void tv_guided_options_init_sized(tv_guided_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

tv_status tv_match_guided(tv_context* context, const tv_epipolar* epipolar,
                          const tv_features* features0, const tv_features* features1,
                          const tv_guided_options* options, tv_correspondence* correspondences,
                          int32_t cap_correspondences, int32_t* num_correspondences) {
  if (context == nullptr || epipolar == nullptr || num_correspondences == nullptr ||
      (correspondences == nullptr && cap_correspondences > 0)) {
    return TV_ERR_NULL;
  }
  const tv_camera *const camera0 = epipolar->camera0, *const camera1 = epipolar->camera1;
  const double* const matrix = epipolar->matrix;
  tv_guided_options checked;
  tv_status status = tv::read_guided_options(options, &checked);
  if (status != TV_OK) return status;
  if (cap_correspondences < 0 || (camera0 == nullptr) != (camera1 == nullptr)) {
    return TV_ERR_ARGUMENT;
  }
  // The scale of the matrix is arbitrary; with a largest entry of 1 its squares stay within a
  // double's range.
  double scaled[9], largest = 0;
  for (int k = 0; k < 9; ++k) {
    if (!tv::is_finite(matrix[k])) return TV_ERR_NOT_FINITE;
    const double size = matrix[k] < 0 ? -matrix[k] : matrix[k];
    largest = size > largest ? size : largest;
  }
  for (int k = 0; k < 9; ++k) scaled[k] = largest > 0 ? matrix[k] / largest : 0;
  if (camera0 != nullptr) {
    status = tv_camera_check(camera0);
    if (status == TV_OK) status = tv_camera_check(camera1);
    if (status != TV_OK) return status;
  }
  const size_t out_bytes = static_cast<size_t>(cap_correspondences) * sizeof(tv_correspondence);
  const tv_features* const given[2] = {features0, features1};
  tv_features features[2];
  for (int v = 0; v < 2; ++v) {
    status = tv::read_features(*context, given[v], TV_PURPOSE_MATCH_GUIDED, correspondences,
                               out_bytes, &features[v]);
    if (status != TV_OK) return status;
    if (features[v].num > 0 && features[v].keypoints == nullptr) return TV_ERR_NULL;
    status = tv::check_keypoints(features[v].keypoints, features[v].num);
    if (status != TV_OK) return status;
  }
  tv::StageTimer timer(context, TV_STAGE_MATCH);
  tv::ArenaScope scope(context->arena);
  const int32_t most = std::min(features[0].num, features[1].num);
  tv_correspondence* found =
      tv::arena_alloc<tv_correspondence>(context->arena, static_cast<size_t>(most));
  const tv::GuidedView view0 = tv::make_view(camera0, features[0], context->arena);
  const tv::GuidedView view1 = tv::make_view(camera1, features[1], context->arena);
  const int32_t count =
      tv::match_guided(*context->kernels, view0, view1, scaled, checked, context->arena, found);
  *num_correspondences = count;
  if (count > cap_correspondences) return TV_ERR_CAPACITY;
  for (int32_t k = 0; k < count; ++k) correspondences[k] = found[k];
  return TV_OK;
}
