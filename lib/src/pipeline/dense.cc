#include "pipeline/dense.h"

#include <algorithm>

#include "dense/points.h"

namespace tv {
namespace {

DenseLimits limits_of(const tv_dense_options& o) { return {o.max_cells, o.max_steps}; }

}  // namespace

size_t densify_bytes(const tv_camera& camera0, const tv_camera& camera1,
                     const tv_dense_options& options) {
  return match_pair_bytes(camera0, camera1, limits_of(options),
                          make_points_bytes(longest_side(options.max_cells), options.max_steps));
}

int32_t densify(const tv_camera_pair& pair, const tv_image images[2],
                const tv_dense_options& options, Arena& arena, tv_dense_point* points,
                int32_t cap_points) {
  const ParallaxHint hint{options.min_parallax_rad, options.max_parallax_rad, options.sparse,
                          options.num_sparse};
  DensePair matched;
  if (!match_pair(pair.camera0, pair.camera1, images[0], images[1],
                  matrix_of(pair.cam1_from_cam0_R), Vec3(pair.cam1_from_cam0_t), hint,
                  limits_of(options), arena, &matched)) {
    return 0;
  }
  return make_points(matched, images[0], options.max_relative_sigma, arena, points,
                     std::min(cap_points, options.max_cells));
}

}  // namespace tv
