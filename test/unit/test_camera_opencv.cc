// Camera models against OpenCV: projectPoints (Brown-Conrady, 5 and 8 coefficients) and
// fisheye::projectPoints (Kannala-Brandt), with their Jacobians, and undistortPoints.
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "base/random.h"
#include "geometry/camera.h"
// unity.h comes after OpenCV: it defines isnan and isinf as macros.
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using tv::Mat23;
using tv::Vec2;
using tv::Vec3;

constexpr uint64_t kSeed = 3;
constexpr int kNumPoints = 500;

const tv_camera kArdrone = {
    TV_CAMERA_BROWN_CONRADY,
    640,
    360,
    0,
    569.883158064802,
    568.007065238522,
    331.403348466206,
    135.879365106014,
    {-0.526629354780687, 0.274357114262035, 0.0211426202132638, -0.0063942451330052, 0}};
const tv_camera kTumFr1 = {TV_CAMERA_BROWN_CONRADY,
                           640,
                           480,
                           0,
                           517.3,
                           516.5,
                           318.6,
                           255.3,
                           {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}};
const tv_camera kRational = {TV_CAMERA_BROWN_CONRADY,
                             1280,
                             720,
                             0,
                             612.1,
                             611.8,
                             638.0,
                             367.2,
                             {0.52, -2.69, 0.0005, -0.0002, 1.55, 0.40, -2.51, 1.48}};
const tv_camera kFisheye = {
    TV_CAMERA_KANNALA_BRANDT,
    512,
    512,
    0,
    190.97847715128717,
    190.9733070521226,
    254.93170605935475,
    256.8974428996504,
    {0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202, 0.00020293673591811182}};

double uniform(tv::Random* random, double low, double high) {
  return low + (high - low) * (tv::random_next(*random) * 0x1p-32);
}

cv::Mat matrix_of(const tv_camera& c) {
  return (cv::Mat_<double>(3, 3) << c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
}

cv::Mat coefficients_of(const tv_camera& c) {
  return cv::Mat(1, c.model == TV_CAMERA_KANNALA_BRANDT ? 4 : 8, CV_64F, const_cast<double*>(c.k))
      .clone();
}

// OpenCV's pixel and d pixel / d translation, which equals d pixel / d point for a rotation of
// zero.
void project_by_opencv(const tv_camera& camera, const Vec3& point, double pixel[2],
                       Mat23* jacobian) {
  const cv::Mat object(1, 1, CV_64FC3, cv::Scalar(point[0], point[1], point[2]));
  const cv::Mat zero = cv::Mat::zeros(3, 1, CV_64F);
  cv::Mat image, d;
  int first = 3;
  if (camera.model == TV_CAMERA_KANNALA_BRANDT) {
    cv::fisheye::projectPoints(object, image, zero, zero, matrix_of(camera),
                               coefficients_of(camera), 0, d);
    first = 11;  // d's columns: f 2, c 2, k 4, rotation 3, translation 3, skew 1
  } else {
    cv::projectPoints(object, zero, zero, matrix_of(camera), coefficients_of(camera), image, d);
  }
  pixel[0] = image.at<cv::Vec2d>(0)[0];
  pixel[1] = image.at<cv::Vec2d>(0)[1];
  for (int row = 0; row < 2; ++row) {
    for (int col = 0; col < 3; ++col) (*jacobian)(row, col) = d.at<double>(row, first + col);
  }
}

void compare(const tv_camera& model, double max_angle) {
  const tv::Camera camera = tv::prepare_camera(model);
  TEST_ASSERT_TRUE(camera.valid_angle_rad > max_angle);
  tv::Random random = tv::random_seeded(kSeed);
  for (int i = 0; i < kNumPoints; ++i) {
    const double angle = uniform(&random, 0.001, max_angle);
    const double azimuth = uniform(&random, -3.2, 3.2);
    const Vec3 point =
        uniform(&random, 0.5, 20) * Vec3(std::sin(angle) * std::cos(azimuth),
                                         std::sin(angle) * std::sin(azimuth), std::cos(angle));
    double expected[2];
    Mat23 expected_d, d;
    Vec2 pixel;
    project_by_opencv(model, point, expected, &expected_d);
    TEST_ASSERT_TRUE(tv::project(camera, point, &pixel, &d));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected[0], pixel[0]);
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, expected[1], pixel[1]);
    for (int k = 0; k < 6; ++k) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-8 * (1 + expected_d.norm()), expected_d(k / 3, k % 3),
                                d(k / 3, k % 3));
    }
  }
}

}  // namespace

void test_ardrone_projects_as_in_opencv(void) { compare(kArdrone, 1.0); }
void test_tum_fr1_projects_as_in_opencv(void) { compare(kTumFr1, 0.6); }
void test_rational_model_projects_as_in_opencv(void) { compare(kRational, 0.9); }
void test_fisheye_projects_as_in_opencv(void) { compare(kFisheye, 1.5); }

void test_undistortion_agrees_with_opencvs_iterated_to_the_end(void) {
  const tv::Camera camera = tv::prepare_camera(kArdrone);
  const cv::TermCriteria to_the_end(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 500, 1e-13);
  for (int y = 60; y < 300; y += 20) {
    for (int x = 100; x < 560; x += 20) {
      const cv::Mat distorted(1, 1, CV_64FC2, cv::Scalar(x, y));
      cv::Mat straight;
      cv::undistortPoints(distorted, straight, matrix_of(kArdrone), coefficients_of(kArdrone),
                          cv::noArray(), cv::noArray(), to_the_end);
      Vec3 ray;
      TEST_ASSERT_TRUE(tv::unproject(camera, Vec2(x, y), &ray, nullptr));
      TEST_ASSERT_DOUBLE_WITHIN(1e-9, straight.at<cv::Vec2d>(0)[0], ray[0] / ray[2]);
      TEST_ASSERT_DOUBLE_WITHIN(1e-9, straight.at<cv::Vec2d>(0)[1], ray[1] / ray[2]);
    }
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_ardrone_projects_as_in_opencv);
  RUN_TEST(test_tum_fr1_projects_as_in_opencv);
  RUN_TEST(test_rational_model_projects_as_in_opencv);
  RUN_TEST(test_fisheye_projects_as_in_opencv);
  RUN_TEST(test_undistortion_agrees_with_opencvs_iterated_to_the_end);
  return UNITY_END();
}
