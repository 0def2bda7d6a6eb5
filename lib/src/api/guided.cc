// The entry point of guided matching: it validates, calls pipeline/guided.h, and writes the matches
// that fit.
#include "pipeline/guided.h"

#include <algorithm>

#include "api/camera_pair.h"
#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"

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
  tv_guided_options checked;
  tv_status status = tv::read_guided_options(options, &checked);
  if (status != TV_OK) return status;
  if (cap_correspondences < 0) return TV_ERR_ARGUMENT;
  if (!tv::all_finite(epipolar->matrix, 9)) return TV_ERR_NOT_FINITE;
  status = tv::check_optional_cameras(epipolar->camera0, epipolar->camera1);
  if (status != TV_OK) return status;
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
  tv::ArenaScope scope(context->arena);
  const tv_correspondence* found = nullptr;
  const int32_t count =
      tv::match_epipolar(context, *epipolar, features[0], features[1], checked, &found);
  *num_correspondences = count;
  if (count > cap_correspondences) return TV_ERR_CAPACITY;
  std::copy(found, found + count, correspondences);
  return TV_OK;
}
