// The grid of epipolar planes in which the two images' rows correspond, for any lens and any
// motion. docs/algorithms/dense.md.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "geometry/camera.h"
#include "kernels/dense.h"
#include "twoview/dense.h"
#include "twoview/image.h"

namespace tv {

// One of the two cameras.
struct DenseView {
  Camera camera;
  Mat3 rotation;   // from the frame of camera 0
  tv_image image;  // halved `halvings` times
  int32_t halvings;
};

// A row of the grid is a plane that contains both camera centres, a column a direction in that
// plane. A flat grid is that of two rectified images: the ray of row v and column c is -c baseline
// + side + v up, and a point has a parallax in c of length / (its distance along `side`). Any other
// grid is one of angles: v is the plane's angle around the baseline, c the angle between the ray
// and the baseline, and the parallax is their difference.
struct DenseGrid {
  Vec3 baseline, side, up;  // unit vectors in the frame of camera 0, orthogonal to each other
  double length;            // of the baseline
  bool is_flat;
  double first_row, row_step, first_column, step;  // v = first_row + row * row_step; c likewise
  int32_t width, height;
  // Of parallax: num_steps is a multiple of TVK_DENSE_BLOCK, of which the range has the first
  // range_steps.
  int32_t first_step, num_steps, range_steps;

  int32_t columns1() const { return width + num_steps - 1; }
  double row(int32_t y) const { return first_row + y * row_step; }
  double column(double x) const { return first_column + x * step; }
};

// What is known of the range of parallax. With a `most` of 0 it is that of the points of status
// TV_POINT_OK, without the outermost 1 % and with a margin; without such points it begins at 0.
struct ParallaxHint {
  double least, most;  // radians
  const tv_point* points;
  int32_t num_points;
};

// The most columns, and the most rows, of a grid of at most max_cells cells.
int32_t longest_side(int32_t max_cells);

// The bytes of arena that make_grid takes for itself, those that halved images need, and those of
// the Track of a row with so many columns.
size_t make_grid_bytes();
size_t halved_bytes(int32_t width, int32_t height);
size_t track_bytes(int32_t columns);

// The angle of a pixel in the middle of the coarser of the two images.
double pixel_angle_of(const Camera& camera0, const Camera& camera1);

// Makes the grid that covers image 0. Returns false where no ray of it is valid.
bool make_grid(const Camera& camera0, const Mat3& R, const Vec3& t, const ParallaxHint& hint,
               double pixel_angle, int32_t max_cells, int32_t max_steps, Arena& arena,
               DenseGrid* grid);

// Halves the view's image as often as the grid's cells are wide. The halved image is in the arena.
void halve(const DenseGrid& grid, double pixel_angle, Arena& arena, DenseView* view);

// Where an image shows a cell, if it does.
struct Place {
  double u, v;
  bool is_seen;
};

// Where a row of the grid lies in an image: pixels as polynomials over spans of columns.
class Track {
 public:
  // A view's columns from `first` on, of which there are `columns`.
  Track(const DenseGrid& grid, const DenseView& view, double first, int32_t columns, Arena& arena);
  void go_to_row(int32_t y);
  // Resamples the image along the row: 0 where the image has no pixel; other values are at least 1.
  void sample(const tvk_dense_table& kernels, uint8_t* pixels) const;
  // The pixel of the unhalved image at a column of [0, columns), which need not be whole. In the
  // header, since it is done for every point.
  Place place_at(double column) const {
    const int32_t n = static_cast<int32_t>(static_cast<uint32_t>(column) / TVK_DENSE_NODES);
    const tvk_dense_span& span = spans_[n];
    if (!span.is_smooth) return exact_place_at(column);
    const double s = column - n * TVK_DENSE_NODES;
    const auto cubic = [&](int i) {
      return ((span.at[3][i] * s + span.at[2][i]) * s + span.at[1][i]) * s + span.at[0][i];
    };
    const Place place{cubic(0), cubic(1), true};
    const bool is_inside =
        (place.u >= 0) & (place.v >= 0) & (place.u <= last_u_) & (place.v <= last_v_);
    return is_inside ? place : moved_inside(place.u, place.v);
  }

 private:
  bool exact_at(double column, Vec2* pixel) const;
  Place exact_place_at(double column) const;
  // What lies a fraction of a step beyond the image's edge is moved to it.
  Place moved_inside(double u, double v) const;

  const DenseGrid& grid_;
  const DenseView& view_;
  Vec3 along_, side_, up_;  // the grid's axes in the view's frame
  Vec3 across_;             // of the row: angles only
  double first_, last_u_, last_v_;
  int32_t columns_, num_spans_;
  double* nodes_;  // sine and cosine of the nodes' angles, for a grid of angles
  tvk_dense_span* spans_;
  int32_t *u_, *v_;  // scratch of `sample`
};

}  // namespace tv
