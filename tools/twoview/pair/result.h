// The result of a pair's reconstruction and its reported forms: result.json, phrases for people,
// the cloud's points, the cameras' frustums.
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

// The distance between the two camera positions, and the measurement that gave it.
struct MetricScale {
  std::string source;  // the measurement: "velocity", "altitude" or "floor"
  double baseline_m = 0, sigma_m = 0;
};

// The arrays of a reconstruction of matches that were given; empty where the library found them and
// holds the arrays.
struct OwnArrays {
  std::vector<tv_keypoint> keypoints[2];
  std::vector<tv_correspondence> matches;
  std::vector<uint8_t> inlier_mask;
  std::vector<tv_point> points;
};

// All data from which the outputs of `reconstruct` are made.
struct Outcome {
  Picture picture[2];
  bool has_cameras = false;
  bool has_camera_files = false;        // the cameras are from files, not from a focal length alone
  bool estimates_focal_length = false;  // nothing was given: it is estimated with the pose
  bool tried_hardest = true;  // the highest rung of effort was allowed, or there are no rungs
  // The cameras of the images as used: those of the camera files, scaled if the image was resized.
  tv_camera camera[2]{};
  tv_two_view two_view{};
  tv_evidence evidence{};
  // The arrays that it points to lie in the context's memory, valid until the context's next call,
  // or in `own`.
  tv_reconstruction reconstruction{};
  OwnArrays own;
  std::optional<std::vector<tv_dense_point>> dense;  // empty without --dense or a full pose
  std::optional<MetricScale> scale;  // empty: outputs are in baselines, else in metres
  nlohmann::ordered_json json;       // the content of result.json
  std::vector<std::string> notes;    // what the program decided by itself, for the report
};

// The cameras that pose and points refer to, and the pose: the camera files', with the estimated
// shift added to the principal point, and the focal length multiplied by the factor of the estimate
// where it was refined.
tv_camera_pair corrected_pair(const Outcome& outcome);

// The factor from the unit of the two-view pose and its points to the unit of the outputs: the
// baseline in metres when the scale is known, else 1.
double unit_of(const Outcome& outcome);

// A point of the cloud with its colour in image 0.
struct CloudPoint {
  double x, y, z;  // in camera 0's frame, in metres or baselines (unit_of)
  uint8_t red, green, blue;
  float angle_deg;
  float error_px;  // of a dense point: the standard deviation of its match
  // Standard deviations of the distance from camera 0: by the noise of the match, and by the
  // covariance of the pose, which all points share; 0: not known.
  float sigma = 0, sigma_pose = 0;
};
// The points of the matches, and behind them the dense ones.
std::vector<CloudPoint> cloud_of(const Outcome& outcome);

// The medians over the dense points of both standard deviations over the distance, per cent; NaN
// without points.
double dense_sigma_percent(const Outcome& outcome);
double dense_pose_sigma_percent(const Outcome& outcome);

// A camera drawn as a pyramid of depth `size`, in the frame of camera 0. For camera 1 the result
// must have a full pose.
struct Frustum {
  Vector3 centre;
  std::array<Vector3, 4> corners;  // the image's corners, in order around it
};
Frustum frustum_of(const Outcome& outcome, int camera, double size);

// Makes the content of result.json except `imu` and `truth`, which are null, and `recording`,
// `timings_ms`, `context_bytes`, `options` and `kernels`: the caller adds these.
nlohmann::ordered_json result_json(const Outcome& outcome);

// `timings_ms.rungs`: the milliseconds of each rung of effort that was run.
nlohmann::ordered_json rungs_json(const tv_reconstruction& reconstruction);

// The test of the principal point: `chi2`, `asked_px`, `asked_covariance_px2` (null where it is not
// known) and `shift_px`.
nlohmann::ordered_json principal_point_json(const Outcome& outcome);

// The verdict for people: the word "ok" only where there is a full pose. A fundamental matrix alone
// that is to be believed is "matches ok, no pose".
std::string verdict_in_words(const tv_two_view& two_view);

// The names of the reasons, such as "low_parallax".
nlohmann::ordered_json reasons_json(uint32_t reasons);

// The 25 numbers of the covariance; null where there is none.
nlohmann::ordered_json covariance_json(const tv_two_view& two_view);

// Whether the covariance contains a focal length that is uncertain by more than 2 per cent.
bool focal_length_is_uncertain(const tv_two_view& two_view);

// By how much the focal length was changed, in per cent, rounded to tenths; never -0.
double focal_change_percent(const tv_two_view& two_view);

// What the matches say against the cameras as they were given: `chi2`, and by how much the pose
// would move, `rotation_deg` and `direction_deg`; null where it was not tested.
nlohmann::ordered_json camera_misfit_json(const tv_evidence& evidence);

// `scale` (1 where it is as given), `sigma` and `uncertain` of the focal length; null where it is
// taken as exact.
nlohmann::ordered_json focal_length_json(const tv_two_view& two_view);

// How many times larger image 1 shows the scene than image 0, beyond what the cameras' focal
// lengths explain: the median ratio of the distances between inliers. 0 where it is not known: with
// fewer than 20 ratios, or where the upper quartile is above 1.5 times the lower one. Matches that
// the geometry rejects are not used, since those of unrelated pictures have a median of 0.4 to 1.7.
double magnification(const Outcome& outcome);

// The reasons of the verdict as a phrase such as "the camera only rotated"; empty if there is none.
std::string reasons_in_words(const Outcome& outcome);
std::string kind_in_words(int32_t kind);

// What to do about each reason, in the order of reasons_json; empty if there is none.
std::vector<std::string> advice_on(const Outcome& outcome);

// The standard deviations of rotation and direction in degrees. Each is the square root of the
// trace of its block of the covariance: that of the total angle, not of the angle about one axis.
struct Uncertainty {
  double rotation, direction;
};
Uncertainty uncertainty_deg(const tv_two_view& two_view);

// A standard deviation in degrees with three digits behind the point, or "above 90": a larger one
// says that nothing is known.
std::string sigma_in_words(double sigma_deg);

// The number as JSON; null if it is not finite.
nlohmann::ordered_json finite_or_null(double value);

// JSON text with a final line end. Bytes that are not UTF-8 (possible in file names) are replaced.
std::string json_text(const nlohmann::ordered_json& json);

}  // namespace cli
