// Fuzzes tv_extract, tv_match and tv_align_matches: small images of any content and any options.
#include <algorithm>
#include <vector>

#include "fuzz.h"
#include "support/calls.h"

namespace {

constexpr int kSide = 64, kMaxKeypoints = 150;

tv_feature_options options_of(fuzz::Bytes& bytes) {
  tv_feature_options options;
  tv_feature_options_init(&options);
  options.max_keypoints = bytes.whole(1, kMaxKeypoints);
  options.arc = bytes.whole(8, 13);
  options.threshold = bytes.whole(0, 60);
  options.min_threshold = bytes.whole(0, 20);
  options.levels = bytes.whole(1, 8);
  options.scale_factor = static_cast<float>(bytes.wild(1.1, 2));
  options.cell_px = bytes.whole(0, 3) == 0 ? bytes.whole(0, 40) : 0;
  options.subpixel = bytes.whole(0, 1);
  options.orientation = bytes.whole(0, 1);
  options.descriptor = bytes.whole(0, 1);
  options.keypoint_size = static_cast<float>(bytes.wild(1, 32));
  return options;
}

// An image of the bytes that are left, repeated, in rows with some padding.
std::vector<uint8_t> pixels_of(fuzz::Bytes& bytes, tv_image& image) {
  image.width = bytes.whole(1, kSide);
  image.height = bytes.whole(1, kSide);
  image.stride_bytes = image.width + bytes.whole(0, 5);
  const int kind = bytes.whole(0, 3);
  std::vector<uint8_t> pixels(static_cast<size_t>(image.stride_bytes * image.height));
  std::vector<uint8_t> tile(1 + bytes.left() % 97);
  for (uint8_t& value : tile) value = bytes.raw<uint8_t>();
  for (size_t i = 0; i < pixels.size(); ++i) {
    const size_t x = i % static_cast<size_t>(image.stride_bytes);
    const size_t y = i / static_cast<size_t>(image.stride_bytes);
    const size_t cell = kind == 0 ? i : kind == 1 ? x / 5 + 13 * (y / 4) : x * x / 7 + y * y / 9;
    pixels[i] = tile[cell % tile.size()];
  }
  image.data = pixels.data();
  return pixels;
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static tv_context* const context = fuzz::context(kSide, kMaxKeypoints, 0);
  fuzz::Bytes bytes(data, size);
  const tv_feature_options options = options_of(bytes);
  tv_match_options match_options;
  tv_match_options_init(&match_options);
  match_options.ratio = static_cast<float>(bytes.wild(0.01, 1));
  match_options.neighbourhood_px = static_cast<float>(bytes.whole(0, 40));
  tv_keypoint keypoints_of[2][kMaxKeypoints];
  std::vector<uint8_t> pixels[2], descriptors[2];
  tv_image images[2];
  int32_t counts[2] = {0, 0};
  for (int v = 0; v < 2; ++v) {
    tv_image& image = images[v];
    pixels[v] = pixels_of(bytes, image);
    const bool masked = bytes.whole(0, 3) == 0;
    tv_keypoint* const keypoints = keypoints_of[v];
    descriptors[v].resize(kMaxKeypoints * TV_DESCRIPTOR_BYTES);
    const tv_status status =
        tv_extract(context, &image, masked ? &image : nullptr, &options, keypoints,
                   descriptors[v].data(), options.max_keypoints, &counts[v]);
    if (status != TV_OK) return 0;
    FUZZ_REQUIRE(counts[v] >= 0 && counts[v] <= options.max_keypoints);
    for (int i = 0; i < counts[v]; ++i) {
      const tv_keypoint& k = keypoints[i];
      FUZZ_REQUIRE(k.x >= -1 && k.x <= static_cast<float>(image.width));
      FUZZ_REQUIRE(k.y >= -1 && k.y <= static_cast<float>(image.height));
      FUZZ_REQUIRE(std::isfinite(k.angle_rad) && std::isfinite(k.score) && k.size > 0);
      FUZZ_REQUIRE(k.level >= 0 && k.level < options.levels);
    }
  }
  tv_correspondence matches[kMaxKeypoints];
  int32_t count = 0;
  const tv_features features[2] = {features_of(keypoints_of[0], descriptors[0].data(), counts[0]),
                                   features_of(keypoints_of[1], descriptors[1].data(), counts[1])};
  if (tv_match(context, &features[0], &features[1], &match_options, matches,
               std::min(counts[0], counts[1]), &count) != TV_OK)
    return 0;
  for (int i = 0; i < count; ++i) {
    FUZZ_REQUIRE(matches[i].idx0 >= 0 && matches[i].idx0 < counts[0]);
    FUZZ_REQUIRE(matches[i].idx1 >= 0 && matches[i].idx1 < counts[1]);
    FUZZ_REQUIRE(i == 0 || matches[i].idx0 > matches[i - 1].idx0);
  }
  uint8_t aligned[kMaxKeypoints];
  tv_keypoint* const moved[2] = {keypoints_of[0], keypoints_of[1]};
  FUZZ_REQUIRE(tv_align_matches(context, images, matches, count, options.keypoint_size, moved,
                                counts, aligned) == TV_OK);
  return 0;
}
