/* The camera functions of the C API: the statuses and outputs that the header promises. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "twoview/twoview.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

static tv_camera ardrone2(void) {
  tv_camera camera;
  memset(&camera, 0, sizeof camera);
  camera.model = TV_CAMERA_BROWN_CONRADY;
  camera.width = 640, camera.height = 360;
  camera.fx = 569.883158064802, camera.fy = 568.007065238522;
  camera.cx = 331.403348466206, camera.cy = 135.879365106014;
  camera.k[0] = -0.526629354780687, camera.k[1] = 0.274357114262035;
  camera.k[2] = 0.0211426202132638, camera.k[3] = -0.0063942451330052;
  return camera;
}

static tv_camera barrel(void) {
  tv_camera camera = ardrone2();
  memset(camera.k, 0, sizeof camera.k);
  camera.k[0] = -0.3;
  return camera;
}

static const double marks[6] = {-1, -2, -3, -4, -5, -6};

/* Every output must still hold these values after a call that failed. */
static void assert_marks(const double *values, int num_values) {
  TEST_ASSERT_EQUAL_MEMORY(marks, values, (size_t)num_values * sizeof(double));
}

static void expect_from_all(const tv_camera *camera, tv_status expected) {
  const double point[3] = {0.1, 0.2, 1}, pixel[2] = {300, 200};
  double out[6], jacobian[6];
  tv_camera scaled = barrel(), before = scaled;
  memcpy(out, marks, sizeof out);
  memcpy(jacobian, marks, sizeof jacobian);
  TEST_ASSERT_EQUAL_INT(expected, tv_camera_check(camera));
  TEST_ASSERT_EQUAL_INT(expected, tv_camera_valid_angle(camera, out));
  TEST_ASSERT_EQUAL_INT(expected, tv_camera_project(camera, point, out, jacobian));
  TEST_ASSERT_EQUAL_INT(expected, tv_camera_unproject(camera, pixel, out, jacobian));
  TEST_ASSERT_EQUAL_INT(expected, tv_camera_undistort(camera, pixel, out));
  TEST_ASSERT_EQUAL_INT(expected, tv_camera_scale(camera, 0.5, &scaled));
  assert_marks(out, 6);
  assert_marks(jacobian, 6);
  TEST_ASSERT_EQUAL_MEMORY(&before, &scaled, sizeof scaled);
}

static void test_null_pointers_are_refused(void) {
  const tv_camera camera = ardrone2();
  const double values[3] = {0.1, 0.2, 1};
  double out[3];
  tv_camera scaled;
  expect_from_all(NULL, TV_ERR_NULL);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_valid_angle(&camera, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_project(&camera, NULL, out, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_project(&camera, values, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_unproject(&camera, NULL, out, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_unproject(&camera, values, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_undistort(&camera, NULL, out));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_undistort(&camera, values, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_scale(&camera, 1, NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_scale(&camera, 1, &scaled));
}

static void test_bad_cameras_are_refused_everywhere(void) {
  const double bad[3] = {NAN, INFINITY, -INFINITY};
  tv_camera camera;
  int i, j;
  camera = ardrone2(), camera.model = 3, expect_from_all(&camera, TV_ERR_CAMERA);
  camera = ardrone2(), camera.model = -1, expect_from_all(&camera, TV_ERR_CAMERA);
  camera = ardrone2(), camera.width = 0, expect_from_all(&camera, TV_ERR_CAMERA);
  camera = ardrone2(), camera.height = -5, expect_from_all(&camera, TV_ERR_CAMERA);
  camera = ardrone2(), camera.fx = 0, expect_from_all(&camera, TV_ERR_CAMERA);
  camera = ardrone2(), camera.fy = -500, expect_from_all(&camera, TV_ERR_CAMERA);
  for (i = 0; i < 3; ++i) {
    camera = ardrone2(), camera.fx = bad[i], expect_from_all(&camera, TV_ERR_CAMERA);
    camera = ardrone2(), camera.fy = bad[i], expect_from_all(&camera, TV_ERR_CAMERA);
    camera = ardrone2(), camera.cx = bad[i], expect_from_all(&camera, TV_ERR_CAMERA);
    camera = ardrone2(), camera.cy = bad[i], expect_from_all(&camera, TV_ERR_CAMERA);
    for (j = 0; j < 8; ++j) {
      camera = ardrone2(), camera.k[j] = bad[i], expect_from_all(&camera, TV_ERR_CAMERA);
    }
  }
}

static void test_numbers_that_are_not_finite_are_refused(void) {
  const double bad[3] = {NAN, INFINITY, -INFINITY};
  const tv_camera camera = ardrone2();
  tv_camera scaled;
  double out[6], jacobian[6];
  int i, j;
  memcpy(out, marks, sizeof out);
  memcpy(jacobian, marks, sizeof jacobian);
  for (i = 0; i < 3; ++i) {
    for (j = 0; j < 3; ++j) {
      double point[3] = {0.1, 0.2, 1}, pixel[2] = {300, 200};
      point[j] = bad[i];
      pixel[j % 2] = bad[i];
      TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, tv_camera_project(&camera, point, out, jacobian));
      TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, tv_camera_unproject(&camera, pixel, out, jacobian));
      TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, tv_camera_undistort(&camera, pixel, out));
    }
    TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, tv_camera_scale(&camera, bad[i], &scaled));
  }
  assert_marks(out, 6);
  assert_marks(jacobian, 6);
}

static void test_outside_the_lens_is_refused_and_outputs_stay(void) {
  const tv_camera camera = barrel();
  const double behind[3] = {0.1, 0.1, -1}, beside[3] = {1.06, 0, 1}, nowhere[3] = {0, 0, 0};
  const double far_pixel[2] = {900, 135.879365106014};
  double out[6], jacobian[6];
  memcpy(out, marks, sizeof out);
  memcpy(jacobian, marks, sizeof jacobian);
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_project(&camera, behind, out, jacobian));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_project(&camera, beside, out, jacobian));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_project(&camera, nowhere, out, jacobian));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_unproject(&camera, far_pixel, out, jacobian));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_undistort(&camera, far_pixel, out));
  assert_marks(out, 6);
  assert_marks(jacobian, 6);
}

static void test_every_pixel_of_the_ardrone_comes_back(void) {
  const tv_camera camera = ardrone2();
  int x, y;
  for (y = 0; y < camera.height; y += 13) {
    for (x = 0; x < camera.width; x += 13) {
      double pixel[2], ray[3], back[2];
      pixel[0] = x, pixel[1] = y;
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_unproject(&camera, pixel, ray, NULL));
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, ray, back, NULL));
      TEST_ASSERT_DOUBLE_WITHIN(1e-10, pixel[0], back[0]);
      TEST_ASSERT_DOUBLE_WITHIN(1e-10, pixel[1], back[1]);
    }
  }
}

static void test_jacobians_are_row_major(void) {
  const tv_camera camera = ardrone2();
  const double h = 1e-6, point[3] = {0.2, -0.1, 1}, pixel[2] = {200, 100};
  double d_pixel[6], d_ray[6], low[3], high[3], base[3], moved[3];
  int axis, row, i;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, point, base, d_pixel));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_unproject(&camera, pixel, base, d_ray));
  for (axis = 0; axis < 3; ++axis) {
    for (i = 0; i < 3; ++i) moved[i] = point[i] + (i == axis ? h : 0);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, moved, high, NULL));
    moved[axis] = point[axis] - h;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, moved, low, NULL));
    for (row = 0; row < 2; ++row) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-4, (high[row] - low[row]) / (2 * h), d_pixel[3 * row + axis]);
    }
  }
  for (axis = 0; axis < 2; ++axis) {
    for (i = 0; i < 2; ++i) moved[i] = pixel[i] + (i == axis ? 1e-3 : 0);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_unproject(&camera, moved, high, NULL));
    moved[axis] = pixel[axis] - 1e-3;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_unproject(&camera, moved, low, NULL));
    for (row = 0; row < 3; ++row) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-9, (high[row] - low[row]) / 2e-3, d_ray[2 * row + axis]);
    }
  }
}

static void test_undistort_gives_the_pinhole_pixel_of_the_same_ray(void) {
  const tv_camera camera = ardrone2();
  const double pixel[2] = {40, 300};
  double ray[3], straight[2];
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_unproject(&camera, pixel, ray, NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_undistort(&camera, pixel, straight));
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, camera.fx * ray[0] / ray[2] + camera.cx, straight[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, camera.fy * ray[1] / ray[2] + camera.cy, straight[1]);
  /* barrel distortion moves pixels towards the centre, so undistortion moves them outwards */
  TEST_ASSERT_TRUE(straight[0] < pixel[0] - 10);
}

static void test_undistort_refuses_rays_beside_a_fisheye(void) {
  tv_camera camera = ardrone2();
  double pixel[2], out[6];
  memset(camera.k, 0, sizeof camera.k);
  camera.model = TV_CAMERA_KANNALA_BRANDT;
  memcpy(out, marks, sizeof out);
  /* The ray is at 1.6 rad from the optical axis, more than pi / 2. */
  pixel[0] = camera.cx + camera.fx * 1.6, pixel[1] = camera.cy;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_undistort(&camera, pixel, out));
  assert_marks(out, 6);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_unproject(&camera, pixel, out, NULL));
  TEST_ASSERT_TRUE(out[2] < 0);
}

static void test_valid_angle_of_each_model(void) {
  tv_camera camera = barrel();
  double angle;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_valid_angle(&camera, &angle));
  TEST_ASSERT_DOUBLE_WITHIN(2e-6, atan(sqrt(1 / 0.9)), angle);
  camera.model = TV_CAMERA_PINHOLE;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_valid_angle(&camera, &angle));
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, 1.5707963267948966, angle);
  camera.model = TV_CAMERA_KANNALA_BRANDT, camera.k[0] = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_valid_angle(&camera, &angle));
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, 3.1415926535897931, angle);
}

static void test_scale_keeps_pixel_centres(void) {
  const tv_camera camera = ardrone2();
  const double point[3] = {0.2, -0.1, 1};
  double full[2], half[2];
  tv_camera scaled = camera;
  /* the input camera may also be the output */
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_scale(&scaled, 0.5, &scaled));
  TEST_ASSERT_EQUAL_INT(320, scaled.width);
  TEST_ASSERT_EQUAL_INT(180, scaled.height);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, point, full, NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&scaled, point, half, NULL));
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 * (full[0] + 0.5) - 0.5, half[0]);
  TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0.5 * (full[1] + 0.5) - 0.5, half[1]);
  TEST_ASSERT_EQUAL_MEMORY(camera.k, scaled.k, sizeof camera.k);
}

static void test_scale_out_of_range_is_refused(void) {
  tv_camera camera = ardrone2(), scaled = barrel();
  const tv_camera before = scaled;
  const double bad[4] = {0, -1, 16.001, 1e300};
  int i;
  for (i = 0; i < 4; ++i) {
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_camera_scale(&camera, bad[i], &scaled));
  }
  camera.width = 2147483647;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_camera_scale(&camera, 2, &scaled));
  camera = ardrone2(), camera.fx = DBL_MAX;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_camera_scale(&camera, 2, &scaled));
  TEST_ASSERT_EQUAL_MEMORY(&before, &scaled, sizeof scaled);
  camera = ardrone2();
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_scale(&camera, 1e-9, &scaled));
  TEST_ASSERT_EQUAL_INT(1, scaled.width);
  TEST_ASSERT_EQUAL_INT(1, scaled.height);
}

static void test_results_too_large_for_a_double_are_outside(void) {
  tv_camera camera = barrel();
  const double pixel[2] = {320, 180}, point[3] = {0.5, 0.5, 1}, *many = point;
  double out[6], jacobian[6], pixels[2];
  uint8_t inside[1];
  memcpy(out, marks, sizeof out);
  memcpy(jacobian, marks, sizeof jacobian);
  camera.fx = 5e-324, camera.cx = 320;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_unproject(&camera, pixel, out, jacobian));
  camera.fx = 1.7e308;
  camera.cx = 1.7e308;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_project(&camera, point, out, jacobian));
  assert_marks(out, 6);
  assert_marks(jacobian, 6);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project_points(&camera, many, 1, pixels, inside));
  TEST_ASSERT_TRUE(inside[0] == 0 && pixels[0] == 0 && pixels[1] == 0);
}

static void test_many_points_have_the_pixels_of_each_one(void) {
  const tv_camera cameras[2] = {ardrone2(), barrel()};
  const double points[5][3] = {{0.1, 0.2, 1}, {0, 0, -1}, {NAN, 0, 1}, {9, 0, 1}, {-0.3, 0.1, 2}};
  int c, i;
  for (c = 0; c < 2; ++c) {
    double pixels[12];
    uint8_t inside[6];
    memset(pixels, 0x5A, sizeof pixels);
    memset(inside, 0x5A, sizeof inside);
    TEST_ASSERT_EQUAL_INT(TV_OK,
                          tv_camera_project_points(&cameras[c], points[0], 5, pixels, inside));
    for (i = 0; i < 5; ++i) {
      double pixel[2] = {0, 0};
      const tv_status status = tv_camera_project(&cameras[c], points[i], pixel, NULL);
      TEST_ASSERT_EQUAL_INT(status == TV_OK, inside[i]);
      TEST_ASSERT_EQUAL_MEMORY(pixel, pixels + 2 * i, sizeof pixel);
    }
    TEST_ASSERT_TRUE(inside[0] == 1 && inside[1] == 0 && inside[2] == 0 && inside[4] == 1);
    TEST_ASSERT_EQUAL_INT(0x5A, inside[5]);
  }
}

static void test_many_points_refuse_what_one_refuses(void) {
  tv_camera camera = barrel();
  double memory[5] = {0.1, 0.2, 1, -4, -5};
  const double point[3] = {0.1, 0.2, 1};
  uint8_t inside[1] = {7};
  double *pixels = memory + 3;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project_points(&camera, NULL, 0, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_project_points(NULL, point, 1, pixels, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_project_points(&camera, NULL, 1, pixels, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_project_points(&camera, point, 1, NULL, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_project_points(&camera, point, 1, pixels, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_camera_project_points(&camera, point, -1, pixels, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_camera_project_points(&camera, memory, 1, memory + 2, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_camera_project_points(&camera, point, 1, pixels, (uint8_t *)pixels + 9));
  camera.fx = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA, tv_camera_project_points(&camera, point, 1, pixels, inside));
  TEST_ASSERT_TRUE(memory[3] == -4 && memory[4] == -5 && inside[0] == 7);
}

static void test_many_pixels_have_the_rays_of_each_one(void) {
  const tv_camera cameras[2] = {ardrone2(), barrel()};
  const double pixels[5][2] = {{320, 180}, {12, 7.5}, {NAN, 0}, {1e9, 3}, {600.25, 300}};
  int c, i;
  for (c = 0; c < 2; ++c) {
    double rays[16];
    uint8_t inside[6];
    memset(rays, 0x5A, sizeof rays);
    memset(inside, 0x5A, sizeof inside);
    TEST_ASSERT_EQUAL_INT(TV_OK,
                          tv_camera_unproject_points(&cameras[c], pixels[0], 5, rays, inside));
    for (i = 0; i < 5; ++i) {
      double ray[3] = {0, 0, 0};
      const tv_status status = tv_camera_unproject(&cameras[c], pixels[i], ray, NULL);
      TEST_ASSERT_EQUAL_INT(status == TV_OK, inside[i]);
      TEST_ASSERT_EQUAL_MEMORY(ray, rays + 3 * i, sizeof ray);
    }
    TEST_ASSERT_TRUE(inside[0] == 1 && inside[2] == 0);
    /* pixel 3 lies beyond the valid angle of camera 1, which has barrel distortion */
    if (c == 1) TEST_ASSERT_EQUAL_INT(0, inside[3]);
    TEST_ASSERT_EQUAL_INT(0x5A, inside[5]);
  }
}

static void test_many_pixels_refuse_what_one_refuses(void) {
  tv_camera camera = barrel();
  double memory[4] = {320, 180, -4, -5};
  uint8_t inside[1] = {7};
  double rays[3] = {1, 2, 3};
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_unproject_points(&camera, NULL, 0, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_unproject_points(NULL, memory, 1, rays, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_unproject_points(&camera, NULL, 1, rays, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_unproject_points(&camera, memory, 1, NULL, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_camera_unproject_points(&camera, memory, 1, rays, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_camera_unproject_points(&camera, memory, -1, rays, inside));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_camera_unproject_points(&camera, memory, 1, memory + 1, inside));
  camera.fx = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA,
                        tv_camera_unproject_points(&camera, memory, 1, rays, inside));
  TEST_ASSERT_TRUE(rays[0] == 1 && rays[1] == 2 && rays[2] == 3 && inside[0] == 7);
}

static void test_every_number_has_its_name(void) {
  int i, j;
  for (i = TV_OK; i <= TV_ERR_KERNELS; ++i) {
    TEST_ASSERT_TRUE(strcmp("unknown status", tv_status_string((tv_status)i)) != 0);
    for (j = TV_OK; j < i; ++j) {
      TEST_ASSERT_TRUE(strcmp(tv_status_string((tv_status)i), tv_status_string((tv_status)j)) != 0);
    }
  }
  TEST_ASSERT_EQUAL_STRING("unknown status", tv_status_string((tv_status)99));
  TEST_ASSERT_EQUAL_STRING("unknown status", tv_status_string((tv_status)-1));
  TEST_ASSERT_EQUAL_STRING(TV_VERSION_STRING, tv_version_string());
  TEST_ASSERT_EQUAL_STRING("neon", tv_kernels_string(TV_KERNELS_NEON));
  TEST_ASSERT_EQUAL_STRING("unknown", tv_kernels_string((tv_kernels)6));
  TEST_ASSERT_EQUAL_STRING("planar_or_panoramic", tv_kind_string(TV_KIND_PLANAR_OR_PANORAMIC));
  TEST_ASSERT_EQUAL_STRING("no_motion", tv_kind_string(TV_KIND_NO_MOTION));
  TEST_ASSERT_EQUAL_STRING("unknown", tv_kind_string((tv_kind)7));
  TEST_ASSERT_EQUAL_STRING("doubtful", tv_verdict_string(TV_VERDICT_DOUBTFUL));
  TEST_ASSERT_EQUAL_STRING("unknown", tv_verdict_string((tv_verdict)3));
  TEST_ASSERT_EQUAL_STRING("low_parallax", tv_reason_string(TV_REASON_LOW_PARALLAX));
  TEST_ASSERT_EQUAL_STRING("repeated_structure", tv_reason_string(TV_REASON_REPEATED_STRUCTURE));
  TEST_ASSERT_EQUAL_STRING("camera_contradicted", tv_reason_string(TV_REASON_CAMERA_CONTRADICTED));
  TEST_ASSERT_EQUAL_STRING("unknown", tv_reason_string((tv_reason)3));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_bad_cameras_are_refused_everywhere);
  RUN_TEST(test_numbers_that_are_not_finite_are_refused);
  RUN_TEST(test_outside_the_lens_is_refused_and_outputs_stay);
  RUN_TEST(test_every_pixel_of_the_ardrone_comes_back);
  RUN_TEST(test_jacobians_are_row_major);
  RUN_TEST(test_undistort_gives_the_pinhole_pixel_of_the_same_ray);
  RUN_TEST(test_undistort_refuses_rays_beside_a_fisheye);
  RUN_TEST(test_valid_angle_of_each_model);
  RUN_TEST(test_scale_keeps_pixel_centres);
  RUN_TEST(test_scale_out_of_range_is_refused);
  RUN_TEST(test_results_too_large_for_a_double_are_outside);
  RUN_TEST(test_many_points_have_the_pixels_of_each_one);
  RUN_TEST(test_many_points_refuse_what_one_refuses);
  RUN_TEST(test_many_pixels_have_the_rays_of_each_one);
  RUN_TEST(test_many_pixels_refuse_what_one_refuses);
  RUN_TEST(test_every_number_has_its_name);
  return UNITY_END();
}
