// The points that belong to the cells of a matched pair. docs/algorithms/dense.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "dense/pair.h"

namespace tv {

// Bytes of arena that make_points takes for a grid of so many columns and steps.
size_t make_points_bytes(int32_t columns, int32_t steps);

// Writes the points of the cells whose distance has a standard deviation of at most this share of
// it, row by row. Where there is not room for all of them, those that have a point are counted
// first, and then as many as there is room for are written, by their weights. Returns how many.
int32_t make_points(const DensePair& pair, const tv_image& image0, double max_relative_sigma,
                    Arena& arena, tv_dense_point* points, int32_t cap_points);

}  // namespace tv
