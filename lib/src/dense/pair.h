// The parallax of all cells of a pair's grid, and the points that belong to them.
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

// Bytes of arena that match_pair takes, a PointMaker beside it included.
size_t match_pair_bytes(const tv_camera& camera0, const tv_camera& camera1,
                        const DenseLimits& limits);

// Matches two images whose motion x1 = R x0 + t is known. What it keeps is in the arena. Returns
// false, and makes no cells, where no ray of image 0 has a parallax.
bool match_pair(const tv_camera& camera0, const tv_camera& camera1, const tv_image& image0,
                const tv_image& image1, const Mat3& R, const Vec3& t, const ParallaxHint& hint,
                const DenseLimits& limits, Arena& arena, DensePair* pair);

// Where a cell's point is. Rows are taken in any order, one at a time.
class PointMaker {
 public:
  PointMaker(const DensePair& pair, Arena& arena);
  static size_t bytes(int32_t columns, int32_t steps);

  void go_to_row(int32_t y);
  // Whether a cell of row y has a distance whose standard deviation is at most this share of it.
  // Needs no go_to_row.
  bool is_precise(int32_t x, int32_t y, double max_relative_sigma) const;
  // The distance of column x from camera 0, its standard deviation, and the unit ray. Returns false
  // for a cell without parallax.
  bool distance(int32_t x, double* distance, double* sigma, Vec3* ray) const;
  // The point of column x, but for its grey level. Returns false for a cell without parallax, or
  // one that an image does not show.
  bool point(int32_t x, tv_dense_point* point) const;
  // How wide the column is in the image beside the widest of the grid, (0, 1].
  double weight(int32_t x) const;

 private:
  // Sines of the angle in camera 1 and of the parallax, for a grid of angles; false beyond an
  // epipole.
  bool sines_of(int32_t x, double steps, double* sine1, double* sine) const;

  const DensePair& pair_;
  Track track0_, track1_;
  // Sine and cosine of the columns of both images and of the steps of parallax, for a grid of
  // angles.
  double *sines0_, *sines1_, *parallaxes_;
  Vec3 across_;
  double across_sq_;
  ptrdiff_t first_;  // cell of the row
};

}  // namespace tv
