// Triangulation against OpenCV's triangulatePoints, the homogeneous linear method of Hartley &
// Sturm (Linear-Eigen): equal without noise, and equal to first order in the noise.
#include <opencv2/calib3d.hpp>

#include <cmath>

#include "base/random.h"
#include "geometry/triangulation.h"
// After OpenCV: unity.h takes isnan and isinf as macros.
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr uint64_t kSeed = 5;
const tv_camera kCamera = {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {}};

double uniform(tv::Random* random, double low, double high) {
  return low + (high - low) * (tv::random_next(*random) * 0x1p-32);
}

Vec3 triangulated_by_opencv(const Mat3& R, const Vec3& t, const Vec2& pixel0, const Vec2& pixel1) {
  const cv::Matx33d K(kCamera.fx, 0, kCamera.cx, 0, kCamera.fy, kCamera.cy, 0, 0, 1);
  const cv::Matx34d P0 = K * cv::Matx34d::eye();
  const cv::Matx34d P1 = K * cv::Matx34d(R(0, 0), R(0, 1), R(0, 2), t[0], R(1, 0), R(1, 1),
                                         R(1, 2), t[1], R(2, 0), R(2, 1), R(2, 2), t[2]);
  const cv::Mat x0 = (cv::Mat_<double>(2, 1) << pixel0[0], pixel0[1]);
  const cv::Mat x1 = (cv::Mat_<double>(2, 1) << pixel1[0], pixel1[1]);
  cv::Mat X;
  cv::triangulatePoints(P0, P1, x0, x1, X);
  return Vec3(X.at<double>(0), X.at<double>(1), X.at<double>(2)) / X.at<double>(3);
}

// The largest difference from OpenCV over many points, in units of the depth, when the pixels are
// off by up to noise_px.
double largest_difference(tv_triangulation method, double noise_px) {
  const tv::Camera camera = tv::prepare_camera(kCamera);
  Mat3 R;  // a turn of 0.1 about y
  R << std::cos(0.1), 0, std::sin(0.1), 0, 1, 0, -std::sin(0.1), 0, std::cos(0.1);
  const Vec3 t(-0.96, 0.28, 0);
  tv::Random random = tv::random_seeded(kSeed);
  double largest = 0;
  for (int i = 0; i < 2000; ++i) {
    const double depth = uniform(&random, 2, 6);
    const Vec3 point0 = depth * Vec3(uniform(&random, -0.3, 0.3), uniform(&random, -0.3, 0.3), 1);
    Vec2 pixels[2];
    TEST_ASSERT_TRUE(tv::project(camera, point0, &pixels[0], nullptr));
    TEST_ASSERT_TRUE(tv::project(camera, R * point0 + t, &pixels[1], nullptr));
    for (Vec2& pixel : pixels) {
      pixel[0] += uniform(&random, -noise_px, noise_px);
      pixel[1] += uniform(&random, -noise_px, noise_px);
    }
    tv_point point;
    tv::triangulate_point(method, camera, camera, R, t, pixels[0], pixels[1], &point);
    TEST_ASSERT_EQUAL_INT(TV_POINT_OK, point.status);
    const Vec3 position(point.position[0], point.position[1], point.position[2]);
    const Vec3 expected = triangulated_by_opencv(R, t, pixels[0], pixels[1]);
    largest = std::fmax(largest, (position - expected).norm() / depth);
  }
  return largest;
}

// A pixel of noise moves the point itself by 1 / 500 of its depth and more. What the methods differ
// by is of the same order in the direction off the rays (they share out the skew differently), but
// small beside it.
void check(tv_triangulation method) {
  TEST_ASSERT_TRUE(largest_difference(method, 0) < 1e-11);
  const double at_small = largest_difference(method, 0.01);
  const double at_large = largest_difference(method, 0.1);
  TEST_ASSERT_TRUE(at_large < 2e-4);
  TEST_ASSERT_TRUE(at_large > 5 * at_small);
}

}  // namespace

void test_linear_ls_agrees_with_opencv(void) { check(TV_TRIANGULATION_LINEAR_LS); }
void test_iterative_ls_agrees_with_opencv(void) { check(TV_TRIANGULATION_ITERATIVE_LS); }
void test_midpoint_agrees_with_opencv(void) { check(TV_TRIANGULATION_MIDPOINT); }

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_linear_ls_agrees_with_opencv);
  RUN_TEST(test_iterative_ls_agrees_with_opencv);
  RUN_TEST(test_midpoint_agrees_with_opencv);
  return UNITY_END();
}
