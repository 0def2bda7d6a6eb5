// The entry points of features: they validate, call pipeline/extract.h, and write the results that
// fit.
#include "twoview/feature.h"

#include <algorithm>

#include "api/sized.h"
#include "api/validate.h"
#include "feature/sigmas.h"
#include "feature/tilts.h"
#include "pipeline/extract.h"

namespace tv {
namespace {

constexpr tv_feature_options kDefaults = {
    sizeof(tv_feature_options), 0,    12, 15, 3, 4, 1.41f, 48, 1, TV_ORIENTATION_GRADIENT,
    TV_NORMALISATION_ROOTSIFT,  4.0f, 0,  0};

struct Request {
  tv_feature_options options;
  tv_status status;
};

// Makes the checks that all entry points of this file begin with.
Request check_request(const tv_context* context, const tv_image* image, const tv_image* mask,
                      const tv_feature_options* options) {
  Request request{};
  if (context == nullptr) {
    request.status = TV_ERR_NULL;
    return request;
  }
  request.status = check_image(*context, image);
  if (request.status == TV_OK) request.status = check_mask(mask, *image);
  if (request.status == TV_OK) {
    request.status = read_feature_options(*context, options, &request.options);
  }
  return request;
}

size_t bytes_of(int32_t count, size_t element) { return static_cast<size_t>(count) * element; }

Bytes bytes_of(const tv_keypoint* keypoints, int32_t count) {
  return {keypoints, bytes_of(count, sizeof(tv_keypoint))};
}

// Whether an output shares a byte with the other array, the image, or the mask, which may be null.
bool overlaps_any(Bytes out, Bytes other, const tv_image* image, const tv_image* mask) {
  return overlap(out.data, out.size, other.data, other.size) ||
         overlap(out.data, out.size, image->data, image_bytes(*image)) ||
         (mask != nullptr && overlap(out.data, out.size, mask->data, image_bytes(*mask)));
}

}  // namespace
}  // namespace tv

void tv_features_init_sized(tv_features* features, size_t struct_size) {
  tv::init_zeros(features, struct_size);
}

void tv_feature_options_init_sized(tv_feature_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

tv_status tv_detect(tv_context* context, const tv_image* image, const tv_image* mask,
                    const tv_feature_options* options, tv_keypoint* keypoints,
                    int32_t cap_keypoints, int32_t* num_keypoints) {
  const tv::Request request = tv::check_request(context, image, mask, options);
  if (request.status != TV_OK) return request.status;
  if (num_keypoints == nullptr || (keypoints == nullptr && cap_keypoints > 0)) return TV_ERR_NULL;
  if (cap_keypoints < 0) return TV_ERR_ARGUMENT;
  if (tv::overlaps_any(tv::bytes_of(keypoints, cap_keypoints), {}, image, mask)) {
    return TV_ERR_OVERLAP;
  }
  tv::ArenaScope scope(context->arena);
  int32_t count = 0;
  const tv_keypoint* corners = tv::detect_image(context, *image, mask, request.options, &count);
  *num_keypoints = count;
  if (count > cap_keypoints) return TV_ERR_CAPACITY;
  std::copy(corners, corners + count, keypoints);
  return TV_OK;
}

tv_status tv_orient(tv_context* context, const tv_image* image, const tv_keypoint* keypoints,
                    int32_t num_keypoints, const tv_feature_options* options, tv_keypoint* oriented,
                    int32_t cap_oriented, int32_t* num_oriented) {
  const tv::Request request = tv::check_request(context, image, nullptr, options);
  if (request.status != TV_OK) return request.status;
  if (num_oriented == nullptr || (keypoints == nullptr && num_keypoints > 0) ||
      (oriented == nullptr && cap_oriented > 0)) {
    return TV_ERR_NULL;
  }
  if (num_keypoints < 0 || cap_oriented < 0) return TV_ERR_ARGUMENT;
  if (tv::overlaps_any(tv::bytes_of(oriented, cap_oriented), tv::bytes_of(keypoints, num_keypoints),
                       image, nullptr)) {
    return TV_ERR_OVERLAP;
  }
  const tv_status status = tv::check_keypoints(keypoints, num_keypoints);
  if (status != TV_OK) return status;
  *num_oriented = tv::orient_image(context, *image, keypoints, num_keypoints, request.options,
                                   oriented, cap_oriented);
  return *num_oriented > cap_oriented ? TV_ERR_CAPACITY : TV_OK;
}

tv_status tv_describe(tv_context* context, const tv_image* image, const tv_keypoint* keypoints,
                      int32_t num_keypoints, const tv_feature_options* options,
                      uint8_t* descriptors) {
  const tv::Request request = tv::check_request(context, image, nullptr, options);
  if (request.status != TV_OK) return request.status;
  if (num_keypoints < 0) return TV_ERR_ARGUMENT;
  if (num_keypoints == 0) return TV_OK;
  if (keypoints == nullptr || descriptors == nullptr) return TV_ERR_NULL;
  const tv::Bytes out = {descriptors, tv::bytes_of(num_keypoints, TV_DESCRIPTOR_BYTES)};
  if (tv::overlaps_any(out, tv::bytes_of(keypoints, num_keypoints), image, nullptr)) {
    return TV_ERR_OVERLAP;
  }
  const tv_status status = tv::check_keypoints(keypoints, num_keypoints);
  if (status != TV_OK) return status;
  tv::describe_image(context, *image, keypoints, num_keypoints, request.options, descriptors);
  return TV_OK;
}

tv_status tv_extract(tv_context* context, const tv_image* image, const tv_image* mask,
                     const tv_feature_options* options, tv_keypoint* keypoints,
                     uint8_t* descriptors, int32_t cap_keypoints, int32_t* num_keypoints) {
  const tv::Request request = tv::check_request(context, image, mask, options);
  if (request.status != TV_OK) return request.status;
  if (num_keypoints == nullptr ||
      (cap_keypoints > 0 && (keypoints == nullptr || descriptors == nullptr))) {
    return TV_ERR_NULL;
  }
  if (cap_keypoints < 0) return TV_ERR_ARGUMENT;
  const tv::Bytes out = {descriptors, tv::bytes_of(cap_keypoints, TV_DESCRIPTOR_BYTES)};
  const tv::Bytes keypoints_out = tv::bytes_of(keypoints, cap_keypoints);
  if (tv::overlaps_any(keypoints_out, out, image, mask) || tv::overlaps_any(out, {}, image, mask)) {
    return TV_ERR_OVERLAP;
  }
  *num_keypoints = tv::extract_image(context, *image, mask, request.options, 0.0f, keypoints,
                                     descriptors, cap_keypoints);
  return *num_keypoints > cap_keypoints ? TV_ERR_CAPACITY : TV_OK;
}

tv_status tv_keypoint_shapes(const tv_keypoint* keypoints, const uint8_t* tilts,
                             int32_t num_keypoints, double* shapes) {
  if (num_keypoints > 0 && (keypoints == nullptr || shapes == nullptr)) return TV_ERR_NULL;
  if (num_keypoints < 0) return TV_ERR_ARGUMENT;
  const tv_status status = tv::check_keypoints(keypoints, num_keypoints);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_keypoints);
  const tv::Bytes arrays[] = {{shapes, 4 * n * sizeof(double)},
                              {keypoints, n * sizeof(tv_keypoint)},
                              {tilts, tilts == nullptr ? 0 : n}};
  if (tv::outputs_overlap(arrays, 1, 3)) return TV_ERR_OVERLAP;
  for (size_t k = 0; tilts != nullptr && k < n; ++k) {
    if (tilts[k] >= tv::kNumTilts) return TV_ERR_ARGUMENT;
  }
  for (size_t k = 0; k < n; ++k) {
    tv::patch_shape(keypoints[k], tilts == nullptr ? 0 : tilts[k], shapes + 4 * k);
  }
  return TV_OK;
}

tv_status tv_keypoint_sigmas(const tv_keypoint* keypoints, int32_t num_keypoints, float size_of_one,
                             double exponent, float* sigmas) {
  if (num_keypoints > 0 && (keypoints == nullptr || sigmas == nullptr)) return TV_ERR_NULL;
  if (!tv::is_finite(size_of_one) || !tv::is_finite(exponent)) return TV_ERR_NOT_FINITE;
  if (num_keypoints < 0 || !(size_of_one > 0) || size_of_one > tv::kMostKeypointSize ||
      !(exponent >= 0) || exponent > tv::kMostSigmaExponent) {
    return TV_ERR_ARGUMENT;
  }
  const tv_status status = tv::check_keypoints(keypoints, num_keypoints);
  if (status != TV_OK) return status;
  const size_t n = static_cast<size_t>(num_keypoints);
  if (tv::overlap(sigmas, n * sizeof(float), keypoints, n * sizeof(tv_keypoint))) {
    return TV_ERR_OVERLAP;
  }
  tv::KeypointSigmas of_size(size_of_one, exponent);
  for (size_t k = 0; k < n; ++k) sigmas[k] = of_size.of(keypoints[k]);
  return TV_OK;
}
