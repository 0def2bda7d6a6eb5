// The dense cloud of a pair: both images matched cell by cell (dense/pair.h), and as many points as
// there is room for.
#pragma once

#include "base/arena.h"
#include "twoview/dense.h"

namespace tv {

// Bytes of arena that densify takes. options.max_steps: a multiple of TVK_DENSE_BLOCK.
size_t densify_bytes(const tv_camera& camera0, const tv_camera& camera1,
                     const tv_dense_options& options);

// Writes at most cap_points points and returns how many. All arguments are checked.
int32_t densify(const tv_camera_pair& pair, const tv_image images[2],
                const tv_dense_options& options, Arena& arena, tv_dense_point* points,
                int32_t cap_points);

}  // namespace tv
