// The outcome of a pair's reconstruction, and what is reported of it: result.json, phrases for
// people, the cloud's points, the cameras' frustums.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "files/image_file.h"
#include "pair/measures.h"
#include "pair/options.h"
#include "twoview/twoview.h"

namespace cli {

// The distance between the two camera positions, and the measurement that it comes from.
struct MetricScale {
  std::string source;  // "velocity", "altitude", "floor"
  double baseline_m = 0, sigma_m = 0;
};

// Everything that the outputs of `reconstruct` are made from.
struct Outcome {
  Picture picture[2];
  bool has_cameras = false;
  // As the camera files have them, but for the images as they were used: scaled along with a
  // resized image.
  tv_camera camera[2]{};
  tv_two_view two_view{};
  tv_reconstruction reconstruction{};  // its arrays lie in the context
  std::optional<MetricScale> scale;    // then outputs are in metres, else in baselines
  nlohmann::ordered_json json;         // result.json
};

// The camera that pose and points refer to: the file's camera with the principal point that was
// estimated from the matches.
tv_camera corrected_camera(const Outcome& outcome, int camera);

// The factor from the unit of the two-view pose and its points to the unit of the outputs: the
// baseline in metres when the scale is known, else 1.
double unit_of(const Outcome& outcome);

// A point of the cloud with its colour in image 0.
struct CloudPoint {
  double x, y, z;  // camera 0 frame, metres or baselines
  uint8_t red, green, blue;
  float angle_deg, error_px;
};
std::vector<CloudPoint> cloud_of(const Outcome& outcome);

// A camera drawn as a pyramid of depth `size`, in the frame of camera 0. Camera 1 needs a full
// pose.
struct Frustum {
  Vector3 centre;
  std::array<Vector3, 4> corners;  // around the image
};
Frustum frustum_of(const Outcome& outcome, int camera, double size);

// result.json without `truth`, `timings_ms`, `context_bytes`, `options`, `kernels`.
nlohmann::ordered_json result_json(const Outcome& outcome);

// The verdict's reasons as a phrase such as "the camera only rotated"; empty without a reason.
std::string reasons_in_words(uint32_t reasons);
std::string kind_in_words(int32_t kind);

// A number, or null where it is not finite.
nlohmann::ordered_json finite_or_null(double value);

// JSON text with a line end; bytes that are no UTF-8 (in file names) are replaced.
std::string json_text(const nlohmann::ordered_json& json);

}  // namespace cli
