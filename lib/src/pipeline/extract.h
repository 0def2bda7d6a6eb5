// The keypoints of an image: its corners, their orientation and description over one pyramid, and
// all of these over the views of a rung of effort. All arguments are checked.
#pragma once

#include "pipeline/context.h"
#include "twoview/feature.h"

namespace tv {

// The corners, in the arena, whose scope is the caller's. Writes how many there are.
const tv_keypoint* detect_image(tv_context* context, const tv_image& image, const tv_image* mask,
                                const tv_feature_options& options, int32_t* count);

// The keypoints with their one or two orientations. Returns how many there are; where that is above
// `capacity`, none is written.
int32_t orient_image(tv_context* context, const tv_image& image, const tv_keypoint* keypoints,
                     int32_t count, const tv_feature_options& options, tv_keypoint* oriented,
                     int32_t capacity);

// The descriptors of at least one keypoint.
void describe_image(tv_context* context, const tv_image& image, const tv_keypoint* keypoints,
                    int32_t count, const tv_feature_options& options, uint8_t* descriptors);

// All three steps. upright_rad is the angle of upright keypoints. Returns how many keypoints there
// are; where that is above `capacity`, none is written.
int32_t extract_image(tv_context* context, const tv_image& image, const tv_image* mask,
                      const tv_feature_options& options, float upright_rad, tv_keypoint* keypoints,
                      uint8_t* descriptors, int32_t capacity);

// The keypoints of an image on a rung: where they are, what describes them, and the tilt (feature/
// tilts.h) of the view that each was found in. The keypoints of tilt 0 come first, strongest first,
// then those of the next tilt.
struct RungKeypoints {
  tv_keypoint* keypoints;
  uint8_t* descriptors;
  uint8_t* tilts;  // may be null on rungs without squeezed views
  int32_t num;
};

// Fills the arrays, which have room for rung_budget(rung, options.max_keypoints), and `num`.
void extract_rung(tv_context* context, const tv_image& image, const tv_image* mask,
                  const tv_feature_options& options, int32_t rung, RungKeypoints* found);

}  // namespace tv
