// Functions of the command-line program that can be called directly. Objects with destructors are
// used only inside functions that return plain values, since Unity leaves a failing test by
// longjmp, which skips destructors.

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "base/error.h"
#include "base/upright.h"
#include "files/camera_formats.h"
#include "files/camera_set.h"
#include "files/image_header.h"
#include "files/matches_file.h"
#include "files/name_dates.h"
#include "files/pairs_file.h"
#include "odometry/combed_rows.h"
#include "odometry/flight.h"
#include "odometry/outputs.h"
#include "odometry/path_order.h"
#include "odometry/repeated_pictures.h"
#include "odometry/truth_doubts.h"
#include "odometry/two_eyes.h"
#include "pair/camera_advice.h"
#include "pair/measures.h"
#include "pair/options.h"
#include "pair/pose_readings.h"
#include "pair/result.h"
#include "pictures/canvas.h"
#include "report/report.h"
#include "report/tables.h"
#include "sources/joined_films.h"
#include "sources/stream_clock.h"

// unity.h comes after all other headers: it defines isnan and isinf as macros.
#include "unity.h"

using namespace cli;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

double auc_of(std::initializer_list<double> errors, double threshold) {
  return auc_percent(errors, threshold);
}

void test_auc_is_the_area_under_straight_lines_of_recall() {
  TEST_ASSERT_EQUAL_DOUBLE(0, auc_of({}, 5));
  TEST_ASSERT_EQUAL_DOUBLE(100, auc_of({0, 0, 0}, 5));
  TEST_ASSERT_EQUAL_DOUBLE(0, auc_of({kInfinity, 7}, 5));
  TEST_ASSERT_EQUAL_DOUBLE(0, auc_of({5}, 5));
  // Recall rises from (0, 0) to (2, 1/2) and (4, 1) and is level to 5: the area is 0.5 + 1.5 + 1 =
  // 3 of 5.
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 60, auc_of({4, 2}, 5));
  // One of two pairs fails: 0.5 * (1 * 0.5) + 4 * 0.5 = 2.25 of 5.
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 45, auc_of({1, kInfinity}, 5));
}

void test_percentile_lies_between_its_neighbours() {
  TEST_ASSERT_EQUAL_DOUBLE(3, percentile({3}, 0.95));
  TEST_ASSERT_EQUAL_DOUBLE(2.5, percentile({4, 1, 3, 2}, 0.5));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 3.85, percentile({4, 1, 3, 2}, 0.95));
  TEST_ASSERT_EQUAL_DOUBLE(4, percentile({4, 1, 3, 2}, 1));
}

// exp([w]x) R, by Rodrigues' formula.
Matrix3 turned_by(const Vector3& w, const Matrix3& R) {
  const double angle = norm(w);
  if (angle == 0) return R;
  const Matrix3 K = {0, -w[2] / angle, w[1] / angle,  w[2] / angle,
                     0, -w[0] / angle, -w[1] / angle, w[0] / angle,
                     0};
  const Matrix3 KK = product(K, K);
  Matrix3 turn = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (size_t i = 0; i < 9; ++i) turn[i] += std::sin(angle) * K[i] + (1 - std::cos(angle)) * KK[i];
  return product(turn, R);
}

double angle_between(const Vector3& a, const Vector3& b) {
  return std::acos(dot(a, b) / (norm(a) * norm(b)));
}

// The distance of a point from camera 0 by the sine rule, of a ray of each camera in its own frame.
double distance_of(const Matrix3& R, const Vector3& t, const Vector3& ray0, const Vector3& ray1) {
  const Vector3 backward = applied(transposed(R), t);
  const Vector3 base = {-backward[0], -backward[1], -backward[2]};
  const double angle0 = angle_between(ray0, base);
  const double angle1 = angle_between(applied(transposed(R), ray1), base);
  return norm(base) * std::sin(angle1) / std::sin(angle1 - angle0);
}

// The pose's covariance, carried to a distance, is that of differences of the distance.
void test_a_distance_has_the_sigma_that_the_pose_gives_it() {
  tv_two_view v;
  tv_two_view_init(&v);
  const Matrix3 R = turned_by({0.1, -0.2, 0.05}, {1, 0, 0, 0, 1, 0, 0, 0, 1});
  std::copy(R.begin(), R.end(), v.R);
  const Vector3 t = {-0.9, 0.3, std::sqrt(1 - 0.81 - 0.09)};
  std::copy(t.begin(), t.end(), v.t);
  const Vector3 point = {0.4, -0.3, 5};
  TEST_ASSERT_EQUAL_DOUBLE(0, distance_sigma_of_pose(v, point));  // without a covariance
  v.has_covariance = 1;
  double factor[5][5];  // the covariance is F F^T
  for (int i = 0; i < 5; ++i)
    for (int k = 0; k < 5; ++k) factor[i][k] = 1e-3 * std::sin(1 + 7 * i + 3 * k * k);
  for (int i = 0; i < 5; ++i)
    for (int k = 0; k < 5; ++k) {
      double sum = 0;
      for (int n = 0; n < 5; ++n) sum += factor[i][n] * factor[k][n];
      v.covariance[5 * i + k] = sum;
    }
  const Vector3 at0 = applied(R, point), ray1 = {at0[0] + t[0], at0[1] + t[1], at0[2] + t[2]};
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, norm(point), distance_of(R, t, point, ray1));
  // The smallest |t_k| is the second: b1 = normalise(e_1 x t), b2 = t x b1.
  const double length = std::sqrt(t[0] * t[0] + t[2] * t[2]);
  const Vector3 b1 = {t[2] / length, 0, -t[0] / length}, b2 = cross(t, b1);
  double variance = 0;
  for (int n = 0; n < 5; ++n) {  // along each column of F
    double ends[2];
    for (int end = 0; end < 2; ++end) {
      const double h = end ? 1e-3 : -1e-3;
      Vector3 moved = t;
      for (size_t i = 0; i < 3; ++i) moved[i] += h * (factor[3][n] * b1[i] + factor[4][n] * b2[i]);
      const double size = norm(moved);
      for (double& part : moved) part /= size;
      const Vector3 w = {h * factor[0][n], h * factor[1][n], h * factor[2][n]};
      ends[end] = distance_of(turned_by(w, R), moved, point, ray1);
    }
    const double slope = (ends[1] - ends[0]) / 2e-3;
    variance += slope * slope;
  }
  const double expected = std::sqrt(variance);
  TEST_ASSERT_TRUE(expected > 0.001);
  TEST_ASSERT_DOUBLE_WITHIN(1e-4 * expected, expected, distance_sigma_of_pose(v, point));
}

// Whether the advice on a pose of low parallax is to calibrate, and not to move farther.
bool calibrates(double focal_sigma, double parallax_rad) {
  Outcome outcome;
  tv_two_view& v = outcome.two_view;
  tv_two_view_init(&v);
  v.reasons = TV_REASON_LOW_PARALLAX;
  v.focal_sigma = focal_sigma;
  v.median_parallax_rad = parallax_rad;
  const std::vector<std::string> advice = advice_on(outcome);
  return advice.size() == 1 && advice[0].find("calibrate") != std::string::npos;
}

void test_a_pose_that_an_uncertain_focal_length_leaves_open_asks_for_a_calibration() {
  TEST_ASSERT_TRUE(calibrates(0.1, 0.5));
  TEST_ASSERT_FALSE(calibrates(0.1, 0.01));
  TEST_ASSERT_FALSE(calibrates(0.01, 0.5));
  TEST_ASSERT_FALSE(calibrates(0, 0.5));
}

// The advice on a reason, for two images of these widths whose cameras are not from files.
std::string advice_without_files(tv_reason reason, int width0, int width1) {
  Outcome outcome;
  tv_two_view& v = outcome.two_view;
  tv_two_view_init(&v);
  v.reasons = reason;
  v.focal_sigma = 0.1;
  v.median_parallax_rad = 0.5;
  outcome.has_cameras = true;
  outcome.camera[0].width = width0;
  outcome.camera[1].width = width1;
  return advice_on(outcome).at(0);
}

bool holds(const std::string& text, const char* words) {
  return text.find(words) != std::string::npos;
}

void test_the_advice_without_a_camera_file_names_none() {
  const auto few = [] { return advice_without_files(TV_REASON_LOW_INLIER_RATIO, 640, 640); };
  TEST_ASSERT_FALSE(holds(few(), "camera file"));
  TEST_ASSERT_TRUE(holds(few(), "more overlap"));
  const auto focal = [](int width1) {
    return advice_without_files(TV_REASON_LOW_PARALLAX, 640, width1);
  };
  TEST_ASSERT_FALSE(holds(focal(640), "one size"));
  TEST_ASSERT_TRUE(holds(focal(480), "one size"));
}

double focal_change_of(double scale) {
  tv_two_view v;
  tv_two_view_init(&v);
  v.focal_scale = scale;
  return focal_change_percent(v);
}

void test_a_focal_length_that_hardly_changed_has_no_sign() {
  TEST_ASSERT_FALSE(std::signbit(focal_change_of(0.99999)));
  TEST_ASSERT_EQUAL_DOUBLE(0, focal_change_of(0.99999));
  TEST_ASSERT_EQUAL_DOUBLE(0, focal_change_of(0));
  TEST_ASSERT_EQUAL_DOUBLE(-1.3, focal_change_of(0.98701));
}

void test_a_sigma_of_which_nothing_is_known_is_no_number() {
  const auto words = [](double sigma) { return sigma_in_words(sigma); };
  TEST_ASSERT_TRUE(words(0.13349) == "0.133");
  TEST_ASSERT_TRUE(words(90) == "90.000");
  TEST_ASSERT_TRUE(words(310.1) == "above 90");
}

void test_each_reason_has_words_and_advice_and_no_reason_none() {
  Outcome outcome;
  tv_two_view_init(&outcome.two_view);
  TEST_ASSERT_TRUE(reasons_in_words(outcome).empty() && advice_on(outcome).empty());
  for (uint32_t bit = 1; bit <= TV_REASON_CAMERA_CONTRADICTED; bit *= 2) {
    outcome.two_view.reasons = bit;
    TEST_ASSERT_FALSE(reasons_in_words(outcome).empty());
    TEST_ASSERT_EQUAL_UINT(1, advice_on(outcome).size());
  }
}

// The words for the reason "a second motion" of 100 matches, of which the first `num_inliers` are
// right and show the scene of image 1 at this scale, and all others at 0.1.
std::string words_at_scale(float scale, tv_verdict verdict, int num_inliers) {
  constexpr int count = 100;
  std::vector<tv_keypoint> keypoints[2] = {std::vector<tv_keypoint>(count),
                                           std::vector<tv_keypoint>(count)};
  std::vector<tv_correspondence> matches(count);
  std::vector<uint8_t> mask(count);
  for (int32_t i = 0; i < count; ++i) {
    const auto k = static_cast<size_t>(i);
    keypoints[0][k].x = static_cast<float>(37 * i % 101);
    keypoints[0][k].y = static_cast<float>(53 * i % 97);
    mask[k] = i < num_inliers;
    const float factor = mask[k] ? scale : 0.1f;
    keypoints[1][k].x = factor * keypoints[0][k].x + 5;
    keypoints[1][k].y = factor * keypoints[0][k].y - 3;
    matches[k].idx0 = matches[k].idx1 = i;
  }
  Outcome outcome;
  outcome.has_cameras = true;
  outcome.camera[0].fx = outcome.camera[1].fx = 500;
  tv_two_view_init(&outcome.two_view);
  outcome.two_view.verdict = verdict;
  outcome.two_view.reasons = TV_REASON_SECOND_MOTION;
  for (size_t i = 0; i < 2; ++i) outcome.reconstruction.keypoints[i] = keypoints[i].data();
  outcome.reconstruction.matches = matches.data();
  outcome.reconstruction.inlier_mask = mask.data();
  outcome.reconstruction.num_matches = count;
  return reasons_in_words(outcome);
}

bool words_name_scale(float scale, tv_verdict verdict, int num_inliers = 80) {
  const std::string words = words_at_scale(scale, verdict, num_inliers);
  const bool scale_named = words.find("scale") != std::string::npos;
  const bool motion_named = words.find("second motion") != std::string::npos;
  return scale_named && !motion_named;
}

void test_a_zoomed_pair_is_told_of_its_scale_and_of_no_second_motion() {
  TEST_ASSERT_TRUE(words_name_scale(1.6f, TV_VERDICT_DOUBTFUL));
  TEST_ASSERT_TRUE(words_name_scale(0.5f, TV_VERDICT_REFUSED));
  TEST_ASSERT_FALSE(words_name_scale(1.1f, TV_VERDICT_DOUBTFUL));
  TEST_ASSERT_FALSE(words_name_scale(0.9f, TV_VERDICT_DOUBTFUL));
}

void test_the_scale_is_of_the_inliers_and_not_of_what_the_geometry_rejects() {
  const std::string words = words_at_scale(3.5f, TV_VERDICT_DOUBTFUL, 30);
  TEST_ASSERT_NOT_NULL(std::strstr(words.c_str(), "image 1 shows the scene at 3.50 times"));
  TEST_ASSERT_FALSE(words_name_scale(3.5f, TV_VERDICT_REFUSED, 0));
  TEST_ASSERT_FALSE(words_name_scale(3.5f, TV_VERDICT_DOUBTFUL, 12));
}

// What `advise` says of pairs that ask for (x, y) + spread (1, 0), (-1, 0), (1, 0) ..., `asking` of
// them beyond the 99.9 % point and the others just below it.
CameraAdvice advice_of(int num, int asking, double x, double y, double spread) {
  std::vector<ShiftEvidence> pairs;
  for (int i = 0; i < num; ++i) {
    const double chi2 = i < asking ? 13.82 : 13.81;
    pairs.push_back({tv_camera{}, chi2, {x + (i % 2 == 0 ? spread : -spread), y}});
  }
  return advise(pairs).at(0);
}

void test_pairs_that_agree_on_a_shift_ask_for_a_calibration() {
  const CameraAdvice advice = advice_of(26, 24, -10, 4, 3);
  TEST_ASSERT_TRUE(advice.calibrate_again);
  TEST_ASSERT_EQUAL_INT(26, advice.num_pairs);
  TEST_ASSERT_EQUAL_INT(24, advice.num_asking);
  TEST_ASSERT_EQUAL_DOUBLE(-10, advice.asked_px[0]);
  TEST_ASSERT_EQUAL_DOUBLE(4, advice.asked_px[1]);
  TEST_ASSERT_EQUAL_DOUBLE(3, advice.deviation_px);
  TEST_ASSERT_TRUE(advice_of(8, 5, -10, 4, 3).calibrate_again);
}

void test_pairs_that_are_few_or_do_not_agree_ask_for_nothing() {
  TEST_ASSERT_FALSE(advice_of(7, 7, -10, 4, 3).calibrate_again);
  TEST_ASSERT_FALSE(advice_of(8, 4, -10, 4, 3).calibrate_again);
  TEST_ASSERT_FALSE(advice_of(8, 0, -10, 4, 3).calibrate_again);
  TEST_ASSERT_TRUE(advice_of(26, 26, -10, 0, 4.99).calibrate_again);
  TEST_ASSERT_FALSE(advice_of(26, 26, -10, 0, 5.01).calibrate_again);
  TEST_ASSERT_TRUE(advise({}).empty());
}

void test_each_camera_gets_its_own_advice() {
  tv_camera cameras[2] = {};
  cameras[1].cx = 1;
  std::vector<ShiftEvidence> pairs;
  for (int i = 0; i < 20; ++i)
    pairs.push_back({cameras[i % 2], i % 2 == 0 ? 50.0 : 1.0, {i % 2 == 0 ? 9.0 : -9.0, 0}});
  const std::vector<CameraAdvice> advice = advise(pairs);
  TEST_ASSERT_EQUAL_INT(2, static_cast<int>(advice.size()));
  TEST_ASSERT_TRUE(advice[0].calibrate_again && advice[0].camera.cx == 0);
  TEST_ASSERT_TRUE(!advice[1].calibrate_again && advice[1].camera.cx == 1);
  TEST_ASSERT_TRUE(advice[0].num_pairs == 10 && advice[0].asked_px[0] == 9);
}

void test_a_result_without_evidence_says_nothing() {
  tv_evidence evidence{};
  TEST_ASSERT_FALSE(shift_evidence(evidence, tv_camera{}).has_value());
  evidence.principal_point_asked_covariance[0] = 2;
  evidence.principal_point_asked_px[1] = 3;
  TEST_ASSERT_TRUE(shift_evidence(evidence, tv_camera{})->asked_px[1] == 3);
}

Matrix3 turn_about_y(double angle) {
  return {std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle), 0, std::cos(angle)};
}

void test_rotation_error_is_exact_from_tiny_to_half_a_turn() {
  const Matrix3 identity = turn_about_y(0);
  for (const double deg : {1e-9, 1e-3, 1.0, 90.0, 179.999, 180.0})
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * (1 + deg), deg,
                              rotation_error_deg(turn_about_y(deg * M_PI / 180), identity));
}

void test_translation_error_forgets_the_sign_only_when_asked() {
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 180, translation_error_signed_deg({1, 0, 0}, {-2, 0, 0}));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, translation_error_deg({1, 0, 0}, {-2, 0, 0}));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 45, translation_error_deg({-1, 1, 0}, {3, 0, 0}));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 45, translation_error_deg({-1, 0, 0}, {1e308, 1e308, 0}));
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 45, translation_error_deg({-1, 0, 0}, {1e-300, 1e-300, 0}));
  TEST_ASSERT_TRUE(translation_error_deg({0, 0, 0}, {1, 0, 0}) == kInfinity);
}

tv_camera lens() {
  tv_camera camera{};
  camera.model = TV_CAMERA_BROWN_CONRADY;
  camera.width = 640;
  camera.height = 480;
  camera.fx = 500;
  camera.fy = 510;
  camera.cx = 310;
  camera.cy = 250;
  const double k[] = {-0.2, 0.05, 0.004, -0.003, 0.01};
  std::copy(k, k + 5, camera.k);
  return camera;
}

void test_a_resized_camera_keeps_pixel_areas() {
  const tv_camera half = resized(lens(), 320, 240);
  TEST_ASSERT_EQUAL_DOUBLE(250, half.fx);
  TEST_ASSERT_EQUAL_DOUBLE(255, half.fy);
  TEST_ASSERT_EQUAL_DOUBLE(154.75, half.cx);
  TEST_ASSERT_EQUAL_DOUBLE(124.75, half.cy);
  TEST_ASSERT_EQUAL_INT(320, half.width);
}

void test_a_turned_camera_sees_the_turned_point_at_the_turned_pixel() {
  const tv_camera camera = lens();
  double point[3] = {0.3, -0.2, 1.1}, pixel[2];
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, point, pixel, nullptr));
  double width = camera.width, height = camera.height;
  for (int quarters = 1; quarters <= 4; ++quarters) {
    const double turned_pixel[] = {pixel[1], width - 1 - pixel[0]};
    const double turned_point[] = {point[1], -point[0], point[2]};
    std::memcpy(pixel, turned_pixel, sizeof pixel);
    std::memcpy(point, turned_point, sizeof point);
    std::swap(width, height);
    const tv_camera other = turned(camera, quarters);
    double seen[2];
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&other, point, seen, nullptr));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, pixel[0], seen[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, pixel[1], seen[1]);
  }
}

tv_camera parsed_camera(const char* distortion) {
  return parse_camera(std::string("%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
                                  "camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n"
                                  "  data: [ 5.0e+02, 0., 310., 0., +510., 250.5, 0., 0., 1. ]\n") +
                          distortion,
                      "cam.yaml");
}

void test_camera_files_give_the_numbers_and_the_model() {
  const tv_camera plain = parsed_camera("");
  TEST_ASSERT_EQUAL_INT(TV_CAMERA_PINHOLE, plain.model);
  TEST_ASSERT_EQUAL_DOUBLE(500, plain.fx);
  TEST_ASSERT_EQUAL_DOUBLE(510, plain.fy);
  TEST_ASSERT_EQUAL_DOUBLE(310, plain.cx);
  TEST_ASSERT_EQUAL_DOUBLE(250.5, plain.cy);
  const tv_camera rational =
      parsed_camera("distortion_coefficients: {data: [1e-3, 2, 3, 4, 5, 6, 7, 8]}\n");
  TEST_ASSERT_EQUAL_INT(TV_CAMERA_BROWN_CONRADY, rational.model);
  TEST_ASSERT_EQUAL_DOUBLE(1e-3, rational.k[0]);
  TEST_ASSERT_EQUAL_DOUBLE(8, rational.k[7]);
  const tv_camera fisheye = parsed_camera(
      "distortion_model: equidistant\ndistortion_coefficients: {rows: 1, data: [0, 0, 0, 0]}\n");
  TEST_ASSERT_EQUAL_INT(TV_CAMERA_KANNALA_BRANDT, fisheye.model);
}

// The fx of the entry of a cameras.yaml that is chosen for an image and the fx and cx of its pair's
// line; 0 when none is.
double chosen_fx(const char* image, double fx, double cx) {
  const NamedCameras cameras = parse_camera_set(
      "cam: {image_width: 8, image_height: 8, fx: 1, fy: 1, cx: 1, cy: 1}\n"
      "cam1: {image_width: 8, image_height: 8, fx: 2, fy: 2, cx: 2, cy: 2, k1: 0.1}\n",
      "cameras.yaml");
  const double K[9] = {fx, 0, cx, 0, fx, 0, 0, 0, 1};
  const tv_camera* camera = choose_camera(cameras, image, K);
  return camera ? camera->fx : 0;
}

void test_the_longest_name_that_begins_the_files_name_serves_it() {
  TEST_ASSERT_EQUAL_DOUBLE(1, chosen_fx("cam0_7.png", 2, 2));
  TEST_ASSERT_EQUAL_DOUBLE(2, chosen_fx("folder/cam1_7.png", 1, 1));
  TEST_ASSERT_EQUAL_DOUBLE(2, chosen_fx("left.png", 2, 2));
  TEST_ASSERT_EQUAL_DOUBLE(0, chosen_fx("left.png", 2, 1));
}

void test_an_images_camera_has_the_lines_K_and_the_entrys_lens_and_size() {
  const NamedCameras cameras = parse_camera_set(
      "cam: {image_width: 8, image_height: 6, fx: 8.5, fy: 7, cx: 4, cy: 2.5, k1: 0.1}\n", "c");
  const std::array<double, 9> K = {9, 0, 4, 0, 7, 3, 0, 0, 1};
  const tv_camera camera = camera_of_image(cameras, "a.png", 8, 6, &K);
  TEST_ASSERT_EQUAL_DOUBLE(9, camera.fx);
  TEST_ASSERT_EQUAL_DOUBLE(7, camera.fy);
  TEST_ASSERT_EQUAL_DOUBLE(4, camera.cx);
  TEST_ASSERT_EQUAL_DOUBLE(3, camera.cy);
  TEST_ASSERT_EQUAL_DOUBLE(0.1, camera.k[0]);
  TEST_ASSERT_EQUAL_DOUBLE(8.5, camera_of_image(cameras, "a.png", 8, 6, nullptr).fx);
  const tv_camera pinhole = camera_of_image({}, "a.png", 8, 6, &K);
  TEST_ASSERT_EQUAL_INT(TV_CAMERA_PINHOLE, pinhole.model);
  TEST_ASSERT_EQUAL_INT(8, pinhole.width);
  const auto is_refused = [&](const NamedCameras& set, int width, const auto* of_line) {
    try {
      camera_of_image(set, "a.png", width, 6, of_line);
    } catch (const BadInput&) {
      return true;
    }
    return false;
  };
  const std::array<double, 9>* const none = nullptr;
  TEST_ASSERT_TRUE(is_refused(cameras, 9, &K));  // no camera has this image size
  TEST_ASSERT_TRUE(is_refused({}, 8, none));     // no camera and no K is given
  const std::array<double, 9> K_of_half = {4.5, 0, 1.75, 0, 3.5, 1.25, 0, 0, 1};
  TEST_ASSERT_TRUE(is_refused({}, 8, &K_of_half));
  TEST_ASSERT_TRUE(is_refused(cameras, 8, &K_of_half));
}

// The number of pairs that a text holds, or minus the length of the message that refuses it.
int parsed_pairs(const std::string& text) {
  try {
    return static_cast<int>(parse_pairs(text, "p").size());
  } catch (const BadInput& e) {
    return -static_cast<int>(std::strlen(e.what()));
  }
}

void test_pairs_lines_have_two_four_twenty_two_or_thirty_eight_fields() {
  const std::string K = " 9 0 4 0 9 4 0 0 1", T = " 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1";
  TEST_ASSERT_EQUAL_INT(1, parsed_pairs("a b"));
  TEST_ASSERT_EQUAL_INT(2, parsed_pairs("  \r\n# x\na b 0 3\n\na b 0 0" + K + K + "\n"));
  TEST_ASSERT_EQUAL_INT(1, parsed_pairs("a b 0 0" + K + K + T + "\r\n"));
  TEST_ASSERT_LESS_THAN_INT(0, parsed_pairs("a b 0 0" + K + K + T + " 1"));
  TEST_ASSERT_LESS_THAN_INT(0, parsed_pairs("a b 0.5 0"));
  TEST_ASSERT_LESS_THAN_INT(0, parsed_pairs(""));
}

// Reads the header of every prefix of the bytes, at last of the whole. Returns width * 1e6 + height
// of the whole, negated when the reader reports the whole as truncated.
double header_of(const std::string& bytes) {
  ImageHeader header;
  for (size_t length = 0; length <= bytes.size(); ++length) {
    // a copy of exactly this length, so that the sanitizer sees a read beyond it
    const std::string prefix = bytes.substr(0, length);
    header = read_image_header(prefix);
  }
  const double size = static_cast<double>(header.width) * 1e6 + static_cast<double>(header.height);
  return header.truncated ? -size : size;
}

void test_headers_are_read_within_their_bytes() {
  using namespace std::string_literals;
  const std::string png = "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\1\2\0\0\0\7\b\0\0\0\0CCCC"s;
  TEST_ASSERT_EQUAL_DOUBLE(-258e6 - 7, header_of(png));
  TEST_ASSERT_EQUAL_DOUBLE(258e6 + 7, header_of(png + "\0\0\0\0IENDCCCC"s));
  const std::string jpeg =
      "\xff\xd8\xff\xe0\0\4xx\xff\xc2\0\x0b\b\0\7\1\2\1\1\x11\0\xff\xda\0\2dd"s;
  TEST_ASSERT_EQUAL_DOUBLE(-258e6 - 7, header_of(jpeg));
  TEST_ASSERT_EQUAL_DOUBLE(258e6 + 7, header_of(jpeg + "\xff\xd9"s));
  TEST_ASSERT_EQUAL_DOUBLE(2e6 + 3, header_of("P5 #c\n2 3\n255\n123456"));
  TEST_ASSERT_EQUAL_DOUBLE(-2e6 - 3, header_of("P6 2 3 255\n12345678901234567"));
  TEST_ASSERT_EQUAL_DOUBLE(7e6 + 9, header_of("BM............\x28\0\0\0\7\0\0\0\xf7\xff\xff\xff"s));
  TEST_ASSERT_EQUAL_DOUBLE(
      5e6 + 6, header_of("II*\0\b\0\0\0\2\0\0\1\3\0\1\0\0\0\5\0\0\0\1\1\4\0\1\0\0\0\6\0\0\0"s));
  TEST_ASSERT_EQUAL_DOUBLE(0, header_of("GIF89a whatever follows"));
}

bool base64_is(const char* bytes, const char* expected) { return base64(bytes) == expected; }

// Of a TIFF file of two pages: a width each, and what the second one is (tag 254).
bool second_page_counts(char kind, char next = 0) {
  using namespace std::string_literals;
  const std::string head = "II*\0\b\0\0\0\1\0\0\1\3\0\1\0\0\0\5\0\0\0\x1a\0\0\0"s;
  const std::string second =
      "\2\0\xfe\0\4\0\1\0\0\0"s + kind + "\0\0\0\0\1\3\0\1\0\0\0\5\0\0\0"s + next + "\0\0\0"s;
  return read_image_header(head + second).has_more;
}

bool is_animated(const std::string& bytes) { return read_image_header(bytes).has_more; }

void test_files_of_several_pictures_are_known() {
  using namespace std::string_literals;
  TEST_ASSERT_TRUE(second_page_counts(0));
  TEST_ASSERT_TRUE(second_page_counts(2));         // a page of several
  TEST_ASSERT_FALSE(second_page_counts(1));        // a smaller one of the first
  TEST_ASSERT_FALSE(second_page_counts(4));        // its mask
  TEST_ASSERT_FALSE(second_page_counts(1, 0x1a));  // a circle of pages comes to an end
  const std::string png = "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\1\2\0\0\0\7\b\0\0\0\0CCCC"s;
  const std::string end = "\0\0\0\0CCCC\0\0\0\0IENDCCCC"s;
  TEST_ASSERT_FALSE(is_animated(png + end));
  TEST_ASSERT_FALSE(is_animated(png +
                                "\0\0\0\x08"
                                "acTL\0\0\0\1"s +
                                end));
  TEST_ASSERT_TRUE(is_animated(png +
                               "\0\0\0\x08"
                               "acTL\0\0\0\2"s +
                               end));
  TEST_ASSERT_FALSE(is_animated("RIFF....WEBPVP8X\x0a\0\0\0\x10\0\0\0........"s));
  TEST_ASSERT_TRUE(is_animated("RIFF....WEBPVP8X\x0a\0\0\0\x12\0\0\0........"s));
}

bool is_joined(const std::string& bytes) {
  char name[] = "/tmp/twoview_joined_XXXXXX";
  const int file = mkstemp(name);
  const bool is_written = write(file, bytes.data(), bytes.size()) == ssize_t(bytes.size());
  close(file);
  const bool found = is_written && is_joined_film(name);
  unlink(name);
  return found;
}

void test_films_that_were_joined_as_bytes_are_known() {
  using namespace std::string_literals;
  const std::string avi = "RIFF\7\0\0\0AVI xyz\0"s, more = "RIFF\4\0\0\0AVIX"s;
  const std::string mp4 =
      "\0\0\0\x0c"
      "ftypisom"
      "\0\0\0\x08"
      "moov"
      "\0\0\0\1"
      "mdat\0\0\0\0\0\0\0\x12"
      "xx"s;
  const std::string flv =
      "FLV\1\5\0\0\0\x09\0\0\0\0"
      "\x09\0\0\3\0\0\0\0\0\0\0xyz\0\0\0\x0e"s;
  for (const std::string& film : {avi, mp4, flv}) {
    TEST_ASSERT_FALSE(is_joined(film));
    TEST_ASSERT_TRUE(is_joined(film + film));
    TEST_ASSERT_FALSE(is_joined(film + "something else"));
  }
  TEST_ASSERT_FALSE(is_joined(avi + more));
  TEST_ASSERT_TRUE(is_joined(avi + more + avi));
  TEST_ASSERT_FALSE(is_joined(mp4 +
                              "\0\0\0\0"
                              "mdat"s +
                              mp4));  // data up to the end
  TEST_ASSERT_FALSE(is_joined(""));
}

void test_base64_has_the_vectors_of_rfc_4648() {
  TEST_ASSERT_TRUE(base64_is("", ""));
  TEST_ASSERT_TRUE(base64_is("f", "Zg=="));
  TEST_ASSERT_TRUE(base64_is("fo", "Zm8="));
  TEST_ASSERT_TRUE(base64_is("foo", "Zm9v"));
  TEST_ASSERT_TRUE(base64_is("foobar", "Zm9vYmFy"));
}

bool csv_is(const tv_keypoint& keypoint, const char* row) {
  return keypoints_csv(&keypoint, 1) == "x,y,size,angle_rad,score,level\n" + std::string(row);
}

void test_csv_numbers_are_the_shortest_that_read_back() {
  TEST_ASSERT_TRUE(csv_is({0.1f, 12.5f, 7, -0.0f, 254, 3}, "0.1,12.5,7,-0,254,3\n"));
  TEST_ASSERT_EQUAL_DOUBLE(0.8, shortest(0.8f));
  TEST_ASSERT_EQUAL_DOUBLE(1.1, shortest(1.1f));
}

void test_a_written_camera_reads_back_to_the_same_bits() {
  tv_camera cameras[4] = {lens(), lens(), lens(), lens()};
  cameras[1].model = TV_CAMERA_KANNALA_BRANDT;
  cameras[1].k[4] = 0;
  cameras[2].k[7] = 1e-300;
  cameras[3].model = TV_CAMERA_PINHOLE;
  std::memset(cameras[3].k, 0, sizeof cameras[3].k);
  for (tv_camera& camera : cameras) {
    camera.fx = 100 * (0.1 + 0.2);
    camera.k[1] = camera.model == TV_CAMERA_PINHOLE ? 0 : -1.0 / 3;
    const tv_camera again = parse_camera(camera_yaml(camera), "c");
    TEST_ASSERT_EQUAL_MEMORY(&camera, &again, sizeof camera);
  }
}

// 100 times the number of matches in a text, plus the sum of their x0; -1 when it is refused.
double parsed_matches(const char* text) {
  try {
    const MatchList matches = parse_matches(text, "m");
    double sum = 100.0 * static_cast<double>(matches.size());
    for (size_t i = 0; i < matches.size(); ++i) sum += matches.pixels[0][2 * i];
    return sum;
  } catch (const BadInput&) {
    return -1;
  }
}

void test_matches_come_with_commas_blanks_and_names() {
  TEST_ASSERT_EQUAL_DOUBLE(101, parsed_matches("1 2 3 4"));
  TEST_ASSERT_EQUAL_DOUBLE(206, parsed_matches("# c\n\n1,2,3,4,9\r\n 5 ; 6;7\t8 x\n"));
  TEST_ASSERT_EQUAL_DOUBLE(104, parsed_matches("y1,x1,y0,x0\n1,2,3,4\n"));
  TEST_ASSERT_EQUAL_DOUBLE(101, parsed_matches("\xef\xbb\xbf+1 2 -3 4e5"));
  TEST_ASSERT_EQUAL_DOUBLE(-1, parsed_matches("1 2 3"));
  TEST_ASSERT_EQUAL_DOUBLE(-1, parsed_matches("1,,2,3,4"));
  TEST_ASSERT_EQUAL_DOUBLE(-1, parsed_matches("x0,y0,x1\n1,2,3"));
  TEST_ASSERT_EQUAL_DOUBLE(-1, parsed_matches("1 2 3 4\nx0 y0 x1 y1\n"));
  TEST_ASSERT_EQUAL_DOUBLE(-1, parsed_matches("x0 y0 x1 y1\n"));
}

bool plain_is(const char* text, const char* expected) { return plain_letters(text) == expected; }

// How many points the cloud has of one, 4 m away, that a keyframe sees straight ahead, and others
// from so many degrees aside.
size_t cloud_of(const std::vector<double>& degrees_aside) {
  tv_map_point point{};
  point.position[2] = 4;
  std::vector<FlightKeyframe> keyframes(degrees_aside.size() + 1);
  for (size_t k = 0; k < keyframes.size(); ++k) {
    const double degrees = k == 0 ? 0 : degrees_aside[k - 1];
    tv_keyframe_init(&keyframes[k].keyframe);
    keyframes[k].keyframe.world_from_cam_t[0] =
        4 * std::tan(degrees * 3.14159265358979323846 / 180);
    keyframes[k].observations = {{0, 7, 0, 0, 1, 0}, {-1, 8, 0, 0, 1, 0}};
  }
  return cloud_points({point}, keyframes).size();
}

void test_the_cloud_has_the_points_whose_rays_meet_at_an_angle() {
  TEST_ASSERT_EQUAL_UINT64(0, cloud_of({}));
  TEST_ASSERT_EQUAL_UINT64(0, cloud_of({0}));
  TEST_ASSERT_EQUAL_UINT64(0, cloud_of({1.49}));
  TEST_ASSERT_EQUAL_UINT64(1, cloud_of({1.51}));
  TEST_ASSERT_EQUAL_UINT64(1, cloud_of({0.1, 60}));
  // No ray is 1.5 degrees from the first one.
  TEST_ASSERT_EQUAL_UINT64(1, cloud_of({0.8, -0.8}));
  TEST_ASSERT_EQUAL_UINT64(0, cloud_of({0.8, 1.2, -0.2}));
  TEST_ASSERT_EQUAL_UINT64(0, cloud_points({}, {}).size());
}

// world_from_cam of a camera that was turned by `yaw`, tilted down by `pitch` and then rolled
// clockwise by `roll`; the world's y axis points down.
Matrix3 held(double yaw_deg, double pitch_deg, double roll_deg) {
  const auto about = [](size_t axis, double degrees) {
    const double angle = degrees * 3.14159265358979323846 / 180;
    const size_t a = (axis + 1) % 3, b = (axis + 2) % 3;
    Matrix3 R{1, 0, 0, 0, 1, 0, 0, 0, 1};
    R[4 * a] = R[4 * b] = std::cos(angle);
    R[3 * b + a] = std::sin(angle);
    R[3 * a + b] = -R[3 * b + a];
    return R;
  };
  return product(product(about(1, yaw_deg), about(0, -pitch_deg)), about(2, roll_deg));
}

double degrees_from_up(const Vector3& up) {
  return std::acos(std::min(1.0, -up[1])) * 180 / 3.14159265358979323846;
}

void test_up_is_up_however_far_the_cameras_look_down() {
  std::vector<Matrix3> around, ahead;
  for (int yaw = 0; yaw < 200; yaw += 10) around.push_back(held(yaw, 40, yaw % 20 == 0 ? 3 : -3));
  TEST_ASSERT_TRUE(degrees_from_up(up_of_cameras(around)) < 1.5);
  // Cameras that never turned say it about their x axis only by how they are held as a rule.
  for (int pitch = -4; pitch <= 4; ++pitch) ahead.push_back(held(0, 20 + pitch, 0));
  const Vector3 up = up_of_cameras(ahead);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, up[0]);
  TEST_ASSERT_DOUBLE_WITHIN(0.1, 20, degrees_from_up(up));
  TEST_ASSERT_EQUAL_DOUBLE(-1, up_of_cameras({})[1]);
  // A telephone stores what it filmed upright lying on its side: of 90 degrees, its x axis down.
  for (const int turn : {90, 180, 270}) {
    std::vector<Matrix3> stored;
    for (const Matrix3& R : around) stored.push_back(product(R, held(0, 0, turn)));
    TEST_ASSERT_TRUE(degrees_from_up(up_of_cameras(stored, turn)) < 1.5);
  }
}

// A world that is turned against an upright one, as a map that began before the first attitude.
void test_down_in_a_world_that_is_not_upright() {
  const Matrix3 upright_from_world = held(20, 35, -50);
  const Vector3 down = applied(transposed(upright_from_world), {0, 0, 1});
  DownSum sum, other;
  TEST_ASSERT_FALSE(sum.down().has_value());
  for (int k = 0; k < 9; ++k) {
    const Matrix3 world_from_cam = held(40 * k, 10, 5);
    const Matrix3 error = held(0, k % 3 - 1, 1 - k % 3);  // a degree
    sum.add(world_from_cam, product(error, product(upright_from_world, world_from_cam)));
    other.add(world_from_cam, world_from_cam);
    other.add(world_from_cam, product(upright_from_world, world_from_cam));
  }
  TEST_ASSERT_TRUE(sum.down().has_value());
  for (size_t k = 0; k < 3; ++k) TEST_ASSERT_DOUBLE_WITHIN(0.02, down[k], (*sum.down())[k]);
  TEST_ASSERT_FALSE(other.down().has_value());  // attitudes that contradict each other
}

int segments_of(std::initializer_list<int> of_keyframes) {
  std::vector<FlightKeyframe> keyframes;
  for (const int segment : of_keyframes) {
    keyframes.emplace_back();
    keyframes.back().keyframe.segment = segment;
  }
  return count_segments(keyframes);
}

// Others may have been begun: joined to one of these, or removed.
void test_segments_are_counted_that_have_keyframes() {
  TEST_ASSERT_EQUAL_INT(0, segments_of({}));
  TEST_ASSERT_EQUAL_INT(2, segments_of({2, 0, 2}));
}

void test_the_font_gets_letters_that_it_has() {
  TEST_ASSERT_TRUE(plain_is("left_01 (2).png", "left_01 (2).png"));
  TEST_ASSERT_TRUE(plain_is("\u00dcbung-\u015alask\u0142\u00e9\u00df.png", "Ubung-Slaskles.png"));
  TEST_ASSERT_TRUE(plain_is("e\u0301t\u00e9", "ete"));
  TEST_ASSERT_TRUE(plain_is("\u98de\u673a\U0001F681.png", "___.png"));
  TEST_ASSERT_TRUE(plain_is("a\xff\xc3", "a__"));
  TEST_ASSERT_TRUE(plain_is("\xe9\xa3", "__"));
}

// The times of a stream; -1 for a picture that is left out.
bool clock_gives(std::initializer_list<double> clock, std::initializer_list<double> expected,
                 int num_anew) {
  StreamClock stream;
  bool equal = true;
  auto next = expected.begin();
  for (const double time : clock)
    equal = equal && std::abs(stream.next(time).value_or(-1) - *next++) < 1e-12;
  return equal && stream.num_begun_anew() == num_anew && stream.note("it").empty() == !num_anew;
}

void test_a_clock_that_falls_and_rises_again_began_anew() {
  TEST_ASSERT_TRUE(clock_gives({5, 6, 7}, {5, 6, 7}, 0));
  // Twice there; out of order; one wrong stamp.
  TEST_ASSERT_TRUE(clock_gives({5, 5, 6, 6, 7}, {5, -1, 6, -1, 7}, 0));
  TEST_ASSERT_TRUE(clock_gives({5, 5.3, 5.1, 5.2, 5.4}, {5, 5.3, -1, -1, 5.4}, 0));
  TEST_ASSERT_TRUE(clock_gives({5, 6, 0, 7}, {5, 6, -1, 7}, 0));
  TEST_ASSERT_TRUE(clock_gives({5, 6, 0, 0, 7}, {5, 6, -1, -1, 7}, 0));
  TEST_ASSERT_TRUE(
      clock_gives({5, 6, 5.6, 5.7, 5.8, 5.7, 5.8, 6.1}, {5, 6, -1, -1, -1, -1, -1, 6.1}, 0));
  // By less than a second.
  TEST_ASSERT_TRUE(
      clock_gives({5, 6, 5.5, 5.6, 5.7, 5.8, 5.9, 6, 6.1}, {5, 6, -1, -1, -1, -1, 7, 7.1, 7.2}, 1));
  // Begun anew, once and twice: each goes on a second after what was before.
  TEST_ASSERT_TRUE(clock_gives({5, 6, 0, 0.5, 1}, {5, 6, -1, 7, 7.5}, 1));
  TEST_ASSERT_TRUE(clock_gives({5, 6, 0, 2, 4, 1, 2, 9}, {5, 6, -1, 7, 9, -1, 10, 17}, 2));
}

// A flight of 60 frames at 15 a second that turns about all three axes.
Trajectory turning_flight() {
  Trajectory flight;
  for (int i = 0; i < 60; ++i) {
    const double a = 0.02 * i, b = 0.5 * std::sin(0.1 * i), c = 0.3 * std::cos(0.17 * i);
    const Matrix3 R = product(rotation_of_quaternion(std::sin(a), 0, 0, std::cos(a)),
                              product(rotation_of_quaternion(0, std::sin(b), 0, std::cos(b)),
                                      rotation_of_quaternion(0, 0, std::sin(c), std::cos(c))));
    flight.push_back({i / 15.0, {R, {0.1 * i, std::sin(0.1 * i), 0.3 * std::cos(0.2 * i)}}});
  }
  return flight;
}

// The flight as a file of a truth, and the words on its rotations.
std::string words_on_written(const char* head, bool is_scalar_first, const char* between,
                             const Matrix3& camera_from_body) {
  char name[] = "/tmp/twoview_truth_XXXXXX";
  const int file = mkstemp(name);
  std::string text = head;
  for (const TimedPose& at : turning_flight()) {
    const auto [x, y, z, w] = quaternion_of(product(at.pose.R, camera_from_body));
    char line[300];
    const double q[5] = {w, x, y, z, w};
    const double* const first = q + (is_scalar_first ? 0 : 1);
    std::snprintf(line, sizeof line, "%.6f%s%f%s%f%s0%s%.9f%s%.9f%s%.9f%s%.9f\n", at.time_s,
                  between, at.pose.t[0], between, at.pose.t[1], between, between, first[0], between,
                  first[1], between, first[2], between, first[3]);
    text += line;
  }
  const bool is_written =
      write(file, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  close(file);
  const std::string words =
      is_written ? rotation_words(turning_flight(), load_trajectory(name, {}, {})) : "not written";
  unlink(name);
  return words;
}

void test_a_truth_with_the_other_order_of_its_quaternions_is_told_from_the_right_one() {
  const Matrix3 same{1, 0, 0, 0, 1, 0, 0, 0, 1}, body{0, -1, 0, 0, 0, -1, 1, 0, 0};
  const char* const names = "# timestamp tx ty tz qw qx qy qz\n";
  TEST_ASSERT_TRUE(words_on_written("", false, " ", same).empty());
  TEST_ASSERT_TRUE(words_on_written("# made by hand\n", false, " ", same).empty());
  TEST_ASSERT_TRUE(holds(words_on_written("", true, " ", same), "as qw qx qy qz they fit"));
  TEST_ASSERT_TRUE(words_on_written(names, true, " ", same).empty());
  TEST_ASSERT_TRUE(
      words_on_written("#time [s], x [m], y [m], z [m], qw, qx, qy, qz\n", true, ",", same)
          .empty());
  // EuRoC's order is the other one where a line has more columns than eight: here it has not.
  TEST_ASSERT_TRUE(holds(words_on_written("", true, ",", same), "as qw qx qy qz they fit"));
  // With names the order is known, so that only another body is left.
  TEST_ASSERT_TRUE(holds(words_on_written(names, false, " ", same), "of another body"));
  TEST_ASSERT_TRUE(holds(words_on_written("", false, " ", body), "of another body"));
}

void test_a_truth_that_never_turns_is_named() {
  TruePoses truth;
  truth.poses = turning_flight();
  for (TimedPose& at : truth.poses) at.pose.R = truth.poses[30].pose.R;
  TEST_ASSERT_TRUE(
      holds(rotation_words(turning_flight(), truth), "one and the same in all 60 poses"));
  // So are those of a path that does not turn, either.
  TEST_ASSERT_TRUE(rotation_words(truth.poses, truth).empty());
}

FrameClock clock_of_60(const char* pattern) {
  FrameClock clock;
  for (int i = 0; i < 60; ++i) {
    char name[32];
    std::snprintf(name, sizeof name, pattern, 100 + 2 * i);
    clock.numbers.push_back(i);
    clock.times_s.push_back(i / 15.0);
    clock.names.emplace_back(name);
  }
  return clock;
}

void test_a_true_pose_with_other_conventions_is_named() {
  const Matrix3 R = rotation_of_quaternion(0.1, 0.2, -0.05, 0.97);
  const Vector3 t = {-0.5, 0.3, 0.4};
  TEST_ASSERT_TRUE(reading_words(R, t, R, t).empty());
  // Each reading is its own inverse: what is written so is named so.
  for (const PairReading& written : other_readings(R, t)) {
    const bool is_place = holds(written.words, "the place of camera 1");
    const Vector3 place = applied(transposed(R), {-t[0], -t[1], -t[2]});
    const std::string words = reading_words(R, t, written.R, is_place ? place : written.t);
    TEST_ASSERT_TRUE_MESSAGE(holds(words, written.words), words.c_str());
  }
  TEST_ASSERT_TRUE(reading_words(R, t, R, {0.5, 0.3, -0.2}).empty());  // of another pair
}

// What is doubted of a truth that is the flight with this change.
template <typename Change>
std::string doubts_of(const Change& change) {
  TruePoses truth;
  truth.poses = turning_flight();
  for (size_t i = 0; i < truth.poses.size(); ++i) change(i, truth.poses[i]);
  std::string words;
  for (const std::string& doubt : truth_doubts(turning_flight(), truth, clock_of_60("%d.png")))
    words += doubt + "\n";
  return words;
}

void test_a_truth_of_another_clock_or_in_degrees_is_named() {
  const auto none = doubts_of([](size_t, TimedPose&) {});
  TEST_ASSERT_TRUE_MESSAGE(none.empty(), none.c_str());
  for (const int frames : {1, 3, 15}) {
    const std::string later = doubts_of([&](size_t, TimedPose& at) { at.time_s += frames / 15.0; });
    const std::string count = "(" + std::to_string(frames) + " frame";
    TEST_ASSERT_TRUE_MESSAGE(holds(later, count.c_str()) && holds(later, "smaller"), later.c_str());
  }
  const std::string earlier = doubts_of([](size_t, TimedPose& at) { at.time_s -= 4 / 15.0; });
  TEST_ASSERT_TRUE(holds(earlier, "0.267 s (4 frames) larger"));
  const std::string rate = doubts_of([](size_t, TimedPose& at) { at.time_s *= 2; });
  TEST_ASSERT_TRUE_MESSAGE(holds(rate, "one by one (--fps?)"), rate.c_str());
  // A metre at 47 degrees north; and the same numbers as metres of a path that is far away.
  const auto in_degrees = [](size_t, TimedPose& at) {
    at.pose.t = {47 + at.pose.t[1] / 111320, 8 + at.pose.t[0] / 75920, 400 + at.pose.t[2]};
  };
  TEST_ASSERT_TRUE(holds(doubts_of(in_degrees), "latitude and longitude in degrees"));
  const std::string mirrored = doubts_of([](size_t, TimedPose& at) { at.pose.t[1] *= -1; });
  TEST_ASSERT_TRUE_MESSAGE(holds(mirrored, "the path's mirror image"), mirrored.c_str());
  const std::string far = doubts_of([](size_t, TimedPose& at) { at.pose.t[0] += 47; });
  TEST_ASSERT_TRUE_MESSAGE(far.empty(), far.c_str());
}

void test_a_truth_whose_motion_is_not_the_paths_is_named() {
  const auto check = [](const char* words, const std::string& doubts) {
    TEST_ASSERT_TRUE_MESSAGE(holds(doubts, words), doubts.c_str());
    TEST_ASSERT_EQUAL_INT(1, std::count(doubts.begin(), doubts.end(), '\n'));
  };
  const Trajectory path = turning_flight();
  check("the truth stands in 10 of 60 poses, first at 2 s", doubts_of([&](size_t i, TimedPose& at) {
          if (i > 30 && i <= 40) at.pose.t = path[30].pose.t;
        }));
  check("the truth stands in 30 of 60 poses, first at 0 s",
        doubts_of([&](size_t i, TimedPose& at) { at.pose.t = path[i - i % 2].pose.t; }));
  check("the truth jumps in 1 of 59 steps, farthest between 1.933 and 2 s: by 1.1",
        doubts_of([](size_t i, TimedPose& at) { at.pose.t[0] += i < 30 ? 0 : 1; }));
  check("the truth jumps in 2 of 59 steps",
        doubts_of([](size_t i, TimedPose& at) { at.pose.t[1] += i == 30 ? 5 : 0; }));
  check("2.4 times as long as the path's: noise",
        doubts_of([](size_t i, TimedPose& at) { at.pose.t[i % 3] += i % 2 == 0 ? 0.2 : -0.2; }));
  check("the truth's z is 0.5 in all poses",
        doubts_of([](size_t, TimedPose& at) { at.pose.t[2] = 0.5; }));
  check("a point 0.539 of its units away (right 0.2, down -0.3, ahead 0.4)",
        doubts_of([](size_t, TimedPose& at) {
          const Vector3 arm = applied(at.pose.R, {0.2, -0.3, 0.4});
          for (size_t k = 0; k < 3; ++k) at.pose.t[k] += arm[k];
        }));
}

// What is said of a truth whose times are first, first + step, ..., and how many then meet.
std::string words_on_numbers(double first, double step, const char* pattern, int* num_met) {
  TruePoses truth;
  truth.poses = turning_flight();
  for (size_t i = 0; i < 60; ++i) truth.poses[i].time_s = first + step * static_cast<double>(i);
  const std::string words = fit_times(turning_flight(), truth, clock_of_60(pattern));
  *num_met = static_cast<int>(associated(turning_flight(), truth.poses).size());
  return words;
}

void test_times_that_are_frame_numbers_are_understood_and_said() {
  const struct {
    double first, step;
    const char *pattern, *words;
    int met;
  } cases[] = {{0, 1, "frame", "counted from 0", 60},
               {1, 1, "frame", "counted from 1", 60},
               {1, 1, "%d.png", "counted from 1", 60},
               {100, 2, "%d.png", "the numbers in the pictures' names", 60},
               {0, 1 / 15.0, "%d.png", nullptr, 60},
               {0, 1.3 / 15, "%d.png", "are the times of one clock?", 10},
               {0, 1 / 120.0, "%d.png", "only 8 of its 60 poses are compared", 8}};
  for (const auto& c : cases) {
    int met = 0;
    const std::string words = words_on_numbers(c.first, c.step, c.pattern, &met);
    TEST_ASSERT_TRUE_MESSAGE(c.words ? holds(words, c.words) : words.empty(), words.c_str());
    if (c.step == std::floor(c.step)) TEST_ASSERT_EQUAL_INT(c.met, met);
  }
  // One true pose a second is no frame number: each has its time.
  TruePoses truth;
  for (int i = 0; i < 4; ++i) truth.poses.push_back({double(i), turning_flight()[15 * i].pose});
  TEST_ASSERT_TRUE(fit_times(turning_flight(), truth, clock_of_60("frame")).empty());
  TEST_ASSERT_EQUAL_DOUBLE(3, truth.poses[3].time_s);
}

cv::Mat fine_wall(int width) {
  cv::Mat wall(240, width, CV_8U);
  cv::theRNG().state = 7;
  cv::randu(wall, 0, 256);
  cv::GaussianBlur(wall, wall, {9, 9}, 0);
  cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
  return wall;
}

// A camera that moves by a pixel a picture along a wall with a fine texture; other_by: how far
// beside it the other eye is, pixels.
EyesLayout eyes_of(EyesLayout layout, int other_by) {
  const cv::Mat wall = fine_wall(1000);
  TwoEyes eyes;
  for (int n = 0; n < 24; ++n) {
    const cv::Mat one = wall(cv::Rect(n, 0, 320, 240));
    const cv::Mat other = wall(cv::Rect(n + other_by, 0, 320, 240));
    cv::Mat both;
    if (layout == EyesLayout::kSideBySide) cv::hconcat(one, other, both);
    if (layout == EyesLayout::kTopBottom) cv::vconcat(one, other, both);
    if (layout == EyesLayout::kInTurn) both = n % 2 == 0 ? one : other;
    eyes.add(layout == EyesLayout::kOne ? one : both);
  }
  TEST_ASSERT_EQUAL(eyes.layout() == EyesLayout::kOne, eyes.words().empty());
  return eyes.layout();
}

void test_pictures_of_two_eyes_are_told_from_those_of_one() {
  for (const EyesLayout layout :
       {EyesLayout::kOne, EyesLayout::kSideBySide, EyesLayout::kTopBottom, EyesLayout::kInTurn})
    TEST_ASSERT_EQUAL(layout, eyes_of(layout, 30));
  // Halves of other places are no two eyes.
  TEST_ASSERT_EQUAL(EyesLayout::kOne, eyes_of(EyesLayout::kSideBySide, 400));
}

// What is said of pictures of a moving wall of which `combed` of 24 are woven of two moments.
std::string combed_words(int combed, bool is_mosaic) {
  const cv::Mat wall = fine_wall(400);
  CombedRows rows;
  for (int n = 0; n < 24; ++n) {
    cv::Mat picture = wall(cv::Rect(n, 0, 320, 240)).clone();
    const cv::Mat later = wall(cv::Rect(n + 6, 0, 320, 240));
    for (int y = 1; y < 240 && n < combed; y += 2) later.row(y).copyTo(picture.row(y));
    for (int y = 0; y < 240 && is_mosaic; ++y)
      for (int x = 0; x < 320; ++x)
        if (x % 2 != y % 2) picture.at<uint8_t>(y, x) /= 4;
    rows.add(picture);
  }
  return rows.words();
}

void test_combed_pictures_are_named() {
  TEST_ASSERT_TRUE(combed_words(0, false).empty());
  TEST_ASSERT_TRUE(combed_words(6, false).empty());  // two of those that are looked at
  TEST_ASSERT_TRUE(holds(combed_words(24, false), "in 6 of 6 pictures"));
  TEST_ASSERT_TRUE(holds(combed_words(10, false), "are of two moments"));
  TEST_ASSERT_TRUE(holds(combed_words(0, true), "mosaic"));
}

void check_sortable(const char* name, DateReading reading, const char* sortable) {
  static char found[80];
  const std::vector<std::string> names = sortable_names({name}, reading);
  std::snprintf(found, sizeof found, "%s", names.empty() ? "none" : names[0].c_str());
  TEST_ASSERT_EQUAL_STRING(sortable, found);
}

void test_dates_and_times_of_names_are_written_so_that_they_sort() {
  check_sortable("31-12-2025_1.jpg", DateReading::kDayMonth, "2025-12-31_1.jpg");
  check_sortable("31-12-2025_1.jpg", DateReading::kMonthDay, "none");  // no month 31
  check_sortable("IMG01022026.jpg", DateReading::kMonthDay, "img2026-01-02.jpg");
  check_sortable("5.6.26 a.jpg", DateReading::kDayMonthTwo, "26-06-05 a.jpg");
  check_sortable("Photo 1.05.09 PM.jpg", DateReading::kDayMonth, "photo 13.05.09.jpg");
  check_sortable("12-59 a.m.png", DateReading::kDayMonth, "00-59.png");
  check_sortable("Sept 3.png", DateReading::kDayMonth, "09 3.png");
  check_sortable("5 Jan 2026 x.png", DateReading::kDayMonth, "2026-01-05 x.png");
  check_sortable("2026-01-05_120000.jpg", DateReading::kDayMonth, "none");  // sorts as it is
  check_sortable("frame_000123.png", DateReading::kMonthDayTwo, "none");
  check_sortable("marble_12am3.png", DateReading::kDayMonth, "marble_003.png");
}

// Bit n of the first number: picture n of a sequence counts as given again while the camera moved;
// of the second: the camera waited. Each picture is one level, so that levels are positions.
struct Repeated {
  uint32_t stood = 0, waited = 0;
};
Repeated repeated_of(const std::vector<int>& levels) {
  RepeatedPictures pictures;
  for (size_t n = 0; n < levels.size(); ++n)
    pictures.is_repeated(cv::Mat(4, 4, CV_8U, cv::Scalar(levels[n])), n);
  pictures.end();
  Repeated result;
  for (const size_t n : pictures.stood()) result.stood |= 1u << n;
  for (const size_t n : pictures.waited()) result.waited |= 1u << n;
  return result;
}

void check_repeated(const std::vector<int>& levels, uint32_t stood, uint32_t waited) {
  const Repeated found = repeated_of(levels);
  TEST_ASSERT_EQUAL_HEX32(stood, found.stood);
  TEST_ASSERT_EQUAL_HEX32(waited, found.waited);
}

void test_a_picture_that_stands_is_told_from_a_camera_that_does() {
  check_repeated({0, 20, 40, 60, 60, 60, 120, 140}, 0x30, 0);          // two pictures are missing
  check_repeated({0, 20, 40, 61, 60, 60, 66, 66, 140, 160}, 0xf0, 0);  // with a key frame in it
  check_repeated({0, 20, 40, 60, 60}, 0x10, 0);                        // to the end
  check_repeated({0, 20, 40, 60, 70, 75, 77, 78, 78, 78, 80, 90}, 0, 0);  // it stops smoothly
  check_repeated({0, 20, 40, 60, 60, 66, 72, 80, 100}, 0, 0x30);   // it begins to move again slowly
  check_repeated({200, 0, 5, 10, 15, 20, 220, 25, 30, 35}, 0, 0);  // two flashes
  check_repeated({9, 9, 9, 9, 9, 11, 14, 20}, 0, 0);               // before the start
}

// 40 frames along an arc, in the order that `taken` gives; one lies in another segment.
std::string order_words_of(const std::vector<int>& taken) {
  std::vector<FlightFrame> frames(taken.size());
  for (size_t n = 0; n < taken.size(); ++n) {
    const double at = 0.05 * taken[n];
    frames[n].name = std::to_string(taken[n]) + ".png";
    frames[n].time_s = 0.1 * static_cast<double>(n);
    frames[n].status = TV_ODOMETRY_TRACKING;
    frames[n].origin = PoseOrigin::kTracked;
    frames[n].segment = n == 5 ? 1 : 0;
    frames[n].pose = {rotation_of_quaternion(0, std::sin(0.1 * at), 0, std::cos(0.1 * at)),
                      {std::sin(at), 0, std::cos(at)}};
    if (n == 5) frames[n].pose.t = {9, 9, 9};
  }
  std::vector<tv_map_point> points(9);
  for (size_t n = 0; n < points.size(); ++n) {
    points[n].segment = 0;
    points[n].position[0] = 3 + 0.1 * static_cast<double>(n);
  }
  return path_order_words(frames, points, 0);
}

void test_the_path_tells_pictures_that_are_in_another_order(void) {
  std::vector<int> right, pairs, shuffled, cut, there_and_back, halves;
  for (int n = 0; n < 40; ++n) {
    right.push_back(n);
    pairs.push_back(n ^ 1);
    shuffled.push_back(17 * n % 40);
    cut.push_back(n < 20 ? n : n + 15);
    there_and_back.push_back(n < 20 ? n : 40 - n);
    halves.push_back((n + 25) % 40);
  }
  TEST_ASSERT_EQUAL_STRING("", order_words_of(right).c_str());
  TEST_ASSERT_EQUAL_STRING("", order_words_of(there_and_back).c_str());
  for (const std::vector<int>& taken : {pairs, shuffled})
    TEST_ASSERT_NOT_NULL(std::strstr(order_words_of(taken).c_str(), "goes to and fro"));
  TEST_ASSERT_NOT_NULL(std::strstr(order_words_of(cut).c_str(), "from 19.png to 35.png"));
  TEST_ASSERT_NOT_NULL(std::strstr(order_words_of(halves).c_str(), "from 39.png to 0.png"));
}

}  // namespace

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_pictures_of_two_eyes_are_told_from_those_of_one);
  RUN_TEST(test_combed_pictures_are_named);
  RUN_TEST(test_dates_and_times_of_names_are_written_so_that_they_sort);
  RUN_TEST(test_a_picture_that_stands_is_told_from_a_camera_that_does);
  RUN_TEST(test_a_clock_that_falls_and_rises_again_began_anew);
  RUN_TEST(test_a_truth_with_the_other_order_of_its_quaternions_is_told_from_the_right_one);
  RUN_TEST(test_times_that_are_frame_numbers_are_understood_and_said);
  RUN_TEST(test_a_true_pose_with_other_conventions_is_named);
  RUN_TEST(test_a_truth_of_another_clock_or_in_degrees_is_named);
  RUN_TEST(test_a_truth_whose_motion_is_not_the_paths_is_named);
  RUN_TEST(test_a_truth_that_never_turns_is_named);
  RUN_TEST(test_auc_is_the_area_under_straight_lines_of_recall);
  RUN_TEST(test_percentile_lies_between_its_neighbours);
  RUN_TEST(test_a_distance_has_the_sigma_that_the_pose_gives_it);
  RUN_TEST(test_pairs_that_agree_on_a_shift_ask_for_a_calibration);
  RUN_TEST(test_pairs_that_are_few_or_do_not_agree_ask_for_nothing);
  RUN_TEST(test_each_camera_gets_its_own_advice);
  RUN_TEST(test_a_result_without_evidence_says_nothing);
  RUN_TEST(test_rotation_error_is_exact_from_tiny_to_half_a_turn);
  RUN_TEST(test_translation_error_forgets_the_sign_only_when_asked);
  RUN_TEST(test_a_resized_camera_keeps_pixel_areas);
  RUN_TEST(test_a_turned_camera_sees_the_turned_point_at_the_turned_pixel);
  RUN_TEST(test_camera_files_give_the_numbers_and_the_model);
  RUN_TEST(test_the_longest_name_that_begins_the_files_name_serves_it);
  RUN_TEST(test_an_images_camera_has_the_lines_K_and_the_entrys_lens_and_size);
  RUN_TEST(test_pairs_lines_have_two_four_twenty_two_or_thirty_eight_fields);
  RUN_TEST(test_files_of_several_pictures_are_known);
  RUN_TEST(test_films_that_were_joined_as_bytes_are_known);
  RUN_TEST(test_headers_are_read_within_their_bytes);
  RUN_TEST(test_a_pose_that_an_uncertain_focal_length_leaves_open_asks_for_a_calibration);
  RUN_TEST(test_each_reason_has_words_and_advice_and_no_reason_none);
  RUN_TEST(test_the_advice_without_a_camera_file_names_none);
  RUN_TEST(test_a_sigma_of_which_nothing_is_known_is_no_number);
  RUN_TEST(test_a_focal_length_that_hardly_changed_has_no_sign);
  RUN_TEST(test_a_zoomed_pair_is_told_of_its_scale_and_of_no_second_motion);
  RUN_TEST(test_the_scale_is_of_the_inliers_and_not_of_what_the_geometry_rejects);
  RUN_TEST(test_base64_has_the_vectors_of_rfc_4648);
  RUN_TEST(test_csv_numbers_are_the_shortest_that_read_back);
  RUN_TEST(test_a_written_camera_reads_back_to_the_same_bits);
  RUN_TEST(test_matches_come_with_commas_blanks_and_names);
  RUN_TEST(test_up_is_up_however_far_the_cameras_look_down);
  RUN_TEST(test_down_in_a_world_that_is_not_upright);
  RUN_TEST(test_the_cloud_has_the_points_whose_rays_meet_at_an_angle);
  RUN_TEST(test_segments_are_counted_that_have_keyframes);
  RUN_TEST(test_the_font_gets_letters_that_it_has);
  RUN_TEST(test_the_path_tells_pictures_that_are_in_another_order);
  return UNITY_END();
}
