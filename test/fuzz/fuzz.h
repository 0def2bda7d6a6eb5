// Helpers of the fuzz targets: fuzz::Bytes turns the fuzzer's bytes into values, FUZZ_REQUIRE
// checks a condition.
#ifndef TEST_FUZZ_FUZZ_H
#define TEST_FUZZ_FUZZ_H

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "twoview/alloc.h"
#include "twoview/twoview.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

// Active in every build. It aborts, so that the fuzzer keeps the input that breaks the condition.
#define FUZZ_REQUIRE(condition)                                            \
  do {                                                                     \
    if (!(condition)) {                                                    \
      std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                        \
    }                                                                      \
  } while (0)

namespace fuzz {

// Values made of the fuzzer's bytes; zeros once the bytes have run out.
class Bytes {
 public:
  Bytes(const uint8_t* data, size_t size) : data_(data), size_(size) {}
  size_t left() const { return size_ - at_; }

  template <class T>
  T raw() {
    T value{};
    const size_t count = left() < sizeof value ? left() : sizeof value;
    std::memcpy(&value, data_ + at_, count);
    at_ += count;
    return value;
  }
  int32_t whole(int32_t low, int32_t high) {
    return low + static_cast<int32_t>(raw<uint16_t>() % (high - low + 1));
  }
  double between(double low, double high) { return low + (high - low) * raw<uint16_t>() / 65535; }
  // A value in the range most of the time, sometimes any double at all.
  double wild(double low, double high) {
    return raw<uint8_t>() < 240 ? between(low, high) : raw<double>();
  }

 private:
  const uint8_t* data_;
  size_t size_, at_ = 0;
};

inline bool all_finite(const double* values, int count) {
  for (int i = 0; i < count; ++i) {
    if (!std::isfinite(values[i])) return false;
  }
  return true;
}

// The rotation of a quaternion of any length. One of length 0 gives no rotation.
inline void rotation_of(const double quaternion[4], double R[9]) {
  double norm_sq = 0;
  for (int i = 0; i < 4; ++i) norm_sq += quaternion[i] * quaternion[i];
  const double norm = std::sqrt(norm_sq > 0 ? norm_sq : 1);
  double q[4];
  for (int i = 0; i < 4; ++i) q[i] = quaternion[i] / norm;
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double rotation[9] = {
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
      2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
      2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  std::copy_n(rotation, 9, R);
}

inline tv_camera camera(Bytes& bytes) {
  tv_camera camera{};
  camera.model = bytes.whole(0, 3) % 3;
  camera.width = bytes.whole(1, 2000);
  camera.height = bytes.whole(1, 2000);
  camera.fx = bytes.wild(50, 2000);
  camera.fy = bytes.wild(50, 2000);
  camera.cx = bytes.wild(-100, 2000);
  camera.cy = bytes.wild(-100, 2000);
  for (double& k : camera.k) k = bytes.wild(-0.6, 0.6);
  return camera;
}

// One context for the whole run, since a target is called many times.
inline tv_context* context(int side, int max_keypoints, int max_matches) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = side;
  limits.max_keypoints = max_keypoints;
  limits.max_matches = max_matches;
  tv_context* context = nullptr;
  FUZZ_REQUIRE(tv_context_new(&context, &limits) == TV_OK);
  return context;
}

}  // namespace fuzz

#endif
