#include "pipeline/scratch.h"

#include <algorithm>

#include "feature/corners.h"
#include "feature/tilts.h"
#include "match/guided.h"
#include "match/match.h"
#include "match/witness.h"
#include "pipeline/pair_arrays.h"
#include "pose/absolute_pose.h"
#include "robust/bundle.h"
#include "robust/two_view.h"

namespace tv {
namespace {

// Two arrays of keypoints: what was found, and its order while corners are found, or the oriented
// keypoints afterwards.
size_t extract_scratch_bytes(const tv_limits& limits) {
  const size_t keypoints = arena_bytes<tv_keypoint>(static_cast<size_t>(limits.max_keypoints));
  return 2 * keypoints + std::max(corners_bytes(limits.max_width, limits.max_height),
                                  octaves_bytes(limits.max_width, limits.max_height));
}

// The bytes that extract_rung (pipeline/extract.h) takes.
size_t extract_rung_bytes(const tv_limits& limits, int32_t rung) {
  tv_limits of_view = limits;
  of_view.max_keypoints = view_budget(rung, 0, limits.max_keypoints);
  size_t most = extract_scratch_bytes(of_view);
  for (int32_t tilt = 1; tilt < tilts_of_rung(rung); ++tilt) {
    // A view that is left out here, because it is too large, may be used for a smaller image; it is
    // then not larger than this one.
    Squeeze squeeze = squeeze_of(tilt, limits.max_width, limits.max_height);
    squeeze.width = std::min(squeeze.width, kMaxViewSide);
    of_view.max_width = squeeze.width;
    of_view.max_height = squeeze.height;
    of_view.max_keypoints = view_budget(rung, tilt, limits.max_keypoints);
    most =
        std::max(most, squeeze_bytes(squeeze, limits.max_width) + extract_scratch_bytes(of_view));
  }
  return most;
}

// The rungs of effort above 0: their views, and their matches of one place.
size_t effort_scratch_bytes(const tv_limits& limits) {
  if (limits.max_effort == 0) return 0;
  const size_t n = static_cast<size_t>(most_keypoints(limits));
  size_t most = arena_bytes<float>(n) + witness_bytes(most_keypoints(limits));
  for (int32_t rung = 1; rung <= limits.max_effort; ++rung) {
    most = std::max(most, extract_rung_bytes(limits, rung));
  }
  return most;
}

// Both views' rays, the matching, and what is found.
size_t guided_scratch_bytes(const tv_limits& limits) {
  const int32_t most = most_keypoints(limits);
  return 2 * guided_view_bytes(most) + guided_bytes(most) +
         arena_bytes<tv_correspondence>(static_cast<size_t>(most));
}

}  // namespace

size_t scratch_bytes(const tv_limits& limits) {
  const size_t of_purpose[] = {extract_scratch_bytes(limits), match_bytes(most_keypoints(limits)),
                               two_view_scratch_bytes(limits.max_matches),
                               // tv_reconstruct: the bytes of its results are added below
                               effort_scratch_bytes(limits), guided_scratch_bytes(limits),
                               bundle_scratch_bytes(limits.max_matches),
                               absolute_pose_bytes(limits.max_matches)};
  size_t stage = 0;
  for (unsigned bit = 0; bit < 7; ++bit) {
    if ((limits.purposes >> bit & 1) != 0) stage = std::max(stage, of_purpose[bit]);
  }
  return stage + ((limits.purposes >> 3 & 1) != 0 ? pair_arrays_bytes(limits) : 0);
}

}  // namespace tv
