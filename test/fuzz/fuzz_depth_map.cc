// Fuzzes tv_sweep_depth with any poses, lenses, ranges and options, and with pictures of one
// pattern shifted, or noise. Two calls whose memory held other bytes before must give equal maps.
#include <vector>

#include "fuzz.h"
#include "support/random.h"
#include "twoview/depth_map.h"

namespace {

constexpr int kMostSide = 48, kMostViews = 4;

tv_camera camera_of(fuzz::Bytes& bytes) {
  tv_camera camera = {TV_CAMERA_PINHOLE, kMostSide, kMostSide - 8, 0, 60, 60, 23.5, 19.5, {}};
  const int kind = bytes.whole(0, 7);
  if (kind == 0) camera = fuzz::camera(bytes);
  if (kind == 1) camera.model = TV_CAMERA_KANNALA_BRANDT;
  if (kind == 2) camera.model = TV_CAMERA_BROWN_CONRADY, camera.k[0] = bytes.wild(-0.4, 0.4);
  camera.width = bytes.whole(0, 7) == 0 ? bytes.whole(1, kMostSide) : kMostSide;
  camera.height = bytes.whole(0, 7) == 0 ? bytes.whole(1, kMostSide) : kMostSide - 8;
  return camera;
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::Bytes bytes(data, size);
  tv_depth_options options;
  tv_depth_options_init(&options);
  options.max_pixels = bytes.raw<uint8_t>() < 250 ? bytes.whole(1024, 4096) : bytes.raw<uint16_t>();
  options.max_planes = bytes.raw<uint8_t>() < 250 ? bytes.whole(16, 64) : bytes.whole(0, 300);
  options.max_views = bytes.whole(0, 7) == 0 ? bytes.whole(0, 9) : kMostViews;
  options.near_depth = bytes.wild(0.1, 2);
  options.far_depth = options.near_depth + 0.5 + bytes.wild(0, 5);
  options.max_relative_sigma = bytes.whole(0, 1) == 0 ? 0.05 : bytes.wild(0, 1);
  const int num_views = bytes.whole(0, 15) == 0 ? bytes.whole(0, 1) : bytes.whole(2, kMostViews);
  tv_camera cameras[kMostViews];
  tv_depth_view views[kMostViews];
  std::vector<uint8_t> pixels[kMostViews];
  std::vector<uint8_t> pattern((kMostSide + 16) * kMostSide);
  uint64_t seed = 1;
  random_bytes(&seed, pattern.data(), pattern.size());
  for (int k = 0; k < kMostViews; ++k) {
    cameras[k] = camera_of(bytes);
    pixels[k].resize(static_cast<size_t>(cameras[k].width) *
                     static_cast<size_t>(cameras[k].height));
    const int shift = bytes.whole(0, 15), kind = bytes.whole(0, 7);
    for (int y = 0; y < cameras[k].height; ++y)
      for (int x = 0; x < cameras[k].width; ++x)
        pixels[k][static_cast<size_t>(y * cameras[k].width + x)] =
            kind == 7 ? 90 : pattern[static_cast<size_t>(y * (kMostSide + 16) + x + shift)];
    views[k].image = {pixels[k].data(), cameras[k].width, cameras[k].height, cameras[k].width};
    views[k].camera = &cameras[k];
    double q[4] = {1, 0, 0, 0};
    const double turn = bytes.whole(0, 7) == 0 ? 1 : 0.05;
    for (int i = 1; i < 4; ++i) q[i] = turn * bytes.between(-1, 1);
    fuzz::rotation_of(q, views[k].world_from_cam_R);
    if (bytes.whole(0, 31) == 0) views[k].world_from_cam_R[bytes.whole(0, 8)] = bytes.wild(-1, 1);
    for (double& value : views[k].world_from_cam_t) value = 0.3 * bytes.wild(-1, 1);
  }
  tv_camera map_camera = {};
  size_t need = 0, count = 1;
  const tv_status sized = tv_depth_size(&cameras[0], &options, &need);
  if (sized == TV_OK) {
    FUZZ_REQUIRE(tv_depth_map_camera(&cameras[0], &options, &map_camera) == TV_OK);
    count = static_cast<size_t>(map_camera.width) * static_cast<size_t>(map_camera.height);
  } else {
    need = 64;
  }
  tv_status status[2];
  std::vector<float> distance[2], sigma[2];
  std::vector<uint8_t> witnesses[2], grey[2];
  for (int k = 0; k < 2; ++k) {
    void* memory;
    FUZZ_REQUIRE(posix_memalign(&memory, TV_CONTEXT_ALIGNMENT, need) == 0);
    std::memset(memory, 255 * k, need);
    distance[k].resize(count);
    sigma[k].resize(count);
    witnesses[k].resize(count);
    grey[k].resize(count);
    const tv_depth_arrays arrays = {distance[k].data(), sigma[k].data(), witnesses[k].data(),
                                    grey[k].data()};
    status[k] = tv_sweep_depth(memory, need, views, num_views, &options, &arrays);
    std::free(memory);
  }
  FUZZ_REQUIRE(status[0] == status[1]);
  if (status[0] != TV_OK) return 0;
  FUZZ_REQUIRE(sized == TV_OK);
  FUZZ_REQUIRE(distance[0] == distance[1] && sigma[0] == sigma[1]);
  FUZZ_REQUIRE(witnesses[0] == witnesses[1] && grey[0] == grey[1]);
  for (size_t i = 0; i < count; ++i) {
    const float d = distance[0][i], s = sigma[0][i];
    FUZZ_REQUIRE(std::isfinite(d) && d >= 0 && std::isfinite(s) && s >= 0);
    FUZZ_REQUIRE((d > 0) == (s > 0));
    FUZZ_REQUIRE(witnesses[0][i] < num_views);
    FUZZ_REQUIRE(d > 0 || witnesses[0][i] == 0);
    FUZZ_REQUIRE(static_cast<double>(s) <=
                 options.max_relative_sigma * static_cast<double>(d) * (1 + 1e-5));
  }
  return 0;
}
