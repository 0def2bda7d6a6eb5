// The parallax of all cells of a pair's grid.
// docs/algorithms/dense.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "dense/fraction.h"
#include "dense/rectify.h"

namespace tv {

// The most cells and steps of a pair, which its memory depends on. max_steps: a multiple of
// TVK_DENSE_BLOCK.
struct DenseLimits {
  int32_t max_cells, max_steps;
};

struct DensePair {
  DenseGrid grid;
  DenseView views[2];
  RowPair rows;      // the resampled images
  DenseCells cells;  // grid.width x grid.height
};

// Bytes of arena that match_pair takes, those included that the caller takes beside it
// afterwards.
size_t match_pair_bytes(const tv_camera& camera0, const tv_camera& camera1,
                        const DenseLimits& limits, size_t beside);

// Matches two images whose motion x1 = R x0 + t is known. What it keeps is in the arena. Returns
// false, and makes no cells, where no ray of image 0 has a parallax.
bool match_pair(const tv_camera& camera0, const tv_camera& camera1, const tv_image& image0,
                const tv_image& image1, const Mat3& R, const Vec3& t, const ParallaxHint& hint,
                const DenseLimits& limits, Arena& arena, DensePair* pair);

}  // namespace tv
