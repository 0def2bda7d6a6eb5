// The arrays of tv_reconstruct, at the front of the context's arena: what was found in both images
// and between them. docs/algorithms/effort.md has the rungs.
#pragma once

#include "pipeline/context.h"
#include "pipeline/pair_result.h"
#include "twoview/reconstruct.h"

namespace tv {

// The most keypoints of an image, over the rungs of effort. In all functions of limits max_matches
// and purposes must already be resolved (not 0).
int32_t most_keypoints(const tv_limits& limits);

// How many matches there is room for after the best were chosen.
int32_t most_chosen_matches(const tv_limits& limits);

struct PairArrays {
  tv_keypoint* keypoints[2];
  uint8_t* descriptors[2];
  uint8_t* tilts[2];  // null where no rung has squeezed views
  double* pixels[2];
  tv_correspondence* matches;
  float* ratios;
  float* sigmas[2];
  uint8_t* inlier_mask;
  tv_point* points;
  tv_correspondence* more_matches;  // the first matches and those of guided matching together
  uint8_t* more_inlier_mask;
  PairResult* more_estimate;  // the estimate from both together
  // Of each keypoint of view 0, the byte that aligning its match gave (match/align.h), or 0. It
  // lies where `points` lies, and is valid until there are points.
  uint8_t* aligned;
  // The cameras and the motion of the present estimate; set for full poses only.
  tv_camera_pair* pair;
  tv_pixel_pairs pairs;  // of the present matches
};

PairArrays alloc_pair_arrays(const tv_limits& limits, Arena& arena);
size_t pair_arrays_bytes(const tv_limits& limits);  // what it takes of the arena

// The first keypoints of a view, `num` of them.
tv_features features_of(const PairArrays& arrays, int view, int32_t num);

// Writes the pixels and ratios of the matches, their sigmas unless sigma_by_size is 0, and
// arrays.pairs. size_of_one: the size of a keypoint whose sigma is 1.
void gather_pixels(const tv_correspondence* matches, int32_t num_matches, float size_of_one,
                   double sigma_by_size, PairArrays& arrays);

}  // namespace tv
