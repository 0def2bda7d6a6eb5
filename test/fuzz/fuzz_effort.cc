// Fuzzes tv_reconstruct on the rungs of effort: two small pictures, of which the second one may be
// the first one squeezed and moved, masks, any rungs and options; in a context that has not a byte
// more than the pictures need, and in both orders of the views.
#include <algorithm>
#include <vector>

#include "fuzz.h"
#include "support/calls.h"

namespace {

constexpr int kSide = 120, kMaxKeypoints = 80;

struct Picture {
  std::vector<uint8_t> pixels, mask;
  tv_image image, mask_image;
};

// Patches of the bytes that are left, or an affine map of the other picture.
Picture picture_of(fuzz::Bytes& bytes, const Picture* other) {
  Picture p;
  const int width = bytes.whole(1, kSide), height = bytes.whole(1, kSide);
  p.pixels.resize(static_cast<size_t>(width) * static_cast<size_t>(height));
  const bool mapped = other != nullptr && bytes.whole(0, 3) != 0;
  const double map[4] = {bytes.between(0.4, 3), bytes.between(-0.5, 0.5), bytes.between(-0.5, 0.5),
                         bytes.between(0.4, 3)};
  const int from_x = bytes.whole(-20, 20), from_y = bytes.whole(-20, 20);
  uint32_t state = bytes.raw<uint32_t>();
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const size_t at =
          static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x);
      if (mapped) {
        const tv_image& i = other->image;
        const int u = static_cast<int>(map[0] * x + map[1] * y) + from_x;
        const int v = static_cast<int>(map[2] * x + map[3] * y) + from_y;
        p.pixels[at] =
            i.data[std::clamp(v, 0, i.height - 1) * i.stride_bytes + std::clamp(u, 0, i.width - 1)];
      } else {
        state = state * 1664525u + 1013904223u;
        p.pixels[at] = x % 4 != 0   ? p.pixels[at - 1]
                       : y % 4 != 0 ? p.pixels[at - static_cast<size_t>(width)]
                                    : static_cast<uint8_t>(state >> 24);
      }
    }
  }
  p.image = {p.pixels.data(), width, height, width};
  if (bytes.whole(0, 3) == 0) {
    p.mask.assign(p.pixels.size(), 1);
    const size_t out = bytes.raw<uint16_t>() % p.mask.size();
    std::fill(p.mask.begin(), p.mask.begin() + static_cast<std::ptrdiff_t>(out), uint8_t{0});
    p.mask_image = {p.mask.data(), width, height, width};
  }
  return p;
}

void require_sound(const tv_reconstruction& r, const tv_reconstruct_options& options,
                   const tv_view views[2]) {
  FUZZ_REQUIRE(r.effort >= options.effort);
  FUZZ_REQUIRE(r.effort <= std::max(options.effort, options.max_effort));
  FUZZ_REQUIRE(r.num_rungs >= 1 && r.num_rungs <= 4);
  for (int v = 0; v < 2; ++v) {
    for (int32_t k = 0; k < r.num_keypoints[v]; ++k) {
      const tv_keypoint& p = r.keypoints[v][k];
      FUZZ_REQUIRE(p.x >= -3 && p.x <= static_cast<float>(views[v].image.width + 3));
      FUZZ_REQUIRE(p.y >= -3 && p.y <= static_cast<float>(views[v].image.height + 3));
      FUZZ_REQUIRE(std::isfinite(p.angle_rad) && p.size > 0);
      FUZZ_REQUIRE(r.tilts[v] == nullptr || r.tilts[v][k] <= (r.effort < 2 ? 0 : 16));
    }
  }
  for (int32_t k = 0; k < r.num_matches; ++k) {
    FUZZ_REQUIRE(r.matches[k].idx0 >= 0 && r.matches[k].idx0 < r.num_keypoints[0]);
    FUZZ_REQUIRE(r.matches[k].idx1 >= 0 && r.matches[k].idx1 < r.num_keypoints[1]);
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::Bytes bytes(data, size);
  tv_feature_options features;
  tv_feature_options_init(&features);
  features.max_keypoints = bytes.whole(1, kMaxKeypoints);
  features.threshold = bytes.whole(5, 40);
  features.levels = bytes.whole(1, 4);
  features.orientation = bytes.whole(0, 1);
  features.subpixel = bytes.whole(0, 1);
  tv_reconstruct_options options;
  tv_reconstruct_options_init(&options);
  options.feature = &features;
  options.effort = bytes.whole(0, 3);
  options.max_effort = bytes.whole(0, 3);
  options.align_matches = bytes.whole(0, 1);
  options.guided_matching = bytes.whole(0, 3) == 0;
  options.bundle_adjustment = bytes.whole(0, 3) == 0;
  const bool has_cameras = bytes.whole(0, 3) != 0;
  const Picture first = picture_of(bytes, nullptr), second = picture_of(bytes, &first);
  const Picture* const pictures[2] = {&first, &second};
  tv_camera cameras[2];
  tv_view views[2];
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = std::max(first.image.width, second.image.width);
  limits.max_height = std::max(first.image.height, second.image.height);
  limits.max_keypoints = features.max_keypoints;
  limits.max_effort = std::max(options.effort, options.max_effort);
  limits.purposes = TV_PURPOSE_RECONSTRUCT |
                    (options.guided_matching != 0 ? TV_PURPOSE_MATCH_GUIDED : 0) |
                    (options.bundle_adjustment != 0 ? TV_PURPOSE_ADJUST : 0);
  for (int v = 0; v < 2; ++v) {
    const tv_image& image = pictures[v]->image;
    cameras[v] = {TV_CAMERA_PINHOLE, image.width, image.height, 0, 100, 100, 50, 50, {}};
    views[v] = view_of(image, has_cameras ? &cameras[v] : nullptr,
                       pictures[v]->mask.empty() ? nullptr : &pictures[v]->mask_image);
  }
  tv_context* context = nullptr;
  FUZZ_REQUIRE(tv_context_new(&context, &limits) == TV_OK);
  tv_two_view result[2];
  tv_reconstruction found;
  int32_t num_matches[2];
  for (int order = 0; order < 2; ++order) {
    const tv_view in_order[2] = {views[order], views[1 - order]};
    tv_two_view_init(&result[order]);
    tv_reconstruction_init(&found);
    FUZZ_REQUIRE(tv_reconstruct(context, &in_order[0], &in_order[1], &options, &result[order],
                                nullptr, &found) == TV_OK);
    require_sound(found, options, in_order);
    num_matches[order] = found.num_matches;
  }
  tv_context_free(context);
  // With bundle_adjustment the two are equal up to rounding.
  if (options.bundle_adjustment != 0) return 0;
  FUZZ_REQUIRE(num_matches[0] == num_matches[1]);
  FUZZ_REQUIRE(result[0].verdict == result[1].verdict && result[0].kind == result[1].kind);
  FUZZ_REQUIRE(result[0].num_inliers == result[1].num_inliers);
  return 0;
}
