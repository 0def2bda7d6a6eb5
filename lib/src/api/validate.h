// Checks that several entry points share. Each answers with the status to return.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "api/context.h"
#include "twoview/feature.h"
#include "twoview/two_view.h"

namespace tv {

inline bool is_finite(double x) { return x - x == 0.0; }

// An image that this context can take.
tv_status check_image(const tv_context& context, const tv_image* image);

// A mask is absent, or an image of the same size.
tv_status check_mask(const tv_image* mask, const tv_image& image);

// Copies the options (or the defaults for null) after checking them.
tv_status read_feature_options(const tv_context& context, const tv_feature_options* options,
                               tv_feature_options* checked);

// Reads an image's features, which need descriptors and may have keypoints; neither overlaps the
// output.
tv_status read_features(const tv_context& context, const tv_features* given, const void* out,
                        size_t out_bytes, tv_features* features);

// Reads matched pixels.
tv_status read_pixel_pairs(const tv_pixel_pairs* given, tv_pixel_pairs* pairs);

// Finite, of a positive size.
tv_status check_keypoints(const tv_keypoint* keypoints, int32_t count);

bool all_finite(const double* values, int num_values);

// R R' = I to 1e-6 and det R > 0.
bool is_rotation(const double R[9]);

// Whether two arrays share a byte.
inline bool overlap(const void* a, size_t a_bytes, const void* b, size_t b_bytes) {
  const uintptr_t a0 = reinterpret_cast<uintptr_t>(a), b0 = reinterpret_cast<uintptr_t>(b);
  return a_bytes > 0 && b_bytes > 0 && a0 < b0 + b_bytes && b0 < a0 + a_bytes;
}

}  // namespace tv
