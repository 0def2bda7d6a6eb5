// Camera models: project and unproject are inverse over whole images, Jacobians agree with central
// differences, the valid region, and refused parameters.
#include <cmath>
#include <cstdio>
#include <limits>

#include "base/math.h"
#include "base/random.h"
#include "geometry/camera.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using tv::Camera;
using tv::Mat23;
using tv::Mat32;
using tv::Vec2;
using tv::Vec3;

constexpr uint64_t kSeed = 7;
constexpr double kInf = std::numeric_limits<double>::infinity();
const double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Named {
  const char* name;
  tv_camera camera;
  int num_lost;  // pixels of a grid with 7-pixel steps that have no ray under the model
};

// AR.Drone: ardrone_autonomy's and tum-vision's calibration files. EuRoC, TUM: the data sets' own.
const Named kCameras[] = {
    {"pinhole", {TV_CAMERA_PINHOLE, 741, 500, 0, 994.978, 994.978, 311.193, 254.877, {}}, 0},
    {"ardrone2 front",
     {TV_CAMERA_BROWN_CONRADY,
      640,
      360,
      0,
      569.883158064802,
      568.007065238522,
      331.403348466206,
      135.879365106014,
      {-0.526629354780687, 0.274357114262035, 0.0211426202132638, -0.0063942451330052, 0}},
     0},
    {"ardrone2 bottom",
     {TV_CAMERA_BROWN_CONRADY,
      640,
      360,
      0,
      700.490828918144,
      701.654116650887,
      319.508832099787,
      218.740253550967,
      {0.0182389759532889, 0.0520276742502367, 0.00651075732801101, 0.000183496184521575, 0}},
     0},
    {"ardrone1 front",
     {TV_CAMERA_BROWN_CONRADY,
      320,
      240,
      0,
      209.62677,
      210.825901,
      161.275943,
      123.723408,
      {0.160828, -0.280969, 0.000044, 0.001607, 0}},
     29},  // r (1 + k1 r^2 + k2 r^4) is at most 0.88, and the image's corners are at 0.97
    {"euroc cam0",
     {TV_CAMERA_BROWN_CONRADY,
      752,
      480,
      0,
      458.654,
      457.296,
      367.215,
      248.375,
      {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, 0}},
     0},
    {"tum fr1",
     {TV_CAMERA_BROWN_CONRADY,
      640,
      480,
      0,
      517.3,
      516.5,
      318.6,
      255.3,
      {0.2624, -0.9531, -0.0054, 0.0026, 1.1633}},
     0},
    {"rational",
     {TV_CAMERA_BROWN_CONRADY,
      1280,
      720,
      0,
      612.1,
      611.8,
      638.0,
      367.2,
      {0.52, -2.69, 0.0005, -0.0002, 1.55, 0.40, -2.51, 1.48}},
     0},
    {"kannala-brandt",
     {TV_CAMERA_KANNALA_BRANDT,
      512,
      512,
      0,
      190.97847715128717,
      190.9733070521226,
      254.93170605935475,
      256.8974428996504,
      {0.0034823894022493434, 0.0007150348452162257, -0.0020532361418706202,
       0.00020293673591811182}},
     0},
    {"equidistant, 200 degrees",
     {TV_CAMERA_KANNALA_BRANDT, 800, 800, 0, 220.0, 221.0, 399.5, 399.5, {0, 0, 0, 0}},
     0},
};

double uniform(tv::Random* random, double low, double high) {
  return low + (high - low) * (tv::random_next(*random) * 0x1p-32);
}

Camera prepared(const tv_camera& camera) { return tv::prepare_camera(camera); }

tv_camera brown(double k1, double k2, double p1, double p2, double k3) {
  return tv_camera{TV_CAMERA_BROWN_CONRADY, 640, 480, 0, 500, 500, 320, 240, {k1, k2, p1, p2, k3}};
}

}  // namespace

void test_every_pixel_of_the_image_comes_back_to_a_ten_billionth(void) {
  for (const Named& named : kCameras) {
    const Camera camera = prepared(named.camera);
    int num_seen = 0, num_pixels = 0;
    for (int y = 0; y < named.camera.height; y += 7) {
      for (int x = 0; x < named.camera.width; x += 7) {
        const Vec2 pixel(x, y);
        Vec3 ray;
        Vec2 back;
        ++num_pixels;
        if (!tv::unproject(camera, pixel, &ray, nullptr)) continue;
        ++num_seen;
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-14, 1.0, ray.norm(), named.name);
        TEST_ASSERT_TRUE_MESSAGE(tv::project(camera, ray, &back, nullptr), named.name);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-10, x, back[0], named.name);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-10, y, back[1], named.name);
      }
    }
    TEST_ASSERT_EQUAL_INT_MESSAGE(num_pixels - named.num_lost, num_seen, named.name);
  }
}

void test_rays_within_the_valid_angle_come_back(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (const Named& named : kCameras) {
    const Camera camera = prepared(named.camera);
    for (int i = 0; i < 2000; ++i) {
      const double angle = 0.999 * camera.valid_angle_rad * uniform(&random, 0, 1);
      const double azimuth = uniform(&random, -3.2, 3.2);
      const Vec3 ray(std::sin(angle) * std::cos(azimuth), std::sin(angle) * std::sin(azimuth),
                     std::cos(angle));
      Vec2 pixel;
      Vec3 back;
      TEST_ASSERT_TRUE_MESSAGE(tv::project(camera, ray * 3.7, &pixel, nullptr), named.name);
      TEST_ASSERT_TRUE_MESSAGE(tv::unproject(camera, pixel, &back, nullptr), named.name);
      TEST_ASSERT_TRUE_MESSAGE((back - ray).norm() < 1e-10, named.name);
    }
  }
}

void test_projection_jacobian_equals_central_differences(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (const Named& named : kCameras) {
    const Camera camera = prepared(named.camera);
    for (int i = 0; i < 300; ++i) {
      const double angle = 0.9 * camera.valid_angle_rad * uniform(&random, 0, 1);
      const double radius = i == 0 ? 0.0 : std::sin(angle);
      const double azimuth = uniform(&random, -3.2, 3.2);
      const Vec3 point = 2.0 * Vec3(radius * std::cos(azimuth), radius * std::sin(azimuth),
                                    i == 0 ? 1.0 : std::cos(angle));
      Vec2 pixel, plus, minus;
      Mat23 jacobian;
      TEST_ASSERT_TRUE(tv::project(camera, point, &pixel, &jacobian));
      const double step = 1e-6 * (point[2] > 0 && angle > 1.4 ? point[2] : 1.0);
      for (int axis = 0; axis < 3; ++axis) {
        Vec3 offset(0, 0, 0);
        offset[axis] = step;
        TEST_ASSERT_TRUE(tv::project(camera, point + offset, &plus, nullptr));
        TEST_ASSERT_TRUE(tv::project(camera, point - offset, &minus, nullptr));
        const Vec2 difference = (plus - minus) / (2 * step);
        const double tolerance = 1e-6 * (camera.model.fx + jacobian.norm());
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance, difference[0], jacobian(0, axis), named.name);
        TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(tolerance, difference[1], jacobian(1, axis), named.name);
      }
    }
  }
}

void test_unprojection_jacobian_equals_central_differences(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (const Named& named : kCameras) {
    const Camera camera = prepared(named.camera);
    for (int i = 0; i < 300; ++i) {
      // Not in the corners: there one lens's third derivative makes the differences inexact.
      Vec2 pixel(uniform(&random, 0.15, 0.85) * named.camera.width,
                 uniform(&random, 0.15, 0.85) * named.camera.height);
      if (i == 0) pixel = Vec2(named.camera.cx, named.camera.cy);
      Vec3 ray, plus, minus;
      Mat32 jacobian;
      TEST_ASSERT_TRUE(tv::unproject(camera, pixel, &ray, &jacobian));
      for (int axis = 0; axis < 2; ++axis) {
        Vec2 offset(0, 0);
        offset[axis] = 1e-3;
        TEST_ASSERT_TRUE(tv::unproject(camera, pixel + offset, &plus, nullptr));
        TEST_ASSERT_TRUE(tv::unproject(camera, pixel - offset, &minus, nullptr));
        const Vec3 difference = (plus - minus) / 2e-3;
        for (int row = 0; row < 3; ++row) {
          TEST_ASSERT_DOUBLE_WITHIN_MESSAGE(1e-9, difference[row], jacobian(row, axis), named.name);
        }
      }
    }
  }
}

void test_the_two_jacobians_are_inverse_to_each_other(void) {
  for (const Named& named : kCameras) {
    const Camera camera = prepared(named.camera);
    Vec3 ray;
    Vec2 pixel;
    Mat32 d_ray;
    Mat23 d_pixel;
    TEST_ASSERT_TRUE(tv::unproject(camera, Vec2(30, 20), &ray, &d_ray));
    TEST_ASSERT_TRUE(tv::project(camera, ray, &pixel, &d_pixel));
    const Eigen::Matrix2d product = d_pixel * d_ray;
    TEST_ASSERT_TRUE_MESSAGE((product - Eigen::Matrix2d::Identity()).norm() < 1e-10, named.name);
  }
}

void test_valid_region_ends_at_the_derivatives_first_zero(void) {
  // The valid region ends where 1 + 3 k1 r^2 = 0.
  const Camera barrel = prepared(brown(-0.3, 0, 0, 0, 0));
  TEST_ASSERT_DOUBLE_WITHIN(2e-6, std::sqrt(1 / 0.9), barrel.valid_radius_undistorted);
  TEST_ASSERT_DOUBLE_WITHIN(2e-6, std::atan(std::sqrt(1 / 0.9)), barrel.valid_angle_rad);
  // The edge: 1 + 3 k1 u + 5 k2 u^2 = 0 for u = r^2, which has a second, later zero.
  const Camera twice = prepared(brown(-0.5, 0.1, 0, 0, 0));
  const double u = (1.5 - std::sqrt(2.25 - 2.0)) / 1.0;
  TEST_ASSERT_DOUBLE_WITHIN(2e-6, std::sqrt(u), twice.valid_radius_undistorted);
  // AR.Drone 2: the discriminant 9 k1^2 - 20 k2 is negative, so it is monotonic everywhere.
  const Camera drone = prepared(brown(-0.526629354780687, 0.274357114262035, 0, 0, 0));
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 89.0 * tv::kPi / 180, drone.valid_angle_rad);
  // The edge for theta + k1 theta^3: 1 + 3 k1 theta^2 = 0.
  tv_camera fisheye = {TV_CAMERA_KANNALA_BRANDT, 640, 480, 0, 300, 300, 320, 240, {-0.1}};
  TEST_ASSERT_DOUBLE_WITHIN(2e-6, std::sqrt(1 / 0.3), prepared(fisheye).valid_angle_rad);
  fisheye.k[0] = 0.05;
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, tv::kPi, prepared(fisheye).valid_angle_rad);
}

void test_a_dip_of_the_derivative_between_samples_is_found(void) {
  // 1 + 3 k1 u + 5 k2 u^2 has its minimum at u = 0.6, and is just below zero there.
  const double u0 = 0.6, depth = 1e-4;
  const double k2 = (1 + depth) / (5 * u0 * u0);
  const Camera camera = prepared(brown(-10 * k2 * u0 / 3, k2, 0, 0, 0));
  const double first = std::sqrt(u0 - std::sqrt(depth / (5 * k2)));
  TEST_ASSERT_DOUBLE_WITHIN(1e-4, first, camera.valid_radius_undistorted);
}

void test_a_pole_of_the_rational_factor_ends_the_valid_region(void) {
  tv_camera model = brown(0, 0, 0, 0, 0);
  model.k[5] = -1.0;  // the rational factor's denominator is 1 - r^2
  const Camera camera = prepared(model);
  TEST_ASSERT_TRUE(camera.valid_radius_undistorted > 0.99);
  TEST_ASSERT_TRUE(camera.valid_radius_undistorted <= 1.0);
  Vec2 pixel;
  TEST_ASSERT_FALSE(tv::project(camera, Vec3(1.01, 0, 1), &pixel, nullptr));
  // Numerator and denominator change sign together, so only a test of the pole itself finds the
  // edge.
  model.k[0] = -0.999;
  TEST_ASSERT_TRUE(prepared(model).valid_radius_undistorted <= 1.0);
}

void test_the_map_is_one_to_one_in_the_valid_disc_with_strong_tangential_terms(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (int trial = 0; trial < 300; ++trial) {
    tv_camera model = brown(uniform(&random, -0.6, 0.6), uniform(&random, -0.4, 0.4),
                            uniform(&random, -0.08, 0.08), uniform(&random, -0.08, 0.08),
                            uniform(&random, -0.2, 0.2));
    const Camera camera = prepared(model);
    TEST_ASSERT_TRUE(camera.valid_angle_rad > 0.1);
    for (int i = 0; i < 100; ++i) {
      const double r = camera.valid_radius_undistorted *
                       (i < 20 ? 1 - 1e-7 * i : std::sqrt(uniform(&random, 0, 1)));
      const double azimuth = uniform(&random, -3.2, 3.2);
      const Vec3 point(r * std::cos(azimuth), r * std::sin(azimuth), 1);
      Vec2 pixel, again;
      Vec3 ray;
      if (!tv::project(camera, point, &pixel, nullptr)) {
        TEST_ASSERT_TRUE(i == 0);  // allowed only at the edge, where r may round beyond it
        continue;
      }
      if (!tv::unproject(camera, pixel, &ray, nullptr)) {
        TEST_ASSERT_TRUE(i < 20);  // allowed only within 2e-6 of the edge
        continue;
      }
      TEST_ASSERT_TRUE((ray - point.normalized()).norm() < (i < 20 ? 1e-6 : 1e-8));
      if (!tv::project(camera, ray, &again, nullptr)) continue;
      TEST_ASSERT_TRUE((again - pixel).norm() < 1e-7 * (1 + pixel.norm()));
    }
  }
}

void test_no_pixel_gives_a_ray_beyond_the_valid_angle(void) {
  tv::Random random = tv::random_seeded(kSeed);
  int num_refused = 0;
  for (int trial = 0; trial < 300; ++trial) {
    tv_camera model = brown(uniform(&random, -0.4, -0.1), 0, uniform(&random, -0.05, 0.05),
                            uniform(&random, -0.05, 0.05), 0);
    const Camera camera = prepared(model);
    for (int i = 0; i < 100; ++i) {
      const double r = camera.valid_radius_distorted * uniform(&random, 0.9, 1.0);
      const double azimuth = uniform(&random, -3.2, 3.2);
      const Vec2 pixel(model.cx + model.fx * r * std::cos(azimuth),
                       model.cy + model.fy * r * std::sin(azimuth));
      Vec3 ray;
      if (!tv::unproject(camera, pixel, &ray, nullptr)) {
        ++num_refused;
        continue;
      }
      TEST_ASSERT_TRUE(std::acos(ray[2]) <= camera.valid_angle_rad + 1e-8);
    }
  }
  TEST_ASSERT_TRUE(num_refused > 1000 && num_refused < 29000);
}

void test_outside_is_refused_and_outputs_stay(void) {
  const Camera barrel = prepared(brown(-0.3, 0, 0, 0, 0));
  Vec2 pixel(-7, -7);
  Vec3 ray(-7, -7, -7);
  // The edge is at r = 1.0541, which is the pixel 320 + 500 * 1.0541 * (1 - 0.3 * 1.1111) = 671.36.
  TEST_ASSERT_FALSE(tv::project(barrel, Vec3(1.06, 0, 1), &pixel, nullptr));
  TEST_ASSERT_TRUE(tv::project(barrel, Vec3(1.05, 0, 1), &pixel, nullptr));
  pixel = Vec2(-7, -7);
  TEST_ASSERT_FALSE(tv::unproject(barrel, Vec2(671.4, 240), &ray, nullptr));
  TEST_ASSERT_FALSE(tv::unproject(barrel, Vec2(1e6, 240), &ray, nullptr));
  TEST_ASSERT_FALSE(tv::project(barrel, Vec3(0, 0, -1), &pixel, nullptr));
  TEST_ASSERT_FALSE(tv::project(barrel, Vec3(0, 0, 0), &pixel, nullptr));
  TEST_ASSERT_FALSE(tv::project(barrel, Vec3(1, 0, 0), &pixel, nullptr));
  const Camera fisheye = prepared(kCameras[8].camera);
  TEST_ASSERT_FALSE(tv::project(fisheye, Vec3(0, 0, -1), &pixel, nullptr));
  TEST_ASSERT_FALSE(tv::unproject(fisheye, Vec2(399.5 + 220 * 3.15, 399.5), &ray, nullptr));
  tv_camera folding = kCameras[8].camera;
  folding.k[0] = -0.1;  // the valid region ends at theta = 1.8257 rad
  TEST_ASSERT_FALSE(
      tv::project(prepared(folding), Vec3(std::sin(1.83), 0, std::cos(1.83)), &pixel, nullptr));
  TEST_ASSERT_TRUE(pixel == Vec2(-7, -7) && ray == Vec3(-7, -7, -7));
  TEST_ASSERT_TRUE(tv::unproject(barrel, Vec2(671.3, 240), &ray, nullptr));
  TEST_ASSERT_TRUE(tv::project(fisheye, Vec3(1, 0, -0.1), &pixel, nullptr));
}

void test_not_finite_input_is_refused(void) {
  const double bad[] = {kNaN, kInf, -kInf};
  for (const Named& named : kCameras) {
    const Camera camera = prepared(named.camera);
    Vec2 pixel;
    Vec3 ray;
    for (double value : bad) {
      for (int i = 0; i < 3; ++i) {
        Vec3 point(0.1, 0.1, 1);
        point[i] = value;
        TEST_ASSERT_FALSE_MESSAGE(tv::project(camera, point, &pixel, nullptr), named.name);
        Vec2 from(10, 10);
        from[i % 2] = value;
        TEST_ASSERT_FALSE_MESSAGE(tv::unproject(camera, from, &ray, nullptr), named.name);
      }
    }
  }
}

void test_projection_does_not_depend_on_the_points_distance(void) {
  const double scales[] = {1e-310, 1e-200, 1e-30, 1e30, 1e200, 1e300};
  for (const Named& named : kCameras) {
    const Camera camera = prepared(named.camera);
    Vec2 expected, pixel;
    TEST_ASSERT_TRUE(tv::project(camera, Vec3(0.2, -0.1, 1), &expected, nullptr));
    for (double scale : scales) {
      const Vec3 point = Vec3(0.2, -0.1, 1) * scale;
      TEST_ASSERT_TRUE_MESSAGE(tv::project(camera, point, &pixel, nullptr), named.name);
      TEST_ASSERT_TRUE_MESSAGE((pixel - expected).norm() < 1e-9, named.name);
    }
  }
}

void test_brown_conrady_without_coefficients_is_a_pinhole(void) {
  const Camera camera = prepared(brown(0, 0, 0, 0, 0));
  TEST_ASSERT_EQUAL_INT(TV_CAMERA_PINHOLE, camera.model.model);
  TEST_ASSERT_DOUBLE_WITHIN(0, 0.5 * tv::kPi, camera.valid_angle_rad);
}

void test_absurd_coefficients_end_in_an_answer(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (int trial = 0; trial < 2000; ++trial) {
    tv_camera model = brown(0, 0, 0, 0, 0);
    model.model = trial % 2 ? TV_CAMERA_BROWN_CONRADY : TV_CAMERA_KANNALA_BRANDT;
    for (double& k : model.k) {
      k = uniform(&random, -1, 1) * std::exp2(uniform(&random, -60, trial % 5 ? 10 : 900));
    }
    const Camera camera = prepared(model);
    TEST_ASSERT_TRUE(camera.valid_angle_rad >= 0 && camera.valid_angle_rad <= tv::kPi);
    const Vec2 pixel(uniform(&random, 0, 640), uniform(&random, 0, 480));
    Vec3 ray;
    Mat32 jacobian;
    if (tv::unproject(camera, pixel, &ray, &jacobian)) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1.0, ray.norm());
    }
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_every_pixel_of_the_image_comes_back_to_a_ten_billionth);
  RUN_TEST(test_rays_within_the_valid_angle_come_back);
  RUN_TEST(test_projection_jacobian_equals_central_differences);
  RUN_TEST(test_unprojection_jacobian_equals_central_differences);
  RUN_TEST(test_the_two_jacobians_are_inverse_to_each_other);
  RUN_TEST(test_valid_region_ends_at_the_derivatives_first_zero);
  RUN_TEST(test_a_dip_of_the_derivative_between_samples_is_found);
  RUN_TEST(test_a_pole_of_the_rational_factor_ends_the_valid_region);
  RUN_TEST(test_the_map_is_one_to_one_in_the_valid_disc_with_strong_tangential_terms);
  RUN_TEST(test_no_pixel_gives_a_ray_beyond_the_valid_angle);
  RUN_TEST(test_outside_is_refused_and_outputs_stay);
  RUN_TEST(test_not_finite_input_is_refused);
  RUN_TEST(test_projection_does_not_depend_on_the_points_distance);
  RUN_TEST(test_brown_conrady_without_coefficients_is_a_pinhole);
  RUN_TEST(test_absurd_coefficients_end_in_an_answer);
  return UNITY_END();
}
