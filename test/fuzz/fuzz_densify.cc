// Fuzzes tv_densify with any motion, lenses and options, and with images that show the same pattern
// shifted, noise, or one grey. Two calls whose memory held other bytes before must give equal
// points.
#include <algorithm>
#include <vector>

#include "fuzz.h"
#include "support/random.h"
#include "twoview/dense.h"

namespace {

constexpr int kMaxSide = 48, kMaxPoints = 4096, kNumSparse = 4;

tv_dense_options options_of(fuzz::Bytes& bytes) {
  tv_dense_options options;
  tv_dense_options_init(&options);
  options.max_cells = bytes.raw<uint8_t>() < 250 ? bytes.whole(1024, 4096) : bytes.raw<int32_t>();
  options.max_steps = bytes.raw<uint8_t>() < 250 ? bytes.whole(16, 64) : bytes.whole(0, 600);
  if (bytes.whole(0, 2) == 0) {
    options.min_parallax_rad = bytes.whole(0, 1) * bytes.wild(0, 1);
    options.max_parallax_rad = bytes.wild(0, 3.2);
  }
  options.max_relative_sigma = bytes.whole(0, 1) == 0 ? 1 : bytes.wild(0, 0.05);
  return options;
}

// A lens of the images' own size, mostly one with which they overlap.
tv_camera camera_of(fuzz::Bytes& bytes, int width, int height) {
  tv_camera camera = {TV_CAMERA_PINHOLE,  width, height, 0, 60, 60, 0.5 * (width - 1),
                      0.5 * (height - 1), {}};
  const int kind = bytes.whole(0, 7);
  if (kind == 0) camera = fuzz::camera(bytes);
  if (kind == 1) camera.model = TV_CAMERA_KANNALA_BRANDT;
  if (kind == 2) camera.model = TV_CAMERA_BROWN_CONRADY, camera.k[0] = bytes.wild(-0.4, 0.4);
  camera.width = width, camera.height = height;
  return camera;
}

// No rotation, one by a small or any angle, or in 1 of 32 inputs any nine numbers.
void any_rotation(fuzz::Bytes& bytes, double R[9]) {
  constexpr double kSizes[5] = {1, 0.05, 0.01, 0, 0};
  const double size = kSizes[bytes.whole(0, 4)];
  double q[4] = {1, 0, 0, 0};
  for (int i = 1; i < 4; ++i) q[i] = size * bytes.between(-1, 1);
  fuzz::rotation_of(q, R);
  if (bytes.whole(0, 31) == 0)
    for (int i = 0; i < 9; ++i) R[i] = bytes.wild(-1, 1);
}

struct Picture {
  int width, height, stride;
  std::vector<uint8_t> pixels;  // not a byte behind the last row's end
  tv_image image() const { return {pixels.data(), width, height, stride}; }
};

Picture picture_of(fuzz::Bytes& bytes, int shift) {
  Picture p;
  p.width = bytes.whole(0, 7) == 0 ? bytes.whole(1, kMaxSide) : kMaxSide;
  p.height = bytes.whole(0, 7) == 0 ? bytes.whole(1, kMaxSide) : kMaxSide - 8;
  p.stride = p.width + bytes.whole(0, 2);
  p.pixels.resize(static_cast<size_t>(p.stride * (p.height - 1) + p.width));
  const int kind = bytes.whole(0, 7);
  uint64_t seed = kind < 6 ? 1 : bytes.raw<uint8_t>();  // most pairs show one pattern
  constexpr int kWide = kMaxSide + 18, kHigh = kMaxSide + 2;
  std::vector<uint8_t> noise(kWide * kHigh);
  random_bytes(&seed, noise.data(), noise.size());
  for (int y = 0; y < p.height; ++y)
    for (int x = 0; x < p.width; ++x) {
      int sum = 0;  // over 3 x 3 pixels of noise, so that what lies between pixels can be matched
      for (int k = 0; k < 9; ++k)
        sum += noise[static_cast<size_t>((y + k / 3) * kWide + x + shift + k % 3)];
      p.pixels[static_cast<size_t>(y * p.stride + x)] =
          kind == 7 ? 90 : static_cast<uint8_t>(sum / 9);
    }
  return p;
}

void require_sound(const tv_dense_point& point, const tv_image& image0, const tv_image& image1,
                   const tv_dense_options& options) {
  const double position[3] = {point.position[0], point.position[1], point.position[2]};
  FUZZ_REQUIRE(fuzz::all_finite(position, 3));
  const double distance =
      std::sqrt(position[0] * position[0] + position[1] * position[1] + position[2] * position[2]);
  FUZZ_REQUIRE(distance > 0);
  FUZZ_REQUIRE(point.sigma > 0);
  FUZZ_REQUIRE(point.sigma <= options.max_relative_sigma * distance * (1 + 1e-5));
  FUZZ_REQUIRE(point.similarity > 0 && point.similarity <= 1);
  FUZZ_REQUIRE(point.pixel0[0] >= -0.5f && point.pixel0[0] <= image0.width - 0.5f);
  FUZZ_REQUIRE(point.pixel0[1] >= -0.5f && point.pixel0[1] <= image0.height - 0.5f);
  // The library rounds the pixel before it becomes a float, so near a half either side may be
  // right.
  const double x = point.pixel0[0], y = point.pixel0[1], near = 1e-4;
  bool found = false;
  for (const double dx : {-near, near})
    for (const double dy : {-near, near}) {
      const long column = std::min(std::max(std::lround(x + dx), 0L), image0.width - 1L);
      const long row = std::min(std::max(std::lround(y + dy), 0L), image0.height - 1L);
      found = found || point.grey == image0.data[row * image0.stride_bytes + column];
    }
  FUZZ_REQUIRE(found);
  FUZZ_REQUIRE(point.pixel1[0] >= -0.5f && point.pixel1[0] <= image1.width - 0.5f);
  FUZZ_REQUIRE(point.pixel1[1] >= -0.5f && point.pixel1[1] <= image1.height - 0.5f);
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::Bytes bytes(data, size);
  tv_dense_options options = options_of(bytes);
  const Picture picture0 = picture_of(bytes, 0), picture1 = picture_of(bytes, bytes.whole(0, 15));
  const tv_image image0 = picture0.image(), image1 = picture1.image();
  const tv_camera camera0 = camera_of(bytes, image0.width, image0.height);
  const tv_camera camera1 = camera_of(bytes, image1.width, image1.height);
  tv_camera_pair pair{camera0, camera1, {}, {-1, 0, 0}};
  any_rotation(bytes, pair.cam1_from_cam0_R);
  if (bytes.whole(0, 2) == 0)
    for (double& value : pair.cam1_from_cam0_t) value = bytes.wild(-1, 1);
  tv_point sparse[kNumSparse];
  std::memset(sparse, 0, sizeof sparse);
  for (tv_point& point : sparse) {
    point.status = bytes.whole(0, 3) == 0 ? bytes.whole(0, 5) : TV_POINT_OK;
    point.angle_rad = bytes.wild(0, 0.5);
  }
  options.sparse = sparse;
  options.num_sparse = bytes.whole(0, kNumSparse);
  const int cap = bytes.whole(0, 3) == 0 ? bytes.whole(0, 40) : kMaxPoints;
  if (options.max_cells > 100000) return 0;  // it may be valid, and asks for minutes and gigabytes
  size_t need = 0;
  if (tv_dense_size(&camera0, &camera1, &options, &need) != TV_OK) need = 64;
  tv_status status[2];
  std::vector<tv_dense_point> points[2];
  for (int k = 0; k < 2; ++k) {
    void* memory;
    FUZZ_REQUIRE(posix_memalign(&memory, TV_CONTEXT_ALIGNMENT, need) == 0);
    std::memset(memory, 255 * k, need);
    points[k].resize(static_cast<size_t>(cap));
    int32_t count = -1;
    const tv_image images[2] = {image0, image1};
    status[k] = tv_densify(memory, need, &pair, images, &options, points[k].data(), cap, &count);
    std::free(memory);
    if (status[k] != TV_OK) count = 0;
    FUZZ_REQUIRE(count >= 0 && count <= cap);
    points[k].resize(static_cast<size_t>(count));
    for (const tv_dense_point& point : points[k]) require_sound(point, image0, image1, options);
  }
  FUZZ_REQUIRE(status[0] == status[1] && points[0].size() == points[1].size());
  FUZZ_REQUIRE(points[0].empty() || std::memcmp(points[0].data(), points[1].data(),
                                                points[0].size() * sizeof(tv_dense_point)) == 0);
  return 0;
}
