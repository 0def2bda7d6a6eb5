#include "api/validate.h"

#include <initializer_list>

#include "api/sized.h"
#include "api/within.h"
#include "feature/tilts.h"

namespace tv {
namespace {

// True if the stride is at least the width, and so small that no row's offset overflows.
bool is_stride(int64_t stride_bytes, int32_t width) {
  return stride_bytes >= width && stride_bytes <= INT64_MAX / 65536;
}

constexpr int32_t kAutoKeypoints = 2048;
constexpr float kMaxCoordinate = 1e5f;

}  // namespace

tv_status check_image(const tv_context& context, const tv_image* image) {
  if (image == nullptr || image->data == nullptr) return TV_ERR_NULL;
  if (image->width < 1 || image->height < 1 || !is_stride(image->stride_bytes, image->width)) {
    return TV_ERR_ARGUMENT;
  }
  if (image->width > context.limits.max_width || image->height > context.limits.max_height ||
      !made_for(context, TV_PURPOSE_EXTRACT)) {
    return TV_ERR_LIMITS;
  }
  return TV_OK;
}

tv_status check_mask(const tv_image* mask, const tv_image& image) {
  if (mask == nullptr) return TV_OK;
  if (mask->data == nullptr) return TV_ERR_NULL;
  const bool same_size = mask->width == image.width && mask->height == image.height;
  return same_size && is_stride(mask->stride_bytes, mask->width) ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_camera_image(const tv_camera& camera, const tv_image& image) {
  if (image.data == nullptr) return TV_ERR_NULL;
  if (image.width != camera.width || image.height != camera.height) return TV_ERR_CAMERA;
  return is_stride(image.stride_bytes, image.width) ? TV_OK : TV_ERR_ARGUMENT;
}

size_t image_bytes(const tv_image& image) {
  return static_cast<size_t>(image.height - 1) * static_cast<size_t>(image.stride_bytes) +
         static_cast<size_t>(image.width);
}

tv_status read_feature_options(const tv_context& context, const tv_feature_options* options,
                               tv_feature_options* checked) {
  tv_feature_options_init(checked);
  const tv_status status = read_sized(options, checked);
  if (status != TV_OK) return status;
  tv_feature_options& o = *checked;
  const bool valid = o.max_keypoints >= 0 && within(o.arc, 9, 12) && within(o.threshold, 1, 254) &&
                     within(o.min_threshold, 0, o.threshold) && within(o.levels, 1, 8) &&
                     within(o.scale_factor, 1.1f, 2.0f) &&
                     (o.cell_px == 0 || within(o.cell_px, 8, 16384)) && within(o.subpixel, 0, 1) &&
                     within(o.orientation, TV_ORIENTATION_UPRIGHT, TV_ORIENTATION_GRADIENT) &&
                     within(o.descriptor, TV_NORMALISATION_SIFT, TV_NORMALISATION_ROOTSIFT) &&
                     within(o.keypoint_size, 1.0f, 32.0f) && within(o.pooling, 0, 1) &&
                     o.reserved == 0;
  if (!valid) return TV_ERR_ARGUMENT;
  const int32_t most = context.limits.max_keypoints;
  if (o.max_keypoints == 0) o.max_keypoints = most < kAutoKeypoints ? most : kAutoKeypoints;
  return o.max_keypoints <= most ? TV_OK : TV_ERR_LIMITS;
}

tv_status read_match_options(const tv_match_options* options, tv_match_options* checked) {
  tv_match_options_init(checked);
  const tv_status status = read_sized(options, checked);
  if (status != TV_OK) return status;
  const bool valid = checked->ratio > 0.0f && checked->ratio <= 1.0f &&
                     within(checked->neighbourhood_px, 0.0f, 1000.0f) &&
                     within(checked->max_distance, 0.0f, 3000.0f);
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status read_features(const tv_context& context, const tv_features* given, uint32_t purpose,
                        const void* out, size_t out_bytes, tv_features* features) {
  if (given == nullptr) return TV_ERR_NULL;
  *features = tv_features{};
  const tv_status status = read_sized(given, features);
  if (status != TV_OK) return status;
  if (features->num < 0) return TV_ERR_ARGUMENT;
  if (features->num > 0 && features->descriptors == nullptr) return TV_ERR_NULL;
  if (features->num > context.most_keypoints || !made_for(context, purpose)) {
    return TV_ERR_LIMITS;
  }
  const size_t n = static_cast<size_t>(features->num);
  const bool overlaps = overlap(out, out_bytes, features->descriptors, n * TV_DESCRIPTOR_BYTES) ||
                        overlap(out, out_bytes, features->keypoints, n * sizeof(tv_keypoint));
  return overlaps ? TV_ERR_OVERLAP : TV_OK;
}

tv_status read_pixels(const tv_pixel_pairs* given, tv_pixel_pairs* pairs) {
  if (given == nullptr) return TV_ERR_NULL;
  *pairs = tv_pixel_pairs{};
  const tv_status status = read_sized(given, pairs);
  if (status != TV_OK) return status;
  if (pairs->num < 0) return TV_ERR_ARGUMENT;
  const bool missing = pairs->pixels0 == nullptr || pairs->pixels1 == nullptr;
  return pairs->num > 0 && missing ? TV_ERR_NULL : TV_OK;
}

tv_status read_pixel_pairs(const tv_pixel_pairs* given, tv_pixel_pairs* pairs) {
  const tv_status status = read_pixels(given, pairs);
  if (status != TV_OK) return status;
  for (const float* sigmas : {pairs->sigmas0, pairs->sigmas1}) {
    for (int32_t i = 0; sigmas != nullptr && i < pairs->num; ++i) {
      if (!is_finite(sigmas[i])) return TV_ERR_NOT_FINITE;
      if (!within(sigmas[i], kLeastSigma, kLargestSigma)) return TV_ERR_ARGUMENT;
    }
  }
  return TV_OK;
}

tv_status check_keypoints(const tv_keypoint* keypoints, int32_t count) {
  for (int32_t k = 0; k < count; ++k) {
    const tv_keypoint& p = keypoints[k];
    if (!is_finite(p.x) || !is_finite(p.y) || !is_finite(p.size) || !is_finite(p.angle_rad)) {
      return TV_ERR_NOT_FINITE;
    }
    if (!within(p.x, -kMaxCoordinate, kMaxCoordinate) ||
        !within(p.y, -kMaxCoordinate, kMaxCoordinate) || p.size <= 0.0f ||
        p.size > kMostKeypointSize || !within(p.angle_rad, -1000.0f, 1000.0f)) {
      return TV_ERR_ARGUMENT;
    }
  }
  return TV_OK;
}

bool outputs_overlap(const Bytes* arrays, int num_outputs, int num_arrays) {
  for (int i = 0; i < num_outputs; ++i) {
    for (int j = i + 1; j < num_arrays; ++j) {
      if (arrays[i].data != nullptr && arrays[j].data != nullptr &&
          overlap(arrays[i].data, arrays[i].size, arrays[j].data, arrays[j].size)) {
        return true;
      }
    }
  }
  return false;
}

tv_status check_gravity(const double gravity0[3], const double gravity1[3], double sigma_rad) {
  if (sigma_rad == 0) return TV_OK;
  bool zero = false;
  for (const double* g : {gravity0, gravity1}) {
    if (!is_finite(g[0]) || !is_finite(g[1]) || !is_finite(g[2])) return TV_ERR_NOT_FINITE;
    zero = zero || (g[0] == 0 && g[1] == 0 && g[2] == 0);
  }
  return sigma_rad > 0 && sigma_rad <= kPi && !zero ? TV_OK : TV_ERR_ARGUMENT;
}

}  // namespace tv
