// Triangulation compared with OpenCV. Linear-Eigen equals its triangulatePoints, with which the
// other methods agree without noise and to first order in the noise. Poly corrects pixels as its
// correctMatches does, and at a cost that is not higher where correctMatches misses the minimum.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/calib3d.hpp>

#include "base/random.h"
#include "triangulation/triangulation.h"
// unity.h comes after OpenCV: it defines isnan and isinf as macros.
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
  const cv::Matx34d P1 = K * cv::Matx34d(R(0, 0), R(0, 1), R(0, 2), t[0], R(1, 0), R(1, 1), R(1, 2),
                                         t[1], R(2, 0), R(2, 1), R(2, 2), t[2]);
  const cv::Mat x0 = (cv::Mat_<double>(2, 1) << pixel0[0], pixel0[1]);
  const cv::Mat x1 = (cv::Mat_<double>(2, 1) << pixel1[0], pixel1[1]);
  cv::Mat X;
  cv::triangulatePoints(P0, P1, x0, x1, X);
  return Vec3(X.at<double>(0), X.at<double>(1), X.at<double>(2)) / X.at<double>(3);
}

// The largest difference from OpenCV over many points, in units of the depth, when both coordinates
// of the pixels have errors of up to noise_px.
double largest_difference(tv_triangulation method, double noise_px) {
  const tv::Camera camera = tv::prepare_camera(kCamera);
  Mat3 R;  // a rotation by 0.1 rad about the y axis
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

// Without noise the method must agree with OpenCV's. With errors of 0.1 px the two may differ by
// `bound`, in units of the depth: a pixel of noise moves a point by 1 / 500 of its depth or more,
// and the methods distribute the distance between the two rays differently, which is small beside
// that movement. With a tenth of the noise the difference is less than a fifth.
void check(tv_triangulation method, double bound = 2e-4) {
  TEST_ASSERT_TRUE(largest_difference(method, 0) < 1e-11);
  const double at_small = largest_difference(method, 0.01);
  const double at_large = largest_difference(method, 0.1);
  TEST_ASSERT_TRUE(at_large < bound);
  TEST_ASSERT_TRUE(at_large > 5 * at_small);
}

Mat3 rotation(double x, double y, double z) {
  return (Eigen::AngleAxisd(x, Vec3::UnitX()) * Eigen::AngleAxisd(y, Vec3::UnitY()) *
          Eigen::AngleAxisd(z, Vec3::UnitZ()))
      .toRotationMatrix();
}

Mat3 fundamental(const Mat3& R, const Vec3& t) {
  Mat3 K_inverse;
  K_inverse << 1 / kCamera.fx, 0, -kCamera.cx / kCamera.fx, 0, 1 / kCamera.fy,
      -kCamera.cy / kCamera.fy, 0, 0, 1;
  Mat3 cross;
  cross << 0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0;
  return K_inverse.transpose() * cross * R * K_inverse;
}

struct Corrected {
  Vec2 pixel[2];
};

Corrected corrected_by_opencv(const Mat3& F, const Vec2& pixel0, const Vec2& pixel1) {
  const cv::Matx33d Fm(F(0, 0), F(0, 1), F(0, 2), F(1, 0), F(1, 1), F(1, 2), F(2, 0), F(2, 1),
                       F(2, 2));
  const cv::Mat x0(1, 1, CV_64FC2, cv::Scalar(pixel0[0], pixel0[1]));
  const cv::Mat x1(1, 1, CV_64FC2, cv::Scalar(pixel1[0], pixel1[1]));
  cv::Mat y0, y1;
  cv::correctMatches(Fm, x0, x1, y0, y1);
  const cv::Vec2d a = y0.at<cv::Vec2d>(0), b = y1.at<cv::Vec2d>(0);
  return Corrected{{Vec2(a[0], a[1]), Vec2(b[0], b[1])}};
}

Corrected corrected_by_us(const Mat3& R, const Vec3& t, const Vec2& pixel0, const Vec2& pixel1) {
  const tv::Camera camera = tv::prepare_camera(kCamera);
  Corrected corrected;
  TEST_ASSERT_TRUE(tv::correct_pixels(TV_TRIANGULATION_POLY,
                                      tv::prepare_triangulation(camera, camera, R, t), pixel0,
                                      pixel1, corrected.pixel));
  return corrected;
}

// cost_of: the root of the sum of squared corrections in pixels. miss_of: to first order, how far
// the corrected pixels are from satisfying the epipolar constraint.
double cost_of(const Corrected& c, const Vec2& pixel0, const Vec2& pixel1) {
  return std::sqrt((c.pixel[0] - pixel0).squaredNorm() + (c.pixel[1] - pixel1).squaredNorm());
}

double miss_of(const Corrected& c, const Mat3& F) {
  const Vec3 x0(c.pixel[0][0], c.pixel[0][1], 1), x1(c.pixel[1][0], c.pixel[1][1], 1);
  const Vec3 l1 = F * x0, l0 = F.transpose() * x1;
  return std::fabs(x1.dot(l1)) / std::sqrt(l1.head<2>().squaredNorm() + l0.head<2>().squaredNorm());
}

}  // namespace

void test_linear_ls_agrees_with_opencv(void) { check(TV_TRIANGULATION_LINEAR_LS); }
void test_iterative_ls_agrees_with_opencv(void) { check(TV_TRIANGULATION_ITERATIVE_LS); }
void test_midpoint_agrees_with_opencv(void) { check(TV_TRIANGULATION_MIDPOINT); }

void test_linear_eigen_is_triangulate_points(void) {
  TEST_ASSERT_TRUE(largest_difference(TV_TRIANGULATION_LINEAR_EIGEN, 0) < 1e-11);
  TEST_ASSERT_TRUE(largest_difference(TV_TRIANGULATION_LINEAR_EIGEN, 1) < 1e-11);
  TEST_ASSERT_TRUE(largest_difference(TV_TRIANGULATION_LINEAR_EIGEN, 10) < 1e-11);
}
void test_iterative_eigen_agrees_with_opencv(void) { check(TV_TRIANGULATION_ITERATIVE_EIGEN); }
void test_poly_agrees_with_opencv(void) { check(TV_TRIANGULATION_POLY); }
// Poly-Abs moves the pixel of one image only, by the whole correction.
void test_poly_abs_agrees_with_opencv(void) { check(TV_TRIANGULATION_POLY_ABS, 4e-4); }

// correctMatches solves its polynomial to a few digits only: compared with a solution of 40 digits,
// its pixels were wrong by 5e-3 at 3 pixels of noise, ours by 1.1e-13. Its error is smaller with
// less noise.
void test_poly_corrects_as_correct_matches_does(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const tv::Camera camera = tv::prepare_camera(kCamera);
  for (double noise_px : {0.02, 0.5, 3.0}) {
    double largest = 0;
    int far = 0;
    for (int i = 0; i < 5000; ++i) {
      const Mat3 R = rotation(uniform(&random, -0.3, 0.3), uniform(&random, -0.3, 0.3),
                              uniform(&random, -0.3, 0.3));
      const Vec3 t =
          Vec3(uniform(&random, -1, 1), uniform(&random, -1, 1), uniform(&random, -0.5, 0.5))
              .normalized();
      const Vec3 point0 = uniform(&random, 3, 20) *
                          Vec3(uniform(&random, -0.5, 0.5), uniform(&random, -0.4, 0.4), 1);
      Vec2 pixels[2];
      TEST_ASSERT_TRUE(tv::project(camera, point0, &pixels[0], nullptr));
      TEST_ASSERT_TRUE(tv::project(camera, R * point0 + t, &pixels[1], nullptr));
      for (Vec2& pixel : pixels) {
        pixel[0] += uniform(&random, -noise_px, noise_px);
        pixel[1] += uniform(&random, -noise_px, noise_px);
      }
      const Corrected ours = corrected_by_us(R, t, pixels[0], pixels[1]);
      const Corrected theirs = corrected_by_opencv(fundamental(R, t), pixels[0], pixels[1]);
      const double difference = std::max((ours.pixel[0] - theirs.pixel[0]).norm(),
                                         (ours.pixel[1] - theirs.pixel[1]).norm());
      largest = std::max(largest, difference);
      far += difference > 1e-6;
      // Near the minimum the cost's square grows with the square of the distance from it.
      const double cost = cost_of(ours, pixels[0], pixels[1]);
      const double their_cost = cost_of(theirs, pixels[0], pixels[1]);
      const double excess = std::max(their_cost * their_cost - cost * cost, 0.0);
      TEST_ASSERT_TRUE(difference < 1e-6 + 2 * std::sqrt(excess));
    }
    std::printf("noise %g px: %d of 5000 over 1e-6 px from correctMatches, the farthest %.2g px\n",
                noise_px, far, largest);
    TEST_ASSERT_TRUE(noise_px > 0.1 || far <= 5);
  }
}

void test_poly_costs_no_more_than_correct_matches_in_hard_places(void) {
  tv::Random random = tv::random_seeded(kSeed);
  int cheaper = 0, missed = 0;
  double most = 0;
  for (int i = 0; i < 20000; ++i) {
    const bool sideways = i % 4 == 3;
    const Mat3 R = sideways ? Mat3(Mat3::Identity())
                            : rotation(uniform(&random, -0.1, 0.1), uniform(&random, -0.1, 0.1), 0);
    const Vec3 t =
        Vec3(uniform(&random, -0.4, 0.4) + (sideways ? 1 : 0), uniform(&random, -0.4, 0.4),
             sideways    ? 0
             : i % 8 < 4 ? -1
                         : 1)
            .normalized();
    const Vec3 center = R.transpose() * t;
    Vec2 pixels[2];
    if (sideways) {  // both epipoles are at infinity
      pixels[0] = Vec2(uniform(&random, 0, 640), uniform(&random, 0, 480));
      pixels[1] = pixels[0] + Vec2(uniform(&random, -1, 1), uniform(&random, -1, 1));
    } else {  // both pixels are near their epipoles
      const double off = std::exp2(uniform(&random, -10, 5));
      const Vec3 epipoles[2] = {center / center[2], t / t[2]};
      for (int k = 0; k < 2; ++k) {
        pixels[k] = Vec2(kCamera.fx * epipoles[k][0] + kCamera.cx + off * uniform(&random, -1, 1),
                         kCamera.fy * epipoles[k][1] + kCamera.cy + off * uniform(&random, -1, 1));
      }
    }
    const Mat3 F = fundamental(R, t);
    const Corrected theirs = corrected_by_opencv(F, pixels[0], pixels[1]);
    const double ours = cost_of(corrected_by_us(R, t, pixels[0], pixels[1]), pixels[0], pixels[1]);
    const double cost = cost_of(theirs, pixels[0], pixels[1]);
    if (!(miss_of(theirs, F) < 1e-6)) {  // OpenCV's result does not satisfy the epipolar constraint
      ++missed;
      continue;
    }
    TEST_ASSERT_TRUE(ours <= cost * (1 + 1e-7) + 1e-6);
    if (cost > ours * 1.001 + 1e-6) {
      ++cheaper;
      most = std::max(most, cost / ours - 1);
    }
  }
  std::printf("correctMatches: %d of 20000 do not meet, %d cost over 0.1 %% more, up to %.2g\n",
              missed, cheaper, most);
  TEST_ASSERT_TRUE(missed + cheaper < 20000);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_linear_ls_agrees_with_opencv);
  RUN_TEST(test_iterative_ls_agrees_with_opencv);
  RUN_TEST(test_midpoint_agrees_with_opencv);
  RUN_TEST(test_linear_eigen_is_triangulate_points);
  RUN_TEST(test_iterative_eigen_agrees_with_opencv);
  RUN_TEST(test_poly_agrees_with_opencv);
  RUN_TEST(test_poly_abs_agrees_with_opencv);
  RUN_TEST(test_poly_corrects_as_correct_matches_does);
  RUN_TEST(test_poly_costs_no_more_than_correct_matches_in_hard_places);
  return UNITY_END();
}
