// Semi-global matching over planes of equal inverse depth, with the costs of several views. Costs
// and sums are integers. docs/algorithms/depth_map.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "dense/parallel_view.h"
#include "kernels/dense.h"

namespace tv {

// The planes of inverse depth first + k * step, k in [0, count); count is a multiple of
// TVK_DENSE_BLOCK.
struct Planes {
  double first, step;
  int32_t count;
};

// A view beside the reference: what it shows, and its centre as x_view = x_reference + shift for
// axes that are parallel.
struct SweptView {
  ParallelView view;
  Vec3 shift;
};

struct PlaneSweep {
  MapGrid grid;
  Planes planes;
  const ParallelView* reference;  // without a margin
  const SweptView* views;
  int32_t num_views;
};

// What was found at a pixel.
struct SweptPixel {
  double inverse_depth;  // 0: nothing
  double sigma;          // of it
  int32_t witnesses;     // how many views show there what the reference shows
};

// Receives the pixels of a row of the map.
struct SweptRows {
  void* user;
  void (*take)(void* user, int32_t y, const SweptPixel* row);
};

// Bytes of arena that sweep_planes takes.
size_t sweep_planes_bytes(const MapGrid& grid, int32_t max_planes, int32_t num_views);

// Matches, and hands the rows over from the last one to the first one.
void sweep_planes(const PlaneSweep& sweep, const tvk_dense_table& kernels, const SweptRows& rows,
                  Arena& arena);

}  // namespace tv
