// Fuzzes tv_triangulate with any pose, any pixels and every method.
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::Bytes bytes(data, size);
  const tv_camera plain = {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {}};
  const bool lens = bytes.whole(0, 3) == 0;
  const tv_camera camera0 = lens ? fuzz::camera(bytes) : plain;
  const tv_camera camera1 = lens ? fuzz::camera(bytes) : plain;
  // R is a rotation, made from a quaternion, or in 1 of 16 inputs any nine numbers.
  tv_camera_pair pair{camera0, camera1, {}, {}};
  double(&R)[9] = pair.cam1_from_cam0_R, q[4];
  for (double& value : q) value = bytes.between(-1, 1);
  fuzz::rotation_of(q, R);
  if (bytes.whole(0, 15) == 0)
    for (double& value : R) value = bytes.wild(-1, 1);
  for (double& value : pair.cam1_from_cam0_t) value = bytes.wild(-1, 1);
  constexpr int kNum = 6;
  double pixels[2][2 * kNum];
  for (auto& view : pixels)
    for (double& value : view) value = bytes.wild(0, 640);
  if (bytes.whole(0, 3) == 0) std::memcpy(pixels[1], pixels[0], sizeof pixels[0]);
  tv_pixel_pairs pairs;
  tv_pixel_pairs_init(&pairs);
  pairs.num = kNum;
  pairs.pixels0 = pixels[0];
  pairs.pixels1 = pixels[1];
  for (int method = -1; method <= TV_TRIANGULATION_MIDPOINT + 1; ++method) {
    tv_point points[kNum];
    const tv_status status =
        tv_triangulate(&pair, &pairs, static_cast<tv_triangulation>(method), points);
    if (status != TV_OK) continue;
    for (const tv_point& point : points) {
      FUZZ_REQUIRE(point.status >= TV_POINT_OK && point.status <= TV_POINT_INVALID);
      FUZZ_REQUIRE(fuzz::all_finite(point.position, 3));
      FUZZ_REQUIRE(std::isfinite(point.angle_rad) && point.angle_rad >= 0);
      FUZZ_REQUIRE(std::isfinite(point.error_px) && point.error_px >= 0);
    }
  }
  return 0;
}
