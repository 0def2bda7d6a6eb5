// Fuzzes the functions tv_camera_* with any camera, point and pixel.
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::Bytes bytes(data, size);
  const tv_camera camera = fuzz::camera(bytes);
  const bool good = tv_camera_check(&camera) == TV_OK;
  double angle = -1;
  FUZZ_REQUIRE((tv_camera_valid_angle(&camera, &angle) == TV_OK) == good);
  FUZZ_REQUIRE(!good || (angle >= 0 && angle < 3.15));
  tv_camera scaled;
  if (tv_camera_scale(&camera, bytes.wild(0.01, 16), &scaled) == TV_OK)
    FUZZ_REQUIRE(tv_camera_check(&scaled) == TV_OK);
  for (int i = 0; i < 8; ++i) {
    const double pixel[2] = {bytes.wild(-100, 2100), bytes.wild(-100, 2100)};
    double ray[3], d_ray[6], back[2], d_pixel[6], straight[2];
    if (tv_camera_unproject(&camera, pixel, ray, d_ray) == TV_OK) {
      FUZZ_REQUIRE(good && fuzz::all_finite(ray, 3) && fuzz::all_finite(d_ray, 6));
      FUZZ_REQUIRE(std::fabs(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2] - 1) < 1e-9);
    }
    if (tv_camera_undistort(&camera, pixel, straight) == TV_OK)
      FUZZ_REQUIRE(fuzz::all_finite(straight, 2));
    const double point[3] = {bytes.wild(-2, 2), bytes.wild(-2, 2), bytes.wild(-1, 3)};
    double many[2];
    uint8_t inside = 2;
    const bool seen = tv_camera_project(&camera, point, back, d_pixel) == TV_OK;
    if (seen) FUZZ_REQUIRE(fuzz::all_finite(back, 2) && fuzz::all_finite(d_pixel, 6));
    if (good) {
      FUZZ_REQUIRE(tv_camera_project_points(&camera, point, 1, many, &inside) == TV_OK);
      // Projects without a Jacobian: a Jacobian may overflow where the pixel is still finite.
      const bool projected = tv_camera_project(&camera, point, back, nullptr) == TV_OK;
      FUZZ_REQUIRE(projected || !seen);
      FUZZ_REQUIRE(inside == projected &&
                   (!projected || std::memcmp(many, back, sizeof back) == 0));
    }
  }
  return 0;
}
