// The extraction of keypoints behind tv_extract: over one image, and over the views of a rung of
// effort.
#pragma once

#include "pipeline/context.h"
#include "twoview/feature.h"

namespace tv {

// tv_extract without its checks. The options are read; upright_rad is the angle of upright
// keypoints. Returns how many keypoints there are; where that is above `capacity`, none is written.
int32_t extract_keypoints(tv_context* context, const tv_image& image, const tv_image* mask,
                          const tv_feature_options& options, float upright_rad,
                          tv_keypoint* keypoints, uint8_t* descriptors, int32_t capacity);

// The keypoints of an image on a rung: where they are, what describes them, and the tilt (feature/
// tilts.h) of the view that each was found in. The keypoints of tilt 0 come first, strongest first,
// then those of the next tilt.
struct RungKeypoints {
  tv_keypoint* keypoints;
  uint8_t* descriptors;
  uint8_t* tilts;  // may be null on rungs without squeezed views
  int32_t num;
};

// Fills the arrays, which have room for rung_budget(rung, options.max_keypoints), and `num`. The
// options are read.
void extract_rung(tv_context* context, const tv_image& image, const tv_image* mask,
                  const tv_feature_options& options, int32_t rung, RungKeypoints* found);

}  // namespace tv
