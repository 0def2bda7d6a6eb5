// The entry point of matching: it validates, calls match/match.h, and writes the matches that fit.
#include "match/match.h"

#include <algorithm>

#include "api/sized.h"
#include "api/validate.h"

namespace {

constexpr tv_match_options kDefaults = {sizeof(tv_match_options), 0.92f};

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
  tv_match_options checked = kDefaults;
  tv_status status = tv::read_sized(options, &checked);
  if (status != TV_OK) return status;
  if (!(checked.ratio > 0.0f && checked.ratio <= 1.0f) || cap_correspondences < 0) {
    return TV_ERR_ARGUMENT;
  }
  const size_t out_bytes = static_cast<size_t>(cap_correspondences) * sizeof(tv_correspondence);
  tv_features a, b;
  status = tv::read_features(*context, features0, TV_PURPOSE_MATCH, correspondences, out_bytes, &a);
  if (status == TV_OK) {
    status =
        tv::read_features(*context, features1, TV_PURPOSE_MATCH, correspondences, out_bytes, &b);
  }
  if (status != TV_OK) return status;
  tv::StageTimer timer(context, TV_STAGE_MATCH);
  tv::ArenaScope scope(context->arena);
  tv_correspondence* found = tv::arena_alloc<tv_correspondence>(
      context->arena, static_cast<size_t>(std::min(a.num, b.num)));
  const int32_t count =
      tv::match_descriptors(*context->kernels, a.descriptors, a.num, b.descriptors, b.num,
                            checked.ratio, context->arena, found);
  *num_correspondences = count;
  if (count > cap_correspondences) return TV_ERR_CAPACITY;
  for (int32_t k = 0; k < count; ++k) correspondences[k] = found[k];
  return TV_OK;
}
