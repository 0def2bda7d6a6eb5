// The entry point of alignment: it validates, and calls match/align.h for each match.
#include "match/align.h"

#include "api/validate.h"
#include "feature/tilts.h"
#include "match/rank.h"
#include "twoview/match.h"

namespace tv {
namespace {

bool is_at_same_place(const tv_keypoint& a, const tv_keypoint& b) {
  return a.x == b.x && a.y == b.y && a.size == b.size;
}

// A corner with two directions has two keypoints in turn, and two corners may have two matches,
// which are one to the estimate: the match of lower rank is aligned, and the other one moves with
// it.
void align_all(const tvk_set& set, const tv_image images[2], double size_of_one,
               tv_keypoint* const keypoints[2], const tv_correspondence* matches,
               int32_t num_matches, uint8_t* aligned) {
  for (int32_t k = 0; k < num_matches; ++k) {
    const tv_correspondence* m = &matches[k];
    const tv_correspondence* other = nullptr;
    if (k + 1 < num_matches && rank_of(m[0]) != rank_of(m[1]) &&
        is_at_same_place(keypoints[0][m[0].idx0], keypoints[0][m[1].idx0]) &&
        is_at_same_place(keypoints[1][m[0].idx1], keypoints[1][m[1].idx1])) {
      const bool first = rank_of(m[0]) < rank_of(m[1]);
      other = m + first;
      m += !first;
      ++k;
    }
    tv_keypoint& a = keypoints[0][m->idx0];
    tv_keypoint& b = keypoints[1][m->idx1];
    aligned[k] = align_keypoints(set, images[0], images[1], size_of_one, &a, &b);
    if (other == nullptr) continue;
    aligned[k - 1] = aligned[k];
    for (int v = 0; v < 2; ++v) {
      const tv_keypoint& moved = v == 0 ? a : b;
      tv_keypoint& follower = keypoints[v][v == 0 ? other->idx0 : other->idx1];
      follower.x = moved.x;
      follower.y = moved.y;
    }
  }
}

}  // namespace
}  // namespace tv

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
  tv::align_all(*context->kernels, images, static_cast<double>(size_of_one), keypoints, matches,
                num_matches, aligned);
  return TV_OK;
}
