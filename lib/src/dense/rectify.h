// The grid of epipolar planes and angles in which the two images' rows correspond, for any lens and
// any motion. docs/algorithms/dense.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "geometry/camera.h"
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

// A plane of the grid contains both camera centres. A row is such a plane, at the angle
// first_plane + row * plane_step around the baseline; a column is the angle first_angle + column *
// step between the ray and the direction from camera 0 to camera 1. The parallax of a point is the
// difference of its angle in camera 1 and in camera 0, never below 0 in front of both.
struct DenseGrid {
  Vec3 baseline, side, up;  // unit vectors in the frame of camera 0, orthogonal to each other
  double length;            // of the baseline
  double first_plane, plane_step, first_angle, step;
  int32_t width, height;
  int32_t first_step, num_steps;  // of parallax; num_steps is a multiple of 8
};

// Range of parallax in radians.
struct ParallaxRange {
  double least, most;
};

// The most columns, and the most rows, of a grid of at most max_cells cells.
int32_t longest_side(int32_t max_cells);

// Bytes of arena that make_grid takes for itself, and those that halved images need.
size_t make_grid_bytes();
size_t halved_bytes(int32_t width, int32_t height);

// The range of parallax that points of status TV_POINT_OK have, without the outermost 1 % and with
// a margin. pixel_angle: the angle of a pixel. Returns false without such points.
bool range_of_points(const tv_point* points, int32_t num_points, double pixel_angle, Arena& arena,
                     ParallaxRange* range);

// The angle of a pixel in the middle of the coarser of the two images.
double pixel_angle_of(const Camera& camera0, const Camera& camera1);

// Makes the grid that covers image 0. max_steps: a multiple of 8. Returns false where no ray of it
// is valid.
bool make_grid(const Camera& camera0, const Mat3& R, const Vec3& t, const ParallaxRange& range,
               double pixel_angle, int32_t max_cells, int32_t max_steps, Arena& arena,
               DenseGrid* grid);

// Halves the view's image as often as the grid's cells are wide. The halved image is in the arena.
void halve(const DenseGrid& grid, double pixel_angle, Arena& arena, DenseView* view);

// Writes sine and cosine of the angles of `count` columns from the column `first` on, which may be
// beyond the grid's width. The sine is -1 beyond the epipole.
void tabulate(const DenseGrid& grid, int32_t first, int32_t count, double* sines);

// Resamples an image at the columns that tabulate wrote. 0 where the image has no pixel; other
// values are at least 1.
void resample(const DenseGrid& grid, const DenseView& view, const double* sines, int32_t columns,
              uint8_t* pixels);

// The ray at a row and an angle, in the frame of camera 0; the pixel of the unhalved image at which
// a view sees it. pixel_at returns false where it sees it not.
Vec3 ray_at(const DenseGrid& grid, int32_t row, double angle);
bool pixel_at(const DenseView& view, const Vec3& ray, Vec2* pixel);

}  // namespace tv
