// Mutual nearest neighbours that pass the ratio test in both directions.
#pragma once

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/match.h"

namespace tv {

// One side's descriptors as the kernels want them.
struct DescriptorRows {
  int16_t* rows;   // TV_DESCRIPTOR_BYTES each
  int32_t* norms;  // squared
};

size_t descriptor_rows_bytes(int32_t count);
DescriptorRows prepare_descriptors(const tvk_table& kernels, const uint8_t* descriptors,
                                   int32_t count, Arena& arena);

// Scratch of match_descriptors and of an array for its result.
size_t match_bytes(int32_t max_keypoints);

// Writes at most min(num0, num1) correspondences in ascending order of idx0; returns how many.
int32_t match_descriptors(const tvk_table& kernels, const uint8_t* descriptors0, int32_t num0,
                          const uint8_t* descriptors1, int32_t num1, float ratio, Arena& arena,
                          tv_correspondence* correspondences);

}  // namespace tv
