#include "pipeline/dense.h"

#include "dense/pair.h"

namespace tv {
namespace {

DenseLimits limits_of(const tv_dense_options& o) { return {o.max_cells, o.max_steps}; }

// A cell counts as much as it is wide in the image, which is less near an epipole.
int64_t weight_of(const PointMaker& maker, int32_t x) {
  return 1 + static_cast<int64_t>(maker.weight(x) * 1000);
}

uint8_t grey_at(const tv_image& image, const float pixel[2]) {
  const int32_t x = static_cast<int32_t>(pixel[0] + 0.5f);
  const int32_t y = static_cast<int32_t>(pixel[1] + 0.5f);
  return image.data[static_cast<int64_t>(y) * image.stride_bytes + x];
}

// The cells that have a point, where there may not be room for all of them.
struct Share {
  int64_t total;  // the sum of their weights
  int32_t count;
};

Share count_cells(const DenseGrid& grid, const PointMaker& maker, double most_sigma,
                  int32_t cap_points) {
  Share share{0, 0};
  if (cap_points >= grid.width * grid.height) return share;
  for (int32_t y = 0; y < grid.height; ++y) {
    for (int32_t x = 0; x < grid.width; ++x) {
      if (!maker.is_precise(x, y, most_sigma)) continue;
      share.total += weight_of(maker, x);
      ++share.count;
    }
  }
  return share;
}

}  // namespace

size_t densify_bytes(const tv_camera& camera0, const tv_camera& camera1,
                     const tv_dense_options& options) {
  return match_pair_bytes(camera0, camera1, limits_of(options));
}

// Where there is not room for all cells, those that have a point are counted first, and then as
// many as there is room for are written, by their weights.
int32_t densify(const tv_camera_pair& pair, const tv_image images[2],
                const tv_dense_options& options, Arena& arena, tv_dense_point* points,
                int32_t cap_points) {
  Mat3 rotation;
  for (int i = 0; i < 9; ++i) rotation(i / 3, i % 3) = pair.cam1_from_cam0_R[i];
  const double* const t = pair.cam1_from_cam0_t;
  const ParallaxHint hint{options.min_parallax_rad, options.max_parallax_rad, options.sparse,
                          options.num_sparse};
  DensePair matched;
  if (!match_pair(pair.camera0, pair.camera1, images[0], images[1], rotation,
                  Vec3(t[0], t[1], t[2]), hint, limits_of(options), arena, &matched)) {
    return 0;
  }
  const DenseGrid& grid = matched.grid;
  PointMaker maker(matched, arena);
  if (cap_points > options.max_cells) cap_points = options.max_cells;
  const double most_sigma = options.max_relative_sigma;
  const Share share = count_cells(grid, maker, most_sigma, cap_points);
  int64_t seen = 0;
  int32_t num = 0;
  for (int32_t y = 0; y < grid.height; ++y) {
    maker.go_to_row(y);
    for (int32_t x = 0; x < grid.width; ++x) {
      if (!maker.is_precise(x, y, most_sigma)) continue;
      if (share.count > cap_points) {
        seen += weight_of(maker, x);
        if (num >= cap_points || seen * cap_points < (num + 1) * share.total) continue;
      }
      tv_dense_point& point = points[num];
      if (!maker.point(x, &point)) continue;
      point.grey = grey_at(images[0], point.pixel0);
      ++num;
    }
  }
  return num;
}

}  // namespace tv
