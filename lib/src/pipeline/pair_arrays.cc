#include "pipeline/pair_arrays.h"

#include <algorithm>

#include "feature/sigmas.h"
#include "feature/tilts.h"
#include "match/align.h"

namespace tv {

int32_t most_keypoints(const tv_limits& limits) {
  int32_t most = limits.max_keypoints;
  for (int32_t rung = 1; rung <= limits.max_effort; ++rung) {
    most = std::max(most, rung_budget(rung, limits.max_keypoints));
  }
  return most;
}

int32_t most_chosen_matches(const tv_limits& limits) {
  return std::min(most_keypoints(limits), std::max(limits.max_matches, limits.max_keypoints));
}

PairArrays alloc_pair_arrays(const tv_limits& limits, Arena& arena) {
  const size_t n = static_cast<size_t>(most_keypoints(limits));
  const size_t m = static_cast<size_t>(most_chosen_matches(limits));
  PairArrays r;
  for (int v = 0; v < 2; ++v) {
    r.keypoints[v] = arena_alloc<tv_keypoint>(arena, n);
    r.descriptors[v] = arena_alloc<uint8_t>(arena, n * TV_DESCRIPTOR_BYTES);
    r.tilts[v] = limits.max_effort < 2 ? nullptr : arena_alloc<uint8_t>(arena, n);
    r.pixels[v] = arena_alloc<double>(arena, 2 * m);
    r.sigmas[v] = arena_alloc<float>(arena, m);
  }
  r.matches = arena_alloc<tv_correspondence>(arena, n);
  r.ratios = arena_alloc<float>(arena, m);
  r.inlier_mask = arena_alloc<uint8_t>(arena, m);
  r.points = arena_alloc<tv_point>(arena, m);
  r.more_matches = arena_alloc<tv_correspondence>(arena, n);
  r.more_inlier_mask = arena_alloc<uint8_t>(arena, m);
  r.pair = arena_alloc<tv_camera_pair>(arena, 1);
  r.more_estimate = arena_alloc<PairResult>(arena, 1);
  // A rung has at most 6.5 times max_keypoints, and there are at least max_keypoints points.
  static_assert(sizeof(tv_point) >= 7 * sizeof *r.aligned, "the points' memory is large enough");
  r.aligned = reinterpret_cast<uint8_t*>(r.points);
  return r;
}

// Not by a measuring arena: every program carries this function, and 0.3 KB more with that one.
size_t pair_arrays_bytes(const tv_limits& limits) {
  const size_t n = static_cast<size_t>(most_keypoints(limits));
  const size_t m = static_cast<size_t>(most_chosen_matches(limits));
  const size_t tilts = limits.max_effort < 2 ? 0 : arena_bytes<uint8_t>(n);
  return 2 * (arena_bytes<tv_keypoint>(n) + arena_bytes<uint8_t>(n * TV_DESCRIPTOR_BYTES) + tilts +
              arena_bytes<double>(2 * m) + arena_bytes<float>(m)) +
         2 * (arena_bytes<tv_correspondence>(n) + arena_bytes<uint8_t>(m)) +
         arena_bytes<tv_point>(m) + arena_bytes<float>(m) + arena_bytes<tv_camera_pair>(1) +
         arena_bytes<PairResult>(1);
}

tv_features features_of(const PairArrays& arrays, int view, int32_t num) {
  return {sizeof(tv_features), num, arrays.keypoints[view], arrays.descriptors[view]};
}

void gather_pixels(const tv_correspondence* matches, int32_t num_matches, float size_of_one,
                   double sigma_by_size, PairArrays& r) {
  r.pairs = {sizeof r.pairs, num_matches, r.pixels[0], r.pixels[1], r.ratios, nullptr, nullptr};
  if (sigma_by_size != 0) {
    r.pairs.sigmas0 = r.sigmas[0];
    r.pairs.sigmas1 = r.sigmas[1];
  }
  KeypointSigmas sigmas(size_of_one, sigma_by_size);
  for (int32_t k = 0; k < num_matches; ++k) {
    const tv_correspondence& m = matches[k];
    const tv_keypoint& a = r.keypoints[0][m.idx0];
    const tv_keypoint& b = r.keypoints[1][m.idx1];
    r.pixels[0][2 * k] = a.x;
    r.pixels[0][2 * k + 1] = a.y;
    r.pixels[1][2 * k] = b.x;
    r.pixels[1][2 * k + 1] = b.y;
    r.ratios[k] = m.ratio;
    if (r.pairs.sigmas0 == nullptr) continue;
    r.sigmas[0][k] = sigmas.of(a);
    r.sigmas[1][k] = sigmas.of(b);
    const int factor = r.aligned[m.idx0];
    if (factor == 0) continue;
    for (float* of_view : r.sigmas) of_view[k] *= static_cast<float>(factor) / kAlignedOne;
  }
}

}  // namespace tv
