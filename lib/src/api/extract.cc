// The keypoints of a rung of effort, view by view.
#include "api/extract.h"

#include <algorithm>

#include "api/validate.h"
#include "feature/tilts.h"

namespace tv {

static_assert(kMostKeypointSize == kMaxKeypointSize, "matching takes mapped keypoints");

void extract_rung(tv_context* context, const tv_image& image, const tv_image* mask,
                  const tv_feature_options& options, int32_t rung, RungKeypoints* found) {
  tv_feature_options of_view = options;
  found->num = 0;
  for (int32_t tilt = 0; tilt < tilts_of_rung(rung); ++tilt) {
    ArenaScope scope(context->arena);
    of_view.max_keypoints = view_budget(rung, tilt, options.max_keypoints);
    tv_keypoint* const keypoints = found->keypoints + found->num;
    uint8_t* const descriptors =
        found->descriptors + static_cast<size_t>(found->num) * TV_DESCRIPTOR_BYTES;
    int32_t count = 0;
    if (tilt == 0) {
      count = extract_keypoints(context, image, mask, of_view, 0.0f, keypoints, descriptors,
                                of_view.max_keypoints);
    } else {
      const Squeeze squeeze = squeeze_of(tilt, image.width, image.height);
      if (of_view.max_keypoints == 0 || !is_usable(squeeze)) continue;
      Squeezed view;
      {
        StageTimer timer(context, TV_STAGE_PYRAMID);
        view = squeeze_image(*context->kernels, image, mask, squeeze, context->arena);
      }
      count = extract_keypoints(context, view.image, &view.mask, of_view, upright_angle_rad(tilt),
                                keypoints, descriptors, of_view.max_keypoints);
      map_keypoints(squeeze, keypoints, count);
    }
    if (found->tilts != nullptr) {
      std::fill_n(found->tilts + found->num, count, static_cast<uint8_t>(tilt));
    }
    found->num += count;
  }
}

}  // namespace tv
