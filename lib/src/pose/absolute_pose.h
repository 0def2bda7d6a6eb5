// The absolute pose behind the API boundary: after the search (pose/absolute_search.h) the finish,
// with refinement, covariance and verdict. docs/algorithms/absolute_pose.md. Tests:
// test/unit/test_absolute_pose.cc, test/property/test_absolute_pose_statistics.cc.
#pragma once

#include "pose/absolute_search.h"

namespace tv {

// How many bytes of arena one estimate takes.
inline size_t absolute_pose_bytes(int max_matches) {
  const size_t n = static_cast<size_t>(max_matches);
  return sightings_bytes(n) + arena_bytes<int32_t>(n) + arena_bytes<double>(n);
}

// Writes all of *result but struct_size, num_matches and seed, and to inlier_mask, unless it is
// null, a byte for each match of the caller, which must be 0.
void finish_absolute_pose(const SightingInput& input, const Sightings& sightings,
                          const tv_absolute_pose_options& options, const AbsolutePoseSearch& search,
                          Arena& arena, tv_absolute_pose* result, uint8_t* inlier_mask);

}  // namespace tv
