#include "pipeline/extract.h"

#include <algorithm>

#include "feature/corners.h"
#include "feature/describe.h"
#include "feature/tilts.h"

namespace tv {
namespace {

Octaves octaves_for(tv_context* context, const tv_image& image, int32_t pooling,
                    const tv_keypoint* keypoints, int32_t count) {
  StageTimer timer(context, TV_STAGE_PYRAMID);
  const OctaveRange range = octave_range(keypoints, count, pooling);
  return make_octaves(*context->kernels, image, range.first, range.last, context->arena);
}

// Writes as many oriented keypoints as fit; returns how many there are in all. At most max_seconds
// second orientations are kept: those that come first in the order of the keypoints. upright_rad:
// the angle of upright ones.
int32_t orient_keypoints(const tv_context& context, const Octaves& octaves, int32_t orientation,
                         float upright_rad, const tv_keypoint* keypoints, int32_t count,
                         int32_t max_seconds, tv_keypoint* oriented, int32_t capacity) {
  int32_t total = 0, seconds = 0;
  for (int32_t k = 0; k < count; ++k) {
    float angles_rad[2] = {upright_rad, 0.0f};
    int32_t peaks = 1;
    if (orientation == TV_ORIENTATION_GRADIENT) {
      peaks = dominant_angles(*context.kernels, octaves, keypoints[k], angles_rad);
    }
    if (peaks == 2 && ++seconds > max_seconds) peaks = 1;
    for (int32_t p = 0; p < peaks; ++p, ++total) {
      if (total >= capacity) continue;
      oriented[total] = keypoints[k];
      oriented[total].angle_rad = angles_rad[p];
    }
  }
  return total;
}

}  // namespace

const tv_keypoint* detect_image(tv_context* context, const tv_image& image, const tv_image* mask,
                                const tv_feature_options& options, int32_t* count) {
  StageTimer timer(context, TV_STAGE_DETECT);
  tv_keypoint* corners =
      arena_alloc<tv_keypoint>(context->arena, static_cast<size_t>(options.max_keypoints));
  *count = find_corners(*context->kernels, image, mask, options, options.max_keypoints,
                        context->arena, corners);
  return corners;
}

int32_t orient_image(tv_context* context, const tv_image& image, const tv_keypoint* keypoints,
                     int32_t count, const tv_feature_options& options, tv_keypoint* oriented,
                     int32_t capacity) {
  ArenaScope scope(context->arena);
  const Octaves octaves = octaves_for(context, image, 0, keypoints, count);
  StageTimer timer(context, TV_STAGE_DESCRIBE);
  const int32_t total = orient_keypoints(*context, octaves, options.orientation, 0.0f, keypoints,
                                         count, count, nullptr, 0);
  if (total > capacity) return total;
  return orient_keypoints(*context, octaves, options.orientation, 0.0f, keypoints, count, count,
                          oriented, capacity);
}

void describe_image(tv_context* context, const tv_image& image, const tv_keypoint* keypoints,
                    int32_t count, const tv_feature_options& options, uint8_t* descriptors) {
  ArenaScope scope(context->arena);
  const Octaves octaves = octaves_for(context, image, options.pooling, keypoints, count);
  StageTimer timer(context, TV_STAGE_DESCRIBE);
  describe_keypoints(*context->kernels, octaves, keypoints, count, options.descriptor,
                     options.pooling, descriptors);
}

int32_t extract_image(tv_context* context, const tv_image& image, const tv_image* mask,
                      const tv_feature_options& options, float upright_rad, tv_keypoint* keypoints,
                      uint8_t* descriptors, int32_t capacity) {
  ArenaScope scope(context->arena);
  int32_t num_corners = 0;
  const tv_keypoint* corners = detect_image(context, image, mask, options, &num_corners);
  const Octaves octaves = octaves_for(context, image, options.pooling, corners, num_corners);
  StageTimer timer(context, TV_STAGE_DESCRIBE);
  tv_keypoint* oriented =
      arena_alloc<tv_keypoint>(context->arena, static_cast<size_t>(options.max_keypoints));
  const int32_t count =
      orient_keypoints(*context, octaves, options.orientation, upright_rad, corners, num_corners,
                       options.max_keypoints - num_corners, oriented, options.max_keypoints);
  if (count > capacity) return count;
  std::copy(oriented, oriented + count, keypoints);
  describe_keypoints(*context->kernels, octaves, keypoints, count, options.descriptor,
                     options.pooling, descriptors);
  return count;
}

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
      count = extract_image(context, image, mask, of_view, 0.0f, keypoints, descriptors,
                            of_view.max_keypoints);
    } else {
      const Squeeze squeeze = squeeze_of(tilt, image.width, image.height);
      if (of_view.max_keypoints == 0 || !is_usable(squeeze)) continue;
      Squeezed view;
      {
        StageTimer timer(context, TV_STAGE_PYRAMID);
        view = squeeze_image(*context->kernels, image, mask, squeeze, context->arena);
      }
      count = extract_image(context, view.image, &view.mask, of_view, upright_angle_rad(tilt),
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
