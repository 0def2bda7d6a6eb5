#include "pair/result.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace cli {
namespace {

constexpr double kDegrees = 57.29577951308232;  // degrees in a radian

using Json = nlohmann::ordered_json;

Json numbers_or_null(const double* values, size_t count, bool present) {
  if (!present) return nullptr;
  Json list = Json::array();
  for (size_t i = 0; i < count; ++i) list.push_back(finite_or_null(values[i]));
  return list;
}

Json count_or_null(int32_t count) { return count < 0 ? Json(nullptr) : Json(count); }

struct Phrase {
  tv_reason reason;
  std::string words;
  std::string advice;  // what to do about it: docs/verdict.md, "what helps"
};

const Phrase kReasons[] = {
    {TV_REASON_TOO_FEW_MATCHES, "too few matches",
     "take pictures with more overlap or texture, or try --guided-matching 1"},
    {TV_REASON_LOW_INLIER_RATIO, "few of the matches agree",
     "check that the camera file is of these pictures, that none is mirrored, and that both show "
     "the scene from a similar distance at a similar zoom; more overlap"},
    {TV_REASON_LOW_PARALLAX, "low parallax: the camera hardly moved for this depth",
     "move farther between the pictures; the rotation can be used"},
    {TV_REASON_TWO_PLANAR_SOLUTIONS, "the scene is a plane, which two poses explain",
     "show something off the plane, or give the direction of gravity"},
    {TV_REASON_PURE_ROTATION, "the camera only rotated",
     "move the camera between the pictures; the rotation can be used"},
    {TV_REASON_NO_MOTION, "the camera did not move", "move the camera between the pictures"},
    {TV_REASON_SECOND_MOTION, "a second motion is in the scene",
     "keep what moves out of the pictures, or mask it"},
    {TV_REASON_CROWDED_MATCHES, "the matches crowd in a small part of the image",
     "show texture in other parts of the pictures, or try --cell-px 32"},
    {TV_REASON_REPEATED_STRUCTURE, "repeated structure makes the matches doubtful",
     "show where the repeated structure ends"},
    {TV_REASON_CAMERA_CONTRADICTED,
     "the matches contradict the camera: a rolling shutter while it turned, or a wrong lens",
     "hold the camera still, or more light, for a shorter time; check that the camera file is of "
     "these pictures, or calibrate the camera (twoview calibrate)"},
};

// For the reason "low parallax" of a pair whose parallax is large: what leaves the pose open is the
// focal length. kNoCamera: the advice where neither a camera nor a focal length was given.
constexpr const char* kNoCamera =
    "the focal length is doubtful: give --focal-35mm where you know it, calibrate the camera "
    "(twoview calibrate), or estimate it from a film (twoview odometry)";
const Phrase kFocalLength = {TV_REASON_LOW_PARALLAX,
                             "the focal length is too uncertain for this pose",
                             "calibrate the camera (twoview calibrate)"};
constexpr double kMuchParallaxRad = 2 / kDegrees;

// The advice for these reasons where a focal length was given in place of a camera file.
constexpr const char* kNoFileFewAgree =
    "take pictures with more overlap, from a similar distance and at the same zoom; check that the "
    "focal length is theirs and that none is mirrored";
constexpr const char* kTwoFocalLengths =
    "take both pictures at one size and held the same way, so that one focal length serves both; "
    "or calibrate the camera (twoview calibrate)";

// A zoomed lens, of which the camera file is not, leaves two groups of matches, or a plane.
constexpr double kZoomed = 1.25;

std::vector<Phrase> phrases_of(const Outcome& outcome) {
  const tv_two_view& v = outcome.two_view;
  const double scale = v.verdict == TV_VERDICT_OK ? 0 : magnification(outcome);
  const bool zoomed = scale > 0 && (scale > kZoomed || scale < 1 / kZoomed);
  std::vector<Phrase> phrases;
  if (zoomed) {
    char words[100];
    std::snprintf(words, sizeof words, "image 1 shows the scene at %.2f times the scale of image 0",
                  scale);
    phrases.push_back(
        {static_cast<tv_reason>(0), words,
         "if the lens was zoomed, give each picture its own camera (--camera0, --camera1); else "
         "take both from a similar distance"});
  }
  for (const Phrase& phrase : kReasons) {
    if ((v.reasons & phrase.reason) == 0) continue;
    if (zoomed && phrase.reason == TV_REASON_SECOND_MOTION) continue;
    const bool of_focal_length =
        phrase.reason == TV_REASON_LOW_PARALLAX &&
        (outcome.estimates_focal_length ||
         (focal_length_is_uncertain(v) && v.median_parallax_rad > kMuchParallaxRad));
    phrases.push_back(of_focal_length ? kFocalLength : phrase);
    const bool same_size = outcome.camera[0].width == outcome.camera[1].width &&
                           outcome.camera[0].height == outcome.camera[1].height;
    if (!outcome.has_cameras || outcome.has_camera_files) continue;
    if (of_focal_length && outcome.estimates_focal_length) phrases.back().advice = kNoCamera;
    if (of_focal_length && !same_size) phrases.back().advice = kTwoFocalLengths;
    if (phrase.reason == TV_REASON_LOW_INLIER_RATIO) phrases.back().advice = kNoFileFewAgree;
  }
  return phrases;
}

// The root mean square reprojection error of the cloud's points; NaN without points.
double rms_reprojection_px(const tv_reconstruction& reconstruction) {
  double sum = 0;
  int count = 0;
  for (int32_t i = 0; i < reconstruction.num_matches; ++i) {
    const tv_point& point = reconstruction.points[i];
    if (point.status != TV_POINT_OK) continue;
    sum += static_cast<double>(point.error_px) * point.error_px;
    ++count;
  }
  return count ? std::sqrt(sum / count) : NAN;
}

// The angle of a pixel of image 0, radians.
double pixel_angle(const Outcome& outcome) {
  return 1 / std::sqrt(outcome.camera[0].fx * outcome.camera[0].fy);
}

// The angle between the rays to a point, and how much its distance from camera 0 changes with that
// angle.
struct Parallax {
  double angle_rad, lever;
};
Parallax parallax_of(const tv_two_view& v, const Vector3& point) {
  const Vector3 away = applied(transposed(rotation_of(v)), translation_of(v));
  Vector3 other{};
  double cosine = 0;
  for (size_t i = 0; i < 3; ++i) {
    other[i] = point[i] + away[i];  // from camera 1, in the frame of camera 0
    cosine += point[i] * other[i];
  }
  cosine /= norm(point) * norm(other);
  const double angle = std::acos(std::min(std::max(cosine, -1.0), 1.0));
  return {angle, norm(other) / std::max(std::sin(angle), 1e-12)};
}

// The median over the dense points of sigma(point, position) / distance, per cent.
template <typename Sigma>
double median_share(const Outcome& outcome, const Sigma& sigma) {
  std::vector<double> shares;
  if (outcome.dense)
    for (const tv_dense_point& point : *outcome.dense) {
      const Vector3 at = {point.position[0], point.position[1], point.position[2]};
      shares.push_back(100 * sigma(point, at) / norm(at));
    }
  return shares.empty() ? NAN : percentile(shares, 0.5);
}

// Writes JSON as nlohmann's dump(2) does, except that a list of plain values stays on one line.
void append_json(std::string& text, const Json& json, size_t depth) {
  if (json.is_primitive() || json.empty()) {
    text += json.dump(-1, ' ', false, Json::error_handler_t::replace);
    return;
  }
  const auto is_plain = [](const Json& item) { return item.is_primitive(); };
  const bool is_short = json.is_array() && std::all_of(json.begin(), json.end(), is_plain);
  const std::string indent = "\n" + std::string(2 * depth, ' ');
  std::string separator = is_short ? "" : indent + "  ";
  text += json.is_object() ? "{" : "[";
  for (const auto& [key, value] : json.items()) {
    text += separator;
    if (json.is_object()) {
      append_json(text, key, depth);
      text += ": ";
    }
    append_json(text, value, depth + 1);
    separator = is_short ? ", " : "," + indent + "  ";
  }
  if (!is_short) text += indent;
  text += json.is_object() ? "}" : "]";
}

}  // namespace

tv_camera_pair corrected_pair(const Outcome& outcome) {
  tv_camera_pair pair;
  check(tv_corrected_pair(&outcome.two_view, &outcome.camera[0], &outcome.camera[1], &pair),
        "cannot correct the cameras");
  return pair;
}

double unit_of(const Outcome& outcome) { return outcome.scale ? outcome.scale->baseline_m : 1; }

std::vector<CloudPoint> cloud_of(const Outcome& outcome) {
  std::vector<CloudPoint> cloud;
  const tv_reconstruction& r = outcome.reconstruction;
  const double unit = unit_of(outcome);
  const auto colour_at = [&](double column, double row) {
    const cv::Mat& colour = outcome.picture[0].colour;
    const int x = std::min(std::max(static_cast<int>(std::lround(column)), 0), colour.cols - 1);
    const int y = std::min(std::max(static_cast<int>(std::lround(row)), 0), colour.rows - 1);
    return colour.at<cv::Vec3b>(y, x);
  };
  const double noise_rad = 1.4142135623730951 * outcome.two_view.noise_px * pixel_angle(outcome);
  for (int32_t i = 0; i < r.num_matches; ++i) {
    const tv_point& point = r.points[i];
    if (point.status != TV_POINT_OK) continue;
    const tv_keypoint& keypoint = r.keypoints[0][r.matches[i].idx0];
    const cv::Vec3b bgr = colour_at(keypoint.x, keypoint.y);
    const Vector3 at = {point.position[0], point.position[1], point.position[2]};
    const Parallax parallax = parallax_of(outcome.two_view, at);
    cloud.push_back({unit * at[0], unit * at[1], unit * at[2], bgr[2], bgr[1], bgr[0],
                     static_cast<float>(static_cast<double>(point.angle_rad) * kDegrees),
                     point.error_px, static_cast<float>(unit * noise_rad * parallax.lever),
                     static_cast<float>(unit * distance_sigma_of_pose(outcome.two_view, at))});
  }
  if (!outcome.dense) return cloud;
  for (const tv_dense_point& point : *outcome.dense) {
    const Vector3 at = {point.position[0], point.position[1], point.position[2]};
    const cv::Vec3b bgr = colour_at(point.pixel0[0], point.pixel0[1]);
    const Parallax parallax = parallax_of(outcome.two_view, at);
    const double sigma = point.sigma;
    cloud.push_back({unit * at[0], unit * at[1], unit * at[2], bgr[2], bgr[1], bgr[0],
                     static_cast<float>(parallax.angle_rad * kDegrees),
                     static_cast<float>(sigma / parallax.lever / pixel_angle(outcome)),
                     static_cast<float>(unit * sigma),
                     static_cast<float>(unit * distance_sigma_of_pose(outcome.two_view, at))});
  }
  return cloud;
}

double dense_sigma_percent(const Outcome& outcome) {
  return median_share(outcome, [](const tv_dense_point& point, const Vector3&) {
    return static_cast<double>(point.sigma);
  });
}

double dense_pose_sigma_percent(const Outcome& outcome) {
  return median_share(outcome, [&](const tv_dense_point&, const Vector3& at) {
    return distance_sigma_of_pose(outcome.two_view, at);
  });
}

Frustum frustum_of(const Outcome& outcome, int camera, double size) {
  Matrix3 R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 t = {0, 0, 0};
  if (camera == 1) {
    R = rotation_of(outcome.two_view);
    t = translation_of(outcome.two_view);
    for (double& part : t) part *= unit_of(outcome);
  }
  // Transforms a point x of this camera's frame to the frame of camera 0: R^T (x - t).
  const auto placed = [&](const Vector3& x) {
    return applied(transposed(R), {x[0] - t[0], x[1] - t[1], x[2] - t[2]});
  };
  const tv_camera& lens = outcome.camera[camera];  // drawn as if cx, cy were its centre
  Frustum frustum;
  frustum.centre = placed({0, 0, 0});
  for (size_t i = 0; i < 4; ++i) {
    const double x = (i == 1 || i == 2 ? 0.5 : -0.5) * lens.width / lens.fx;
    const double y = (i >= 2 ? 0.5 : -0.5) * lens.height / lens.fy;
    frustum.corners[i] = placed({x * size, y * size, size});
  }
  return frustum;
}

Json reasons_json(uint32_t reasons) {
  Json list = Json::array();
  for (const Phrase& phrase : kReasons)
    if (reasons & phrase.reason) list.push_back(tv_reason_string(phrase.reason));
  return list;
}

Json covariance_json(const tv_two_view& v) {
  return numbers_or_null(v.covariance, 25, v.has_covariance);
}

Json principal_point_json(const Outcome& outcome) {
  const tv_evidence& e = outcome.evidence;
  const bool known = e.principal_point_asked_covariance[0] > 0;
  return {{"chi2", known ? finite_or_null(e.principal_point_chi2) : Json(nullptr)},
          {"asked_px", numbers_or_null(e.principal_point_asked_px, 2, known)},
          {"asked_covariance_px2", numbers_or_null(e.principal_point_asked_covariance, 3, known)},
          {"shift_px", numbers_or_null(outcome.two_view.principal_point_shift, 2, true)}};
}

Json camera_misfit_json(const tv_evidence& e) {
  if (!(e.camera_chi2 > 0)) return nullptr;
  return {{"chi2", finite_or_null(e.camera_chi2)},
          {"rotation_deg", finite_or_null(e.camera_turn_rad * kDegrees)},
          {"direction_deg", finite_or_null(e.camera_direction_rad * kDegrees)}};
}

bool focal_length_is_uncertain(const tv_two_view& v) { return v.focal_sigma > 0.02; }

double focal_change_percent(const tv_two_view& v) {
  const double percent = v.focal_scale > 0 ? 100 * (v.focal_scale - 1) : 0;
  return std::round(10 * percent) / 10 + 0.0;  // -0 + 0 is 0
}

Json focal_length_json(const tv_two_view& v) {
  if (!(v.focal_sigma > 0)) return nullptr;
  return {{"scale", v.focal_scale > 0 ? v.focal_scale : 1.0},
          {"sigma", v.focal_sigma},
          {"uncertain", focal_length_is_uncertain(v)}};
}

Json rungs_json(const tv_reconstruction& reconstruction) {
  Json rungs = Json::array();
  for (int k = 0; k < reconstruction.num_rungs; ++k)
    rungs.push_back(static_cast<double>(reconstruction.rung_ns[k]) * 1e-6);
  return rungs;
}

Json result_json(const Outcome& outcome) {
  const tv_two_view& v = outcome.two_view;
  const tv_reconstruction& r = outcome.reconstruction;
  Json json;
  json["image0"] = outcome.picture[0].name;
  json["image1"] = outcome.picture[1].name;
  json["image_size0"] = {outcome.picture[0].luma.cols, outcome.picture[0].luma.rows};
  json["image_size1"] = {outcome.picture[1].luma.cols, outcome.picture[1].luma.rows};
  json["num_keypoints"] = {r.num_keypoints[0], r.num_keypoints[1]};
  json["effort"] = r.effort;
  json["num_still_matches"] = v.num_still;
  json["masked_share"] = {masked_share(outcome.picture[0].mask),
                          masked_share(outcome.picture[1].mask)};
  json["num_matches"] = r.num_matches;
  json["num_matches_left_out"] = r.num_matches_left_out;
  json["num_inliers"] = v.num_inliers;
  json["config"] = tv_kind_string(static_cast<tv_kind>(v.kind));
  json["verdict"] = tv_verdict_string(static_cast<tv_verdict>(v.verdict));
  json["reasons"] = reasons_json(v.reasons);
  json["advice"] = advice_on(outcome);
  json["probability_wrong"] = finite_or_null(v.probability_wrong);
  json["R"] = numbers_or_null(v.R, 9, v.has_R);
  const double unit = unit_of(outcome);
  const double t[3] = {unit * v.t[0], unit * v.t[1], unit * v.t[2]};
  json["t"] = numbers_or_null(t, 3, v.has_t);
  json["E"] = numbers_or_null(v.E, 9, v.has_E);
  json["F"] = numbers_or_null(v.F, 9, v.has_F);
  json["H"] = numbers_or_null(v.H, 9, v.has_H);
  json["alternative"] = nullptr;
  const double other_t[3] = {unit * v.alternative_t[0], unit * v.alternative_t[1],
                             unit * v.alternative_t[2]};
  if (v.has_alternative)
    json["alternative"] = {{"R", numbers_or_null(v.alternative_R, 9, true)},
                           {"t", numbers_or_null(other_t, 3, true)},
                           {"covariance", numbers_or_null(v.alternative_covariance, 25,
                                                          v.has_alternative_covariance)}};
  const tv_evidence& e = outcome.evidence;
  json["evidence"] = {{"essential", count_or_null(e.essential_inliers)},
                      {"fundamental", count_or_null(e.fundamental_inliers)},
                      {"homography", count_or_null(e.homography_inliers)},
                      {"rotation", count_or_null(e.rotation_inliers)},
                      {"coverage", finite_or_null(e.coverage)}};
  json["covariance"] = covariance_json(v);
  json["noise_px"] = v.noise_px > 0 ? finite_or_null(v.noise_px) : Json(nullptr);
  json["principal_point_shift_px"] =
      numbers_or_null(v.principal_point_shift, 2, outcome.has_cameras);
  json["principal_point"] = outcome.has_cameras ? principal_point_json(outcome) : Json(nullptr);
  json["focal_length"] = focal_length_json(v);
  json["camera_misfit"] = camera_misfit_json(e);
  const double scale = magnification(outcome);
  json["magnification"] = scale > 0 ? finite_or_null(scale) : Json(nullptr);
  json["num_points"] = r.num_points;
  json["num_dense_points"] = outcome.dense ? Json(outcome.dense->size()) : Json(nullptr);
  json["dense_sigma_median_percent"] = finite_or_null(dense_sigma_percent(outcome));
  json["dense_pose_sigma_median_percent"] = finite_or_null(dense_pose_sigma_percent(outcome));
  json["median_parallax_deg"] = v.num_inliers > 0 && outcome.has_cameras
                                    ? finite_or_null(v.median_parallax_rad * kDegrees)
                                    : Json(nullptr);
  json["rms_reprojection_px"] = finite_or_null(rms_reprojection_px(r));
  json["scale"] = outcome.scale ? "metric" : "unit";
  json["scale_sigma"] = outcome.scale ? Json(outcome.scale->sigma_m) : Json(nullptr);
  json["imu"] = nullptr;
  json["truth"] = nullptr;
  json["num_iterations"] = v.num_iterations;
  json["seed"] = v.seed;
  json["version"] = tv_version_string();
  return json;
}

std::string verdict_in_words(const tv_two_view& v) {
  if (v.verdict == TV_VERDICT_OK && !has_full_pose(v))
    return v.has_R ? "rotation ok, no full pose" : "matches ok, no pose";
  return tv_verdict_string(static_cast<tv_verdict>(v.verdict));
}

double magnification(const Outcome& outcome) {
  constexpr size_t fewest = 20;
  constexpr double far_px = 20;
  constexpr double widest = 1.5;  // upper quartile over lower one
  const tv_reconstruction& r = outcome.reconstruction;
  std::vector<tv_correspondence> inliers;
  for (int32_t i = 0; i < r.num_matches; ++i)
    if (r.inlier_mask[i]) inliers.push_back(r.matches[i]);
  const auto distance = [&](size_t image, const tv_correspondence& a, const tv_correspondence& b) {
    const tv_keypoint& p = r.keypoints[image][image == 0 ? a.idx0 : a.idx1];
    const tv_keypoint& q = r.keypoints[image][image == 0 ? b.idx0 : b.idx1];
    return std::hypot(static_cast<double>(p.x) - q.x, static_cast<double>(p.y) - q.y);
  };
  std::vector<double> ratios;
  for (size_t i = 0; i < inliers.size(); ++i) {
    const tv_correspondence &a = inliers[i],
                            &b = inliers[(i + inliers.size() / 2) % inliers.size()];
    const double before = distance(0, a, b), after = distance(1, a, b);
    if (before > far_px && after > 0) ratios.push_back(after / before);
  }
  if (ratios.size() < fewest) return 0;
  if (percentile(ratios, 0.75) > widest * percentile(ratios, 0.25)) return 0;
  const double focal = outcome.has_cameras ? outcome.camera[1].fx / outcome.camera[0].fx
                                           : static_cast<double>(outcome.picture[1].luma.cols) /
                                                 outcome.picture[0].luma.cols;
  return percentile(ratios, 0.5) / focal;
}

std::string reasons_in_words(const Outcome& outcome) {
  std::string text;
  for (const Phrase& phrase : phrases_of(outcome))
    text += (text.empty() ? "" : "; ") + phrase.words;
  return text;
}

std::vector<std::string> advice_on(const Outcome& outcome) {
  std::vector<std::string> advice;
  for (const Phrase& phrase : phrases_of(outcome)) advice.push_back(phrase.advice);
  constexpr uint32_t kWantsMatches =
      TV_REASON_TOO_FEW_MATCHES | TV_REASON_LOW_INLIER_RATIO | TV_REASON_CROWDED_MATCHES;
  if (!outcome.tried_hardest && (outcome.two_view.reasons & kWantsMatches) != 0)
    advice.emplace_back("let the program try harder: --effort auto");
  return advice;
}

Uncertainty uncertainty_deg(const tv_two_view& v) {
  const double* c = v.covariance;
  return {std::sqrt(c[0] + c[6] + c[12]) * kDegrees, std::sqrt(c[18] + c[24]) * kDegrees};
}

std::string sigma_in_words(double sigma_deg) {
  if (sigma_deg > 90) return "above 90";
  char text[40];
  std::snprintf(text, sizeof text, "%.3f", sigma_deg);
  return text;
}

std::string kind_in_words(int32_t kind) {
  switch (kind) {
    case TV_KIND_CALIBRATED: return "a general scene, full pose";
    case TV_KIND_UNCALIBRATED: return "fundamental matrix only, no cameras";
    case TV_KIND_PLANAR: return "a plane";
    case TV_KIND_PANORAMIC: return "rotation only";
    case TV_KIND_PLANAR_OR_PANORAMIC: return "a homography: a plane or a rotation";
    case TV_KIND_NO_MOTION: return "no motion";
    default: return "no model explains the matches better than chance";
  }
}

Json finite_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

std::string json_text(const Json& json) {
  std::string text;
  append_json(text, json, 0);
  return text + "\n";
}

}  // namespace cli
