// Triangulation: exact points, an independent formula for each method, and every status.
#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/random.h"
#include "triangulation/triangulation.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using tv::Camera;
using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr uint64_t kSeed = 11;
const tv_triangulation kMethods[] = {
    TV_TRIANGULATION_POLY,      TV_TRIANGULATION_POLY_ABS,        TV_TRIANGULATION_LINEAR_EIGEN,
    TV_TRIANGULATION_LINEAR_LS, TV_TRIANGULATION_ITERATIVE_EIGEN, TV_TRIANGULATION_ITERATIVE_LS,
    TV_TRIANGULATION_MIDPOINT};
const Mat3 kIdentity = Mat3::Identity();
const Vec3 kSideways(-1, 0, 0);

tv_camera pinhole() { return tv_camera{TV_CAMERA_PINHOLE, 640, 480, 0, 500, 510, 320, 240, {}}; }

tv_camera distorted() {
  return tv_camera{TV_CAMERA_BROWN_CONRADY,
                   752,
                   480,
                   0,
                   458.654,
                   457.296,
                   367.215,
                   248.375,
                   {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}};
}

tv_camera fisheye() {
  return tv_camera{TV_CAMERA_KANNALA_BRANDT, 800, 800, 0, 220, 221, 399.5, 399.5,
                   {0.01, -0.003, 0.0002, 0}};
}

double uniform(tv::Random* random, double low, double high) {
  return low + (high - low) * (tv::random_next(*random) * 0x1p-32);
}

// Approximately normal with the standard deviation sigma: a sum of 4 uniform numbers.
double noise(tv::Random* random, double sigma) {
  double sum = 0;
  for (int i = 0; i < 4; ++i) sum += uniform(random, -1, 1);
  return sum * sigma * std::sqrt(0.75);
}

Mat3 rotation(double x, double y, double z) {
  return (Eigen::AngleAxisd(x, Vec3::UnitX()) * Eigen::AngleAxisd(y, Vec3::UnitY()) *
          Eigen::AngleAxisd(z, Vec3::UnitZ()))
      .toRotationMatrix();
}

Vec2 seen(const Camera& camera, const Vec3& point) {
  Vec2 pixel;
  if (!tv::project(camera, point, &pixel, nullptr)) TEST_FAIL_MESSAGE("the scene is not seen");
  return pixel;
}

Vec3 position(const tv_point& point) {
  return Vec3(point.position[0], point.position[1], point.position[2]);
}

tv_point triangulated(tv_triangulation method, const Camera& camera0, const Camera& camera1,
                      const Mat3& R, const Vec3& t, const Vec2& pixel0, const Vec2& pixel1) {
  tv_point point;
  std::memset(&point, 0xff, sizeof point);
  tv::triangulate_point(method, camera0, camera1, R, t, pixel0, pixel1, &point);
  for (double value : point.position) TEST_ASSERT_TRUE(std::fabs(value) <= 1.7976931348623157e308);
  TEST_ASSERT_TRUE(point.angle_rad >= 0 && point.angle_rad <= 3.1415928f);
  TEST_ASSERT_TRUE(point.error_px >= 0 && point.error_px <= std::numeric_limits<float>::max());
  TEST_ASSERT_EQUAL_INT(0, point.reserved);
  return point;
}

// Hartley & Sturm's equations u p3 - p1 and v p3 - p2 of both images in pixels, each image's
// divided by its weight, solved by QR.
Vec3 linear_ls_by_qr(const tv_camera& camera0, const tv_camera& camera1, const Mat3& R,
                     const Vec3& t, const Vec2& pixel0, const Vec2& pixel1, double w0, double w1) {
  const tv_camera* cameras[2] = {&camera0, &camera1};
  const Vec2 pixels[2] = {pixel0, pixel1};
  const double weights[2] = {w0, w1};
  Eigen::Matrix<double, 4, 3> A;
  Eigen::Matrix<double, 4, 1> b;
  for (int i = 0; i < 2; ++i) {
    Eigen::Matrix<double, 3, 4> P;
    P.setIdentity();
    if (i == 1) P << R, t;
    Mat3 K;
    K << cameras[i]->fx, 0, cameras[i]->cx, 0, cameras[i]->fy, cameras[i]->cy, 0, 0, 1;
    P = K * P;
    for (int row = 0; row < 2; ++row) {
      const Eigen::Matrix<double, 1, 4> equation =
          (pixels[i][row] * P.row(2) - P.row(row)) / weights[i];
      A.row(2 * i + row) = equation.head<3>();
      b[2 * i + row] = -equation[3];
    }
  }
  return A.colPivHouseholderQr().solve(b);
}

// Checks that (X, 1) is the smallest singular vector of the same equations in (X, W), with R a
// rotation and |t| 1. The check multiplies by A itself, since with two equal smallest values every
// vector between their vectors is right.
void expect_singular_vector(const tv_camera& camera0, const tv_camera& camera1, const Mat3& R,
                            const Vec3& t, const Vec2& pixel0, const Vec2& pixel1, double w0,
                            double w1, const tv_point& point) {
  const tv_camera* cameras[2] = {&camera0, &camera1};
  const Vec2 pixels[2] = {pixel0, pixel1};
  const double weights[2] = {w0, w1};
  Eigen::Matrix4d A;
  for (int i = 0; i < 2; ++i) {
    Eigen::Matrix<double, 3, 4> P;
    P.setIdentity();
    if (i == 1) P << R, t;
    Mat3 K;
    K << cameras[i]->fx, 0, cameras[i]->cx, 0, cameras[i]->fy, cameras[i]->cy, 0, 0, 1;
    P = K * P;
    for (int row = 0; row < 2; ++row) {
      A.row(2 * i + row) = (pixels[i][row] * P.row(2) - P.row(row)) / weights[i];
    }
  }
  const Eigen::JacobiSVD<Eigen::Matrix4d> svd(A, Eigen::ComputeFullV);
  const Eigen::Vector4d s = svd.singularValues();
  Eigen::Vector4d ours(point.position[0], point.position[1], point.position[2], 1);
  if (point.status == TV_POINT_INFINITE) ours[3] = 0;
  ours.normalize();
  const double gap = (s[2] - s[3]) / s[0];
  TEST_ASSERT_TRUE((A * ours).norm() <= s[3] * (1 + 1e-9) + 1e-12 * s[0]);
  const Eigen::Vector4d across = ours - svd.matrixV().col(3) * svd.matrixV().col(3).dot(ours);
  TEST_ASSERT_TRUE(across.norm() <= 1e-12 / gap);
}

struct Scene {
  Mat3 R;
  Vec3 t, point0, point1;
};

// A point in front of both cameras, at a depth of 2 to 10 baselines.
Scene random_scene(tv::Random* random) {
  Scene scene;
  scene.R =
      rotation(uniform(random, -0.2, 0.2), uniform(random, -0.2, 0.2), uniform(random, -0.3, 0.3));
  scene.t = Vec3(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -0.3, 0.3));
  scene.t.normalize();
  const double depth = uniform(random, 2, 10);
  scene.point0 = depth * Vec3(uniform(random, -0.25, 0.25), uniform(random, -0.25, 0.25), 1);
  scene.point1 = scene.R * scene.point0 + scene.t;
  return scene;
}

}  // namespace

void test_exact_points_are_recovered_by_every_method_and_lens(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera cameras[3] = {tv::prepare_camera(pinhole()), tv::prepare_camera(distorted()),
                             tv::prepare_camera(fisheye())};
  for (int i = 0; i < 3000; ++i) {
    const Scene scene = random_scene(&random);
    const Camera& camera0 = cameras[i % 3];
    const Camera& camera1 = cameras[i / 3 % 3];
    for (tv_triangulation method : kMethods) {
      const tv_point point = triangulated(method, camera0, camera1, scene.R, scene.t,
                                          seen(camera0, scene.point0), seen(camera1, scene.point1));
      TEST_ASSERT_EQUAL_INT(TV_POINT_OK, point.status);
      TEST_ASSERT_TRUE((position(point) - scene.point0).norm() < 1e-9);
      TEST_ASSERT_TRUE(point.error_px < 1e-6f);
      const Vec3 from1 = scene.point0 + scene.R.transpose() * scene.t;
      const double angle = std::atan2(scene.point0.cross(from1).norm(), scene.point0.dot(from1));
      TEST_ASSERT_DOUBLE_WITHIN(1e-6, angle, point.angle_rad);
    }
  }
}

void test_far_points_keep_the_digits_that_their_parallax_has(void) {
  const Camera camera = tv::prepare_camera(pinhole());
  for (double depth = 10; depth < 1e10; depth *= 10) {
    const Vec3 point0 = depth * Vec3(0.1, -0.2, 1);
    for (tv_triangulation method : kMethods) {
      const tv_point point = triangulated(method, camera, camera, kIdentity, kSideways,
                                          seen(camera, point0), seen(camera, point0 + kSideways));
      TEST_ASSERT_EQUAL_INT(TV_POINT_OK, point.status);
      TEST_ASSERT_DOUBLE_WITHIN(4e-15 * depth, 0, (position(point) - point0).norm() / depth);
    }
  }
}

void test_points_beside_and_behind_the_image_plane_of_a_fisheye_are_found(void) {
  const Camera camera = tv::prepare_camera(fisheye());
  const Vec3 points[] = {Vec3(3, 1, -0.5), Vec3(-2, 2, -1), Vec3(0.5, 4, 0), Vec3(2, 0, 1e-12)};
  const Vec3 up(0.3, -0.8, 0.2);
  for (const Vec3& point0 : points) {
    for (tv_triangulation method : kMethods) {
      const tv_point point = triangulated(method, camera, camera, kIdentity, up,
                                          seen(camera, point0), seen(camera, point0 + up));
      TEST_ASSERT_EQUAL_INT(TV_POINT_OK, point.status);
      TEST_ASSERT_TRUE((position(point) - point0).norm() < 1e-9);
    }
  }
}

void test_linear_ls_equals_hartley_and_sturms_equations_solved_by_qr(void) {
  tv::Random random = tv::random_seeded(kSeed);
  tv_camera other = pinhole();
  other.fx = 700, other.fy = 650, other.cx = 300;
  const Camera camera0 = tv::prepare_camera(pinhole());
  const Camera camera1 = tv::prepare_camera(other);
  for (int i = 0; i < 2000; ++i) {
    const Scene scene = random_scene(&random);
    const Vec2 pixel0 = seen(camera0, scene.point0) + Vec2(noise(&random, 1), noise(&random, 1));
    const Vec2 pixel1 = seen(camera1, scene.point1) + Vec2(noise(&random, 1), noise(&random, 1));
    const tv_point point = triangulated(TV_TRIANGULATION_LINEAR_LS, camera0, camera1, scene.R,
                                        scene.t, pixel0, pixel1);
    const Vec3 expected = linear_ls_by_qr(pinhole(), other, scene.R, scene.t, pixel0, pixel1, 1, 1);
    TEST_ASSERT_TRUE((position(point) - expected).norm() < 1e-9 * expected.norm());
  }
}

void test_linear_ls_of_a_fisheye_equals_equations_on_the_viewing_sphere(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera camera = tv::prepare_camera(fisheye());
  for (int i = 0; i < 2000; ++i) {
    const Vec3 point0(uniform(&random, -3, 3), uniform(&random, 1, 3), uniform(&random, -1, 2));
    const Mat3 R = rotation(uniform(&random, -0.1, 0.1), 0.1, uniform(&random, -3, 3));
    const Vec3 t(0.4, -0.3, 0.2);
    const Vec2 pixel0 = seen(camera, point0) + Vec2(noise(&random, 1), noise(&random, 1));
    const Vec2 pixel1 = seen(camera, R * point0 + t) + Vec2(noise(&random, 1), noise(&random, 1));
    Vec3 ray0, ray1;
    TEST_ASSERT_TRUE(tv::unproject(camera, pixel0, &ray0, nullptr));
    TEST_ASSERT_TRUE(tv::unproject(camera, pixel1, &ray1, nullptr));
    // Reference: the point X of the least sum of squared distances from the two lines of sight,
    // solved by QR. (I - d d^T) (X - centre) is the vector from a line with direction d to X,
    // whatever basis the method uses.
    Eigen::Matrix<double, 6, 3> A;
    Eigen::Matrix<double, 6, 1> b;
    A << kIdentity - ray0 * ray0.transpose(), (kIdentity - ray1 * ray1.transpose()) * R;
    b << Vec3::Zero(), -(kIdentity - ray1 * ray1.transpose()) * t;
    const Vec3 expected = A.colPivHouseholderQr().solve(b);
    const tv_point point =
        triangulated(TV_TRIANGULATION_LINEAR_LS, camera, camera, R, t, pixel0, pixel1);
    TEST_ASSERT_TRUE((position(point) - expected).norm() < 1e-9 * (1 + expected.norm()));
  }
}

void test_iterative_ls_is_the_fixed_point_of_its_weights(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera camera = tv::prepare_camera(pinhole());
  double moved = 0;
  for (int i = 0; i < 2000; ++i) {
    const Scene scene = random_scene(&random);
    const Vec2 pixel0 = seen(camera, scene.point0) + Vec2(noise(&random, 1), noise(&random, 1));
    const Vec2 pixel1 = seen(camera, scene.point1) + Vec2(noise(&random, 1), noise(&random, 1));
    const tv_point point = triangulated(TV_TRIANGULATION_ITERATIVE_LS, camera, camera, scene.R,
                                        scene.t, pixel0, pixel1);
    const Vec3 at = position(point);
    const double w1 = (scene.R * at + scene.t)[2];
    const Vec3 again =
        linear_ls_by_qr(pinhole(), pinhole(), scene.R, scene.t, pixel0, pixel1, at[2], w1);
    TEST_ASSERT_TRUE((again - at).norm() < 1e-8 * at.norm());
    const Vec3 linear =
        linear_ls_by_qr(pinhole(), pinhole(), scene.R, scene.t, pixel0, pixel1, 1, 1);
    moved = std::max(moved, (linear - at).norm());
  }
  TEST_ASSERT_TRUE(moved > 1e-5);  // the weights changed some point
}

void test_linear_eigen_is_the_smallest_singular_vector(void) {
  tv::Random random = tv::random_seeded(kSeed);
  tv_camera other = pinhole();
  other.fx = 700, other.fy = 650, other.cx = 300;
  const Camera camera0 = tv::prepare_camera(pinhole());
  const Camera camera1 = tv::prepare_camera(other);
  for (int i = 0; i < 5000; ++i) {
    const Scene scene = random_scene(&random);
    // The noise goes up to values at which the two smallest singular values are often nearly equal.
    const double sigma = i % 3 == 0 ? 0.5 : i % 3 == 1 ? 5 : 100;
    const Vec2 pixel0 =
        seen(camera0, scene.point0) + Vec2(noise(&random, sigma), noise(&random, sigma));
    const Vec2 pixel1 =
        seen(camera1, scene.point1) + Vec2(noise(&random, sigma), noise(&random, sigma));
    const tv_point point = triangulated(TV_TRIANGULATION_LINEAR_EIGEN, camera0, camera1, scene.R,
                                        scene.t, pixel0, pixel1);
    expect_singular_vector(pinhole(), other, scene.R, scene.t, pixel0, pixel1, 1, 1, point);
  }
}

void test_iterative_eigen_is_the_fixed_point_of_its_weights(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera camera = tv::prepare_camera(pinhole());
  double moved = 0;
  for (int i = 0; i < 2000; ++i) {
    const Scene scene = random_scene(&random);
    const Vec2 pixel0 = seen(camera, scene.point0) + Vec2(noise(&random, 1), noise(&random, 1));
    const Vec2 pixel1 = seen(camera, scene.point1) + Vec2(noise(&random, 1), noise(&random, 1));
    const tv_point point = triangulated(TV_TRIANGULATION_ITERATIVE_EIGEN, camera, camera, scene.R,
                                        scene.t, pixel0, pixel1);
    const double w1 = (scene.R * position(point) + scene.t)[2];
    expect_singular_vector(pinhole(), pinhole(), scene.R, scene.t, pixel0, pixel1,
                           point.position[2], w1, point);
    const tv_point linear = triangulated(TV_TRIANGULATION_LINEAR_EIGEN, camera, camera, scene.R,
                                         scene.t, pixel0, pixel1);
    moved = std::max(moved, (position(linear) - position(point)).norm());
  }
  TEST_ASSERT_TRUE(moved > 1e-5);
}

void test_correction_of_a_fisheye_is_least_on_its_tangent_planes(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera camera = tv::prepare_camera(fisheye());
  for (int i = 0; i < 300; ++i) {
    const Vec3 point0(uniform(&random, -3, 3), uniform(&random, 1, 3), uniform(&random, -1, 2));
    const Mat3 R = rotation(uniform(&random, -0.1, 0.1), 0.1, uniform(&random, -3, 3));
    const Vec3 t = Vec3(0.4, -0.3, 0.2).normalized();
    const Vec2 pixel0 = seen(camera, point0) + Vec2(noise(&random, 1), noise(&random, 1));
    const Vec2 pixel1 = seen(camera, R * point0 + t) + Vec2(noise(&random, 1), noise(&random, 1));
    Vec3 ray[2];
    TEST_ASSERT_TRUE(tv::unproject(camera, pixel0, &ray[0], nullptr));
    TEST_ASSERT_TRUE(tv::unproject(camera, pixel1, &ray[1], nullptr));
    const tv::TriangulationPair pair = tv::prepare_triangulation(camera, camera, R, t);
    for (const bool squared : {true, false}) {
      // The tangent of the angle between a ray and a plane with unit normal n, in pixels.
      const auto cost_of = [&](const Vec3& n) {
        double sum = 0;
        for (int k = 0; k < 2; ++k) {
          const double sine = ray[k].dot(k == 0 ? n : Vec3(R * n));
          const double sq = sine * sine / (1 - sine * sine) * 220 * 221;
          sum += squared ? sq : std::sqrt(sq);
        }
        return sum;
      };
      const tv::Correction correction =
          tv::correct_match(squared ? TV_TRIANGULATION_POLY : TV_TRIANGULATION_POLY_ABS, pair,
                            tv::frame_of(camera, ray[0]), tv::frame_of(camera, ray[1]));
      double moved = 0;
      for (int k = 0; k < 2; ++k) {
        const double sq = correction.step[k][0] * correction.step[k][0] +
                          correction.step[k][1] * correction.step[k][1];
        moved += squared ? sq : std::sqrt(sq);
        const Vec3 off = ray[k] - correction.ray[k];
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, std::sqrt(sq), off.norm() * std::sqrt(220.0 * 221.0));
      }
      const Vec3 center = -(R.transpose() * t);
      const Vec3 plane = center.cross(correction.ray[0]).normalized();
      TEST_ASSERT_TRUE(std::fabs(plane.dot(R.transpose() * correction.ray[1])) < 1e-14);
      TEST_ASSERT_DOUBLE_WITHIN(1e-9 * (1 + moved), moved, cost_of(plane));
      for (int k = 0; k < 2000; ++k) {
        const Vec3 turned = Eigen::AngleAxisd(k * 3.14159265358979 / 2000, center) * plane;
        TEST_ASSERT_TRUE(moved <= cost_of(turned) * (1 + 1e-9) + 1e-12);
      }
    }
  }
}

void test_midpoint_equals_the_point_nearest_to_both_lines(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera camera = tv::prepare_camera(distorted());
  for (int i = 0; i < 2000; ++i) {
    const Scene scene = random_scene(&random);
    const Vec2 pixel0 = seen(camera, scene.point0) + Vec2(noise(&random, 1), noise(&random, 1));
    const Vec2 pixel1 = seen(camera, scene.point1) + Vec2(noise(&random, 1), noise(&random, 1));
    Vec3 ray0, ray1;
    TEST_ASSERT_TRUE(tv::unproject(camera, pixel0, &ray0, nullptr));
    TEST_ASSERT_TRUE(tv::unproject(camera, pixel1, &ray1, nullptr));
    // The least sum of squared distances to the lines: sum (I - d d^T) (X - c) = 0.
    const Vec3 d1 = scene.R.transpose() * ray1;
    const Vec3 c1 = -(scene.R.transpose() * scene.t);
    const Mat3 off0 = kIdentity - ray0 * ray0.transpose();
    const Mat3 off1 = kIdentity - d1 * d1.transpose();
    const Mat3 sum = off0 + off1;
    const Vec3 expected = sum.ldlt().solve(Vec3(off1 * c1));
    const tv_point point =
        triangulated(TV_TRIANGULATION_MIDPOINT, camera, camera, scene.R, scene.t, pixel0, pixel1);
    TEST_ASSERT_TRUE((position(point) - expected).norm() < 1e-9 * expected.norm());
  }
}

void test_error_is_the_rms_reprojection_through_the_lens(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera cameras[2] = {tv::prepare_camera(distorted()), tv::prepare_camera(fisheye())};
  for (int i = 0; i < 500; ++i) {
    const Scene scene = random_scene(&random);
    const Camera& camera = cameras[i % 2];
    const Vec2 pixel0 = seen(camera, scene.point0) + Vec2(noise(&random, 2), noise(&random, 2));
    const Vec2 pixel1 = seen(camera, scene.point1) + Vec2(noise(&random, 2), noise(&random, 2));
    for (tv_triangulation method : kMethods) {
      const tv_point point = triangulated(method, camera, camera, scene.R, scene.t, pixel0, pixel1);
      const Vec3 at = position(point);
      const double squares = (seen(camera, at) - pixel0).squaredNorm() +
                             (seen(camera, scene.R * at + scene.t) - pixel1).squaredNorm();
      TEST_ASSERT_DOUBLE_WITHIN(1e-5, std::sqrt(squares / 2), point.error_px);
    }
  }
}

void test_iterative_ls_has_no_more_error_than_midpoint_under_noise(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera camera = tv::prepare_camera(pinhole());
  double sum[7] = {};
  for (int i = 0; i < 5000; ++i) {
    const Scene scene = random_scene(&random);
    const Vec2 pixel0 = seen(camera, scene.point0) + Vec2(noise(&random, 1), noise(&random, 1));
    const Vec2 pixel1 = seen(camera, scene.point1) + Vec2(noise(&random, 1), noise(&random, 1));
    for (tv_triangulation method : kMethods) {
      const tv_point point = triangulated(method, camera, camera, scene.R, scene.t, pixel0, pixel1);
      if (point.status == TV_POINT_OK) sum[method] += point.error_px;
    }
  }
  TEST_ASSERT_TRUE(sum[TV_TRIANGULATION_ITERATIVE_LS] <= sum[TV_TRIANGULATION_LINEAR_LS]);
  TEST_ASSERT_TRUE(sum[TV_TRIANGULATION_ITERATIVE_LS] <= sum[TV_TRIANGULATION_MIDPOINT]);
}

void test_parallel_rays_are_at_infinity(void) {
  const Camera camera = tv::prepare_camera(pinhole());
  const Mat3 R = rotation(0.1, -0.2, 0.05);
  const Vec3 direction = Vec3(0.1, 0.05, 1).normalized();
  for (tv_triangulation method : kMethods) {
    const tv_point same =
        triangulated(method, camera, camera, kIdentity, kSideways, Vec2(400, 200), Vec2(400, 200));
    TEST_ASSERT_EQUAL_INT(TV_POINT_INFINITE, same.status);
    TEST_ASSERT_TRUE(same.error_px < 1e-9f && same.angle_rad < 1e-14f);
    const tv_point turned = triangulated(method, camera, camera, R, Vec3(0.3, 2, -1),
                                         seen(camera, direction), seen(camera, R * direction));
    TEST_ASSERT_EQUAL_INT(TV_POINT_INFINITE, turned.status);
    TEST_ASSERT_TRUE((position(turned) - direction).norm() < 1e-12);
    TEST_ASSERT_TRUE(turned.error_px < 1e-9f);
  }
}

void test_rays_that_meet_behind_say_so_and_where(void) {
  const Camera camera = tv::prepare_camera(pinhole());
  const Vec3 behind(0.5, 0.2, -4);
  for (tv_triangulation method : kMethods) {
    const tv_point point = triangulated(method, camera, camera, kIdentity, kSideways,
                                        seen(camera, -behind), seen(camera, -(behind + kSideways)));
    TEST_ASSERT_EQUAL_INT(TV_POINT_BEHIND, point.status);
    TEST_ASSERT_TRUE((position(point) - behind).norm() < 1e-9);
    TEST_ASSERT_TRUE(point.error_px < 1e-9f);
    // With an inexact pixel the error is that of the point projected through the camera's centre.
    const Vec2 pixel0 = seen(camera, -behind);
    const Vec2 pixel1 = seen(camera, -(behind + kSideways)) + Vec2(1, 30);
    const tv_point off = triangulated(method, camera, camera, kIdentity, kSideways, pixel0, pixel1);
    const double squares = (seen(camera, -position(off)) - pixel0).squaredNorm() +
                           (seen(camera, -(position(off) + kSideways)) - pixel1).squaredNorm();
    TEST_ASSERT_EQUAL_INT(TV_POINT_BEHIND, off.status);
    TEST_ASSERT_DOUBLE_WITHIN(1e-5, std::sqrt(squares / 2), off.error_px);
  }
}

void test_a_point_behind_one_camera_only_is_behind(void) {
  const Camera camera = tv::prepare_camera(pinhole());
  const Vec3 forward(0, 0, -5);  // t: camera 1 is at (0, 0, 5), in front of camera 0
  const Vec3 point0(0.3, 0.2, 2);
  for (tv_triangulation method : kMethods) {
    const tv_point point = triangulated(method, camera, camera, kIdentity, forward,
                                        seen(camera, point0), seen(camera, -(point0 + forward)));
    TEST_ASSERT_EQUAL_INT(TV_POINT_BEHIND, point.status);
    TEST_ASSERT_TRUE((position(point) - point0).norm() < 1e-9);
  }
}

void test_a_point_on_the_baseline_has_no_depth(void) {
  const Camera camera = tv::prepare_camera(pinhole());
  const Camera wide = tv::prepare_camera(fisheye());
  const Mat3 about = rotation(0, 3.14159265358979323846, 0);
  for (tv_triangulation method : kMethods) {
    // A point in front of both cameras has parallel rays; one between two cameras that face each
    // other has opposed rays.
    const tv_point ahead = triangulated(method, camera, camera, kIdentity, Vec3(0, 0, -1),
                                        Vec2(320, 240), Vec2(320, 240));
    TEST_ASSERT_EQUAL_INT(TV_POINT_INFINITE, ahead.status);
    const tv_point between = triangulated(method, wide, wide, about, Vec3(0, 0, 4),
                                          Vec2(399.5, 399.5), Vec2(399.5, 399.5));
    TEST_ASSERT_EQUAL_INT(TV_POINT_INVALID, between.status);
    TEST_ASSERT_TRUE(position(between) == Vec3(0, 0, 0) && between.error_px == 0);
  }
}

void test_pixels_without_a_ray_are_invalid(void) {
  const double bad[] = {std::numeric_limits<double>::quiet_NaN(),
                        std::numeric_limits<double>::infinity(), -1e308};
  const Camera camera = tv::prepare_camera(distorted());
  for (tv_triangulation method : kMethods) {
    for (double value : bad) {
      for (int i = 0; i < 4; ++i) {
        Vec2 pixels[2] = {Vec2(300, 200), Vec2(310, 200)};
        pixels[i / 2][i % 2] = value;
        const tv_point point =
            triangulated(method, camera, camera, kIdentity, kSideways, pixels[0], pixels[1]);
        TEST_ASSERT_EQUAL_INT(TV_POINT_INVALID, point.status);
        TEST_ASSERT_TRUE(position(point) == Vec3(0, 0, 0));
        TEST_ASSERT_TRUE(point.angle_rad == 0 && point.error_px == 0);
      }
    }
  }
}

void test_swapped_views_give_the_same_point(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera cameras[2] = {tv::prepare_camera(distorted()), tv::prepare_camera(fisheye())};
  for (int i = 0; i < 2000; ++i) {
    const Scene scene = random_scene(&random);
    const Camera& camera0 = cameras[i % 2];
    const Camera& camera1 = cameras[i / 2 % 2];
    const Vec2 pixel0 = seen(camera0, scene.point0) + Vec2(noise(&random, 1), noise(&random, 1));
    const Vec2 pixel1 = seen(camera1, scene.point1) + Vec2(noise(&random, 1), noise(&random, 1));
    const Mat3 R_back = scene.R.transpose();
    const Vec3 t_back = -(R_back * scene.t);
    for (tv_triangulation method : kMethods) {
      // The eigenvector methods fix the length of (X, W) at 1, with X counted from camera 0.
      if (method == TV_TRIANGULATION_LINEAR_EIGEN) continue;
      if (method == TV_TRIANGULATION_ITERATIVE_EIGEN) continue;
      const tv_point there =
          triangulated(method, camera0, camera1, scene.R, scene.t, pixel0, pixel1);
      const tv_point back = triangulated(method, camera1, camera0, R_back, t_back, pixel1, pixel0);
      TEST_ASSERT_EQUAL_INT(there.status, back.status);
      const Vec3 moved = scene.R * position(there) + scene.t;
      TEST_ASSERT_TRUE((moved - position(back)).norm() < 1e-8 * (1 + moved.norm()));
      TEST_ASSERT_DOUBLE_WITHIN(1e-5, there.error_px, back.error_px);
    }
  }
}

void test_position_is_in_units_of_t(void) {
  const Camera camera = tv::prepare_camera(pinhole());
  const double lengths[] = {1e-300, 1e-20, 0.193, 1e20, 1e300};
  const Vec3 point0(0.4, 0.2, 5);
  for (double length : lengths) {
    for (tv_triangulation method : kMethods) {
      const tv_point point = triangulated(method, camera, camera, kIdentity, kSideways * length,
                                          seen(camera, point0), seen(camera, point0 + kSideways));
      TEST_ASSERT_EQUAL_INT(TV_POINT_OK, point.status);
      TEST_ASSERT_TRUE((position(point) / length - point0).norm() < 1e-9);
    }
  }
}

void test_no_input_gives_a_number_that_is_not_finite(void) {
  tv::Random random = tv::random_seeded(kSeed);
  const Camera cameras[3] = {tv::prepare_camera(pinhole()), tv::prepare_camera(distorted()),
                             tv::prepare_camera(fisheye())};
  for (int i = 0; i < 20000; ++i) {
    const Camera& camera0 = cameras[i % 3];
    const Camera& camera1 = cameras[i / 3 % 3];
    const double span = std::exp2(uniform(&random, -50, i % 7 ? 10 : 1000));
    const Mat3 R = rotation(uniform(&random, -3, 3), uniform(&random, -3, 3), 0);
    const Vec3 t = std::exp2(uniform(&random, -1000, 1000)) *
                   Vec3(uniform(&random, -1, 1), uniform(&random, -1, 1), i % 4 ? 0.1 : 0);
    const Vec2 pixel0(320 + span * uniform(&random, -1, 1), 240 + span * uniform(&random, -1, 1));
    const Vec2 pixel1(320 + span * uniform(&random, -1, 1), 240 + span * uniform(&random, -1, 1));
    for (tv_triangulation method : kMethods) {
      triangulated(method, camera0, camera1, i % 5 ? R : kIdentity, t, pixel0, pixel1);
    }
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_exact_points_are_recovered_by_every_method_and_lens);
  RUN_TEST(test_far_points_keep_the_digits_that_their_parallax_has);
  RUN_TEST(test_points_beside_and_behind_the_image_plane_of_a_fisheye_are_found);
  RUN_TEST(test_linear_ls_equals_hartley_and_sturms_equations_solved_by_qr);
  RUN_TEST(test_linear_ls_of_a_fisheye_equals_equations_on_the_viewing_sphere);
  RUN_TEST(test_iterative_ls_is_the_fixed_point_of_its_weights);
  RUN_TEST(test_linear_eigen_is_the_smallest_singular_vector);
  RUN_TEST(test_iterative_eigen_is_the_fixed_point_of_its_weights);
  RUN_TEST(test_correction_of_a_fisheye_is_least_on_its_tangent_planes);
  RUN_TEST(test_midpoint_equals_the_point_nearest_to_both_lines);
  RUN_TEST(test_error_is_the_rms_reprojection_through_the_lens);
  RUN_TEST(test_iterative_ls_has_no_more_error_than_midpoint_under_noise);
  RUN_TEST(test_parallel_rays_are_at_infinity);
  RUN_TEST(test_rays_that_meet_behind_say_so_and_where);
  RUN_TEST(test_a_point_behind_one_camera_only_is_behind);
  RUN_TEST(test_a_point_on_the_baseline_has_no_depth);
  RUN_TEST(test_pixels_without_a_ray_are_invalid);
  RUN_TEST(test_swapped_views_give_the_same_point);
  RUN_TEST(test_position_is_in_units_of_t);
  RUN_TEST(test_no_input_gives_a_number_that_is_not_finite);
  return UNITY_END();
}
