// The entry point of alignment: it validates, and calls match/align.h.
#include "match/align.h"

#include "api/validate.h"
#include "feature/tilts.h"
#include "twoview/match.h"

tv_status tv_align_matches(tv_context* context, const tv_image images[2],
                           const tv_correspondence* matches, int32_t num_matches, float size_of_one,
                           tv_keypoint* const keypoints[2], const int32_t num_keypoints[2],
                           uint8_t* aligned) {
  if (context == nullptr || images == nullptr || keypoints == nullptr || num_keypoints == nullptr) {
    return TV_ERR_NULL;
  }
  if (num_matches > 0 && (matches == nullptr || aligned == nullptr)) return TV_ERR_NULL;
  if (!tv::is_finite(size_of_one)) return TV_ERR_NOT_FINITE;
  if (num_matches < 0 || !(size_of_one > 0) || size_of_one > tv::kMostKeypointSize) {
    return TV_ERR_ARGUMENT;
  }
  tv::Bytes arrays[6];
  for (int v = 0; v < 2; ++v) {
    tv_status status = tv::check_image(*context, &images[v]);
    if (status != TV_OK) return status;
    if (keypoints[v] == nullptr && num_keypoints[v] > 0) return TV_ERR_NULL;
    if (num_keypoints[v] < 0) return TV_ERR_ARGUMENT;
    status = tv::check_keypoints(keypoints[v], num_keypoints[v]);
    if (status != TV_OK) return status;
    arrays[v] = {keypoints[v], static_cast<size_t>(num_keypoints[v]) * sizeof(tv_keypoint)};
    arrays[3 + v] = {images[v].data, tv::image_bytes(images[v])};
  }
  arrays[2] = {aligned, static_cast<size_t>(num_matches)};
  arrays[5] = {matches, static_cast<size_t>(num_matches) * sizeof(tv_correspondence)};
  if (tv::outputs_overlap(arrays, 3, 6)) return TV_ERR_OVERLAP;
  for (int32_t k = 0; k < num_matches; ++k) {
    if (static_cast<uint32_t>(matches[k].idx0) >= static_cast<uint32_t>(num_keypoints[0]) ||
        static_cast<uint32_t>(matches[k].idx1) >= static_cast<uint32_t>(num_keypoints[1])) {
      return TV_ERR_ARGUMENT;
    }
  }
  tv::StageTimer timer(context, TV_STAGE_MATCH);
  tv::align_matches(*context->kernels, images, static_cast<double>(size_of_one), keypoints, matches,
                    num_matches, aligned);
  return TV_OK;
}
