// The entry point of matching: it validates, calls match/match.h, and writes the matches that fit.
#include "match/match.h"

#include "api/sized.h"
#include "api/validate.h"

namespace {

constexpr tv_match_options kDefaults = {sizeof(tv_match_options), 0.92f, 10.0f, 0.0f};

}  // namespace

void tv_match_options_init_sized(tv_match_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &kDefaults, sizeof kDefaults);
}

tv_status tv_match(tv_context* context, const tv_features* features0, const tv_features* features1,
                   const tv_match_options* options, tv_correspondence* correspondences,
                   int32_t cap_correspondences, int32_t* num_correspondences) {
  if (context == nullptr || num_correspondences == nullptr ||
      (correspondences == nullptr && cap_correspondences > 0)) {
    return TV_ERR_NULL;
  }
  tv_match_options checked;
  tv_status status = tv::read_match_options(options, &checked);
  if (status != TV_OK) return status;
  if (cap_correspondences < 0) return TV_ERR_ARGUMENT;
  const size_t out_bytes = static_cast<size_t>(cap_correspondences) * sizeof(tv_correspondence);
  const tv_features* const given[2] = {features0, features1};
  tv_features features[2];
  for (int v = 0; v < 2; ++v) {
    status = tv::read_features(*context, given[v], TV_PURPOSE_MATCH, correspondences, out_bytes,
                               &features[v]);
    if (status != TV_OK) return status;
  }
  if (features[0].keypoints == nullptr && features[1].keypoints == nullptr) {
    checked.neighbourhood_px = 0.0f;
  }
  for (const tv_features& image : features) {
    if (checked.neighbourhood_px == 0.0f || image.num == 0) continue;
    if (image.keypoints == nullptr) return TV_ERR_NULL;
    status = tv::check_keypoints(image.keypoints, image.num);
    if (status != TV_OK) return status;
  }
  tv::StageTimer timer(context, TV_STAGE_MATCH);
  tv::ArenaScope scope(context->arena);
  const tv_correspondence* found = nullptr;
  const int32_t count = tv::match_descriptors(*context->kernels, features[0], features[1], checked,
                                              context->arena, &found);
  *num_correspondences = count;
  if (count > cap_correspondences) return TV_ERR_CAPACITY;
  for (int32_t k = 0; k < count; ++k) correspondences[k] = found[k];
  return TV_OK;
}
