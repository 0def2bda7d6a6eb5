// Camera files of every format: any text gives a camera that the library accepts, or BadInput.
#include <string>

#include "base/error.h"
#include "files/camera_file.h"
#include "files/camera_formats.h"
#include "files/camera_set.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  try {
    const tv_camera camera = cli::parse_camera(text, "f");
    FUZZ_REQUIRE(tv_camera_check(&camera) == TV_OK);
    const tv_camera again = cli::parse_camera(cli::camera_yaml(camera), "again");
    FUZZ_REQUIRE(again.fx == camera.fx && again.cy == camera.cy && again.k[3] == camera.k[3]);
  } catch (const cli::BadInput&) {
  }
  try {
    for (const auto& entry : cli::parse_camera_set(text, "f"))
      FUZZ_REQUIRE(tv_camera_check(&entry.second) == TV_OK);
  } catch (const cli::BadInput&) {
  }
  try {
    for (const auto& entry : cli::parse_camera_file(text, "f").cameras)
      FUZZ_REQUIRE(tv_camera_check(&entry.second) == TV_OK);
  } catch (const cli::BadInput&) {
  }
  return 0;
}
