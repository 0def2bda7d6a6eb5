#include "match/match.h"

#include "api/validate.h"

void tv_match_options_init(tv_match_options* options) {
  if (options == nullptr) return;
  *options = tv_match_options{sizeof(tv_match_options), 0.92f};
}

tv_status tv_match(tv_context* context, const uint8_t* descriptors0, int32_t num0,
                   const uint8_t* descriptors1, int32_t num1, const tv_match_options* options,
                   tv_correspondence* correspondences, int32_t cap_correspondences,
                   int32_t* num_correspondences) {
  tv_match_options checked;
  tv_match_options_init(&checked);
  if (context == nullptr || num_correspondences == nullptr ||
      (descriptors0 == nullptr && num0 > 0) || (descriptors1 == nullptr && num1 > 0) ||
      (correspondences == nullptr && cap_correspondences > 0)) {
    return TV_ERR_NULL;
  }
  if (options != nullptr) {
    if (options->struct_size != sizeof(tv_match_options)) return TV_ERR_STRUCT_SIZE;
    checked = *options;
  }
  if (!(checked.ratio > 0.0f && checked.ratio <= 1.0f) || num0 < 0 || num1 < 0 ||
      cap_correspondences < 0) {
    return TV_ERR_ARGUMENT;
  }
  if (num0 > context->limits.max_keypoints || num1 > context->limits.max_keypoints ||
      !tv::made_for(*context, TV_PURPOSE_MATCH)) {
    return TV_ERR_LIMITS;
  }
  const size_t out_bytes = static_cast<size_t>(cap_correspondences) * sizeof(tv_correspondence);
  if (tv::overlap(correspondences, out_bytes, descriptors0,
                  static_cast<size_t>(num0) * TV_DESCRIPTOR_BYTES) ||
      tv::overlap(correspondences, out_bytes, descriptors1,
                  static_cast<size_t>(num1) * TV_DESCRIPTOR_BYTES)) {
    return TV_ERR_OVERLAP;
  }
  tv::StageTimer timer(context, TV_STAGE_MATCH);
  tv::ArenaScope scope(context->arena);
  const int32_t most = num0 < num1 ? num0 : num1;
  tv_correspondence* found =
      tv::arena_alloc<tv_correspondence>(context->arena, static_cast<size_t>(most));
  const int32_t count = tv::match_descriptors(*context->kernels, descriptors0, num0, descriptors1,
                                              num1, checked.ratio, context->arena, found);
  *num_correspondences = count;
  if (count > cap_correspondences) return TV_ERR_CAPACITY;
  for (int32_t k = 0; k < count; ++k) correspondences[k] = found[k];
  return TV_OK;
}
