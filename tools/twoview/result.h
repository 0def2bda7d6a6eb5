// What a pair's reconstruction is told as: result.json, words, the cloud's points.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "image_file.h"
#include "measures.h"
#include "options.h"
#include "twoview/twoview.h"

namespace cli {

// All that the outputs of `reconstruct` are made from.
struct Outcome {
  Picture picture[2];
  bool has_cameras = false;
  tv_camera camera[2]{};  // of the images as they were used, so resized ones
  tv_two_view two_view{};
  tv_reconstruction reconstruction{};  // its arrays lie in the context
  nlohmann::ordered_json json;         // result.json
};

// A point of the cloud with its colour in image 0.
struct CloudPoint {
  double x, y, z;  // camera 0 frame, units of |t|
  uint8_t red, green, blue;
  float angle_deg, error_px;
};
std::vector<CloudPoint> cloud_of(const Outcome& outcome);

// A camera as a small pyramid in the frame of camera 0, `size` deep; needs a full pose for
// camera 1.
struct Frustum {
  Vector3 centre;
  std::array<Vector3, 4> corners;  // around the image
};
Frustum frustum_of(const Outcome& outcome, int camera, double size);

// result.json but for `truth`, `timings_ms`, `context_bytes`, `options`, `kernels`.
nlohmann::ordered_json result_json(const Outcome& outcome);

// The verdict's reasons as a phrase for people: "the camera only rotated"; empty without any.
std::string reasons_in_words(uint32_t reasons);
std::string config_in_words(int32_t config);

// A number, or null where it is not finite.
nlohmann::ordered_json finite_or_null(double value);

// JSON text with a line end; bytes that are no UTF-8 (in file names) are replaced.
std::string json_text(const nlohmann::ordered_json& json);

}  // namespace cli
