// What a pair's reconstruction is told as: result.json, words, the cloud's points.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "image_file.h"
#include "measures.h"
#include "options.h"
#include "twoview/twoview.h"

namespace cli {

// The distance between the two camera positions, and where that is known from.
struct MetricScale {
  std::string source;  // "velocity", "altitude", "floor"
  double baseline_m = 0, sigma_m = 0;
};

// All that the outputs of `reconstruct` are made from.
struct Outcome {
  Picture picture[2];
  bool has_cameras = false;
  tv_camera
      camera[2]{};  // of the images as they were used, so resized ones; as the files have them
  tv_two_view two_view{};
  tv_reconstruction reconstruction{};  // its arrays lie in the context
  std::optional<MetricScale> scale;    // then outputs are in metres, else in baselines
  nlohmann::ordered_json json;         // result.json
};

// The camera that pose and points are of: the file's, its principal point where the matches have
// it.
tv_camera corrected_camera(const Outcome& outcome, int camera);

// What one unit of the two-view pose and of its points is in the outputs: 1, or the baseline in
// metres.
double unit_of(const Outcome& outcome);

// A point of the cloud with its colour in image 0.
struct CloudPoint {
  double x, y, z;  // camera 0 frame, metres or baselines
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
std::string kind_in_words(int32_t kind);

// A number, or null where it is not finite.
nlohmann::ordered_json finite_or_null(double value);

// JSON text with a line end; bytes that are no UTF-8 (in file names) are replaced.
std::string json_text(const nlohmann::ordered_json& json);

}  // namespace cli
