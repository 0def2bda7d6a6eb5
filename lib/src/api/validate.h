// Checks of arguments that several entry points share, and the functions that check and copy
// options and inputs. A tv_status that they return is the one that the entry point must return.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/math.h"
#include "feature/sigmas.h"
#include "pipeline/context.h"
#include "twoview/feature.h"
#include "twoview/match.h"
#include "twoview/two_view.h"

namespace tv {

// Whether an image is valid and within the context's limits, and the context was made for
// TV_PURPOSE_EXTRACT.
tv_status check_image(const tv_context& context, const tv_image* image);

// Whether a mask is null or a valid image of the same size.
tv_status check_mask(const tv_image* mask, const tv_image& image);

// Whether an image has its data, its camera's size and a valid stride: TV_ERR_NULL, TV_ERR_CAMERA
// or TV_ERR_ARGUMENT.
tv_status check_camera_image(const tv_camera& camera, const tv_image& image);

// How many bytes an image spans, from its first pixel to its last.
size_t image_bytes(const tv_image& image);

// Copies the options (or the defaults for null) after checking them.
tv_status read_feature_options(const tv_context& context, const tv_feature_options* options,
                               tv_feature_options* checked);

tv_status read_match_options(const tv_match_options* options, tv_match_options* checked);

// Checks and copies an image's features for a call of that purpose: descriptors are required,
// keypoints are not, and neither may overlap the output.
tv_status read_features(const tv_context& context, const tv_features* given, uint32_t purpose,
                        const void* out, size_t out_bytes, tv_features* features);

// Checks the caller's struct of matched pixels but for its sigmas, and copies it to *pairs.
tv_status read_pixels(const tv_pixel_pairs* given, tv_pixel_pairs* pairs);

// The same with the sigmas, for the calls that read them.
tv_status read_pixel_pairs(const tv_pixel_pairs* given, tv_pixel_pairs* pairs);

// Whether each keypoint is finite, with coordinates within 1e5 pixels, a size in (0, 4096] pixels
// and an angle within 1000 radians.
tv_status check_keypoints(const tv_keypoint* keypoints, int32_t count);

// Checks two directions of gravity, unless sigma_rad is 0: finite and not zero, with a standard
// deviation of at most pi.
tv_status check_gravity(const double gravity0[3], const double gravity1[3], double sigma_rad);

// Whether two arrays share a byte. An array of no bytes shares none.
inline bool overlap(const void* a, size_t a_bytes, const void* b, size_t b_bytes) {
  const uintptr_t a0 = reinterpret_cast<uintptr_t>(a), b0 = reinterpret_cast<uintptr_t>(b);
  return a_bytes > 0 && b_bytes > 0 && a0 < b0 + b_bytes && b0 < a0 + a_bytes;
}

struct Bytes {
  const void* data;  // null for an array that is absent
  size_t size;
};

// Whether one of the first num_outputs arrays shares a byte with any other array.
bool outputs_overlap(const Bytes* arrays, int num_outputs, int num_arrays);

}  // namespace tv
