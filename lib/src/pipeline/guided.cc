#include "pipeline/guided.h"

#include <algorithm>

#include "geometry/camera.h"
#include "match/guided.h"

namespace tv {
namespace {

// Reads the keypoints of one view. Without a camera (null) the ray of a pixel is (x, y, 1).
GuidedView make_view(const tv_camera* camera, const tv_features& features, Arena& arena) {
  const tv_keypoint* const keypoints = features.keypoints;
  const size_t n = static_cast<size_t>(features.num);
  double* rays = arena_alloc<double>(arena, 3 * n);
  double* slopes = arena_alloc<double>(arena, 6 * n);
  uint8_t* valid = arena_alloc<uint8_t>(arena, n);
  const Camera prepared = camera != nullptr ? prepare_camera(*camera) : Camera{};
  for (size_t k = 0; k < n; ++k) {
    const Vec2 pixel(keypoints[k].x, keypoints[k].y);
    Vec3 ray(pixel[0], pixel[1], 1);
    Mat32 slope;
    slope << 1, 0, 0, 1, 0, 0;
    valid[k] = camera == nullptr || unproject(prepared, pixel, &ray, &slope);
    double* const to = rays + 3 * k;
    for (int i = 0; i < 3; ++i) to[i] = ray[i];
    for (int i = 0; i < 6; ++i) slopes[6 * k + static_cast<size_t>(i)] = slope(i / 2, i % 2);
  }
  return GuidedView{keypoints, features.descriptors, rays, slopes, valid, features.num};
}

// The matrix with a largest entry of 1: its scale is arbitrary, and its squares then stay within a
// double's range.
void scale_matrix(const double matrix[9], double scaled[9]) {
  double largest = 0;
  for (int k = 0; k < 9; ++k) {
    const double size = matrix[k] < 0 ? -matrix[k] : matrix[k];
    largest = size > largest ? size : largest;
  }
  for (int k = 0; k < 9; ++k) scaled[k] = largest > 0 ? matrix[k] / largest : 0;
}

}  // namespace

int32_t match_epipolar(tv_context* context, const tv_epipolar& epipolar,
                       const tv_features& features0, const tv_features& features1,
                       const tv_guided_options& options, const tv_correspondence** found) {
  StageTimer timer(context, TV_STAGE_MATCH);
  Arena& arena = context->arena;
  double scaled[9];
  scale_matrix(epipolar.matrix, scaled);
  const size_t most = static_cast<size_t>(std::min(features0.num, features1.num));
  tv_correspondence* const matches = arena_alloc<tv_correspondence>(arena, most);
  const GuidedView view0 = make_view(epipolar.camera0, features0, arena);
  const GuidedView view1 = make_view(epipolar.camera1, features1, arena);
  *found = matches;
  return match_guided(*context->kernels, view0, view1, scaled, options, arena, matches);
}

}  // namespace tv
