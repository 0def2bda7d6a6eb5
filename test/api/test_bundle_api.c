/* Tests of tv_adjust_two_view and tv_point_covariances: the statuses and outputs that the header
   promises. */
#include <math.h>
#include <string.h>

#include "support/api.h"
#include "support/calls.h"

#define NUM_POINTS 20

static tv_camera_pair pair, start_pair;
static double pixels0[2 * NUM_POINTS], pixels1[2 * NUM_POINTS];
static tv_point points[NUM_POINTS + 1], start[NUM_POINTS + 1];
static tv_bundle_options options;
static tv_bundle_result result, start_result;
static double covariances[9 * NUM_POINTS + 1];
static api_context a;

/* Twenty points at depths of 4 to 10, which are about 2 to 5 baselines; pixels are rounded down
   to multiples of 0.5, which is the noise. */
void setUp(void) {
  const double t[3] = {-2, 0, 0.5};
  uint64_t seed = 1;
  int i, k;
  tv_limits limits;
  memset(&pair, 0, sizeof pair);
  pair.camera0.model = TV_CAMERA_PINHOLE;
  pair.camera0.width = 640, pair.camera0.height = 480;
  pair.camera0.fx = pair.camera0.fy = 500, pair.camera0.cx = 320, pair.camera0.cy = 240;
  pair.camera1 = pair.camera0;
  for (i = 0; i < 9; ++i) pair.cam1_from_cam0_R[i] = i % 4 == 0;
  memcpy(pair.cam1_from_cam0_t, t, sizeof t);
  memset(start, 0x5a, sizeof start);
  for (i = 0; i < NUM_POINTS; ++i) {
    const double z = 4 + 6 * random_unit(&seed);
    const double X[3] = {z * (random_unit(&seed) - 0.3), z * (random_unit(&seed) - 0.5) * 0.8, z};
    const double moved[3] = {X[0] + t[0], X[1], X[2] + t[2]};
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&pair.camera0, X, pixels0 + 2 * i, NULL));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&pair.camera1, moved, pixels1 + 2 * i, NULL));
    for (k = 0; k < 2; ++k) {
      pixels0[2 * i + k] = floor(2 * pixels0[2 * i + k]) / 2;
      pixels1[2 * i + k] = floor(2 * pixels1[2 * i + k]) / 2;
    }
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, triangulate_pixels(&pair, pixels0, pixels1, NUM_POINTS,
                                                  TV_TRIANGULATION_MIDPOINT, start));
  start_pair = pair;
  memcpy(points, start, sizeof points);
  tv_bundle_options_init(&options);
  tv_bundle_result_init(&result);
  start_result = result;
  tv_limits_init(&limits);
  limits.max_matches = NUM_POINTS;
  a = api_make(&limits);
}

void tearDown(void) { api_release(&a); }

static tv_status run(void) {
  return adjust_pixels(a.context, pixels0, pixels1, NUM_POINTS, &options, &pair, points, &result);
}

static void expect_untouched(void) {
  TEST_ASSERT_EQUAL_MEMORY(&start_pair, &pair, sizeof pair);
  TEST_ASSERT_EQUAL_MEMORY(start, points, sizeof points);
  TEST_ASSERT_EQUAL_MEMORY(&start_result, &result, sizeof result);
}

static void expect_refusal(tv_status expected) {
  TEST_ASSERT_EQUAL_INT(expected, run());
  expect_untouched();
}

static void test_adjusts_pose_and_points(void) {
  const double *const t = pair.cam1_from_cam0_t;
  int i;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(NUM_POINTS, result.num_points);
  TEST_ASSERT_TRUE(result.converged);
  TEST_ASSERT_TRUE(result.final_cost < result.initial_cost);
  TEST_ASSERT_TRUE(result.rms_px < result.initial_rms_px);
  TEST_ASSERT_TRUE(result.has_covariance);
  TEST_ASSERT_TRUE(result.noise_px > 0.05 && result.noise_px < 0.5);
  TEST_ASSERT_TRUE(result.num_iterations > 0 && result.num_iterations <= 50);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, 4.25, t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
  TEST_ASSERT_EQUAL_MEMORY(&start_pair.camera0, &pair.camera0, 2 * sizeof pair.camera0);
  for (i = 0; i < NUM_POINTS; ++i) TEST_ASSERT_EQUAL_INT(TV_POINT_OK, points[i].status);
  TEST_ASSERT_EQUAL_MEMORY(&start[NUM_POINTS], &points[NUM_POINTS], sizeof(tv_point));
}

static void test_defaults_and_no_result_are_fine(void) {
  tv_point by_default[NUM_POINTS + 1];
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  memcpy(by_default, points, sizeof points);
  pair = start_pair;
  memcpy(points, start, sizeof points);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, adjust_pixels(a.context, pixels0, pixels1, NUM_POINTS, NULL, &pair, points, NULL));
  TEST_ASSERT_EQUAL_MEMORY(by_default, points, sizeof points);
}

static void test_no_iterations_only_measure(void) {
  int i, k;
  options.max_iterations = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_MEMORY(&start_pair, &pair, sizeof pair);
  TEST_ASSERT_EQUAL_INT(0, result.num_iterations);
  TEST_ASSERT_FALSE(result.converged);
  TEST_ASSERT_EQUAL_DOUBLE(result.initial_cost, result.final_cost);
  for (i = 0; i < NUM_POINTS; ++i) {
    for (k = 0; k < 3; ++k) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-12, start[i].position[k], points[i].position[k]);
    }
    TEST_ASSERT_FLOAT_WITHIN(1e-5f, start[i].error_px, points[i].error_px);
    TEST_ASSERT_FLOAT_WITHIN(1e-2f, start[i].angle_rad, points[i].angle_rad);
  }
}

static void test_no_points_are_fine(void) {
  TEST_ASSERT_EQUAL_INT(TV_OK, adjust_pixels(a.context, NULL, NULL, 0, NULL, &pair, NULL, &result));
  TEST_ASSERT_EQUAL_INT(0, result.num_points);
  TEST_ASSERT_EQUAL_DOUBLE(0, result.rms_px);
  TEST_ASSERT_FALSE(result.has_covariance);
  TEST_ASSERT_EQUAL_MEMORY(&start_pair, &pair, sizeof pair);
}

static void test_null_pointers_are_refused(void) {
  tv_context *c = a.context;
  const int n = NUM_POINTS;
  tv_bundle_options *o = &options;
  tv_bundle_result *r = &result;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, adjust_pixels(NULL, pixels0, pixels1, n, o, &pair, points, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_adjust_two_view(c, NULL, o, &pair, points, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, adjust_pixels(c, NULL, pixels1, n, o, &pair, points, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, adjust_pixels(c, pixels0, NULL, n, o, &pair, points, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, adjust_pixels(c, pixels0, pixels1, n, o, NULL, points, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, adjust_pixels(c, pixels0, pixels1, n, o, &pair, NULL, r));
  expect_untouched();
  tv_bundle_options_init(NULL);
  tv_bundle_result_init(NULL);
}

static void test_options_out_of_range_are_refused(void) {
  const tv_bundle_options good = options;
  options.struct_size = 0, expect_refusal(TV_ERR_STRUCT_SIZE), options = good;
  options.loss = 3, expect_refusal(TV_ERR_ARGUMENT), options = good;
  options.loss = -1, expect_refusal(TV_ERR_ARGUMENT), options = good;
  options.loss_scale_px = 0, expect_refusal(TV_ERR_ARGUMENT), options = good;
  options.loss_scale_px = -1, expect_refusal(TV_ERR_ARGUMENT), options = good;
  options.loss_scale_px = 2e9, expect_refusal(TV_ERR_ARGUMENT), options = good;
  options.loss_scale_px = NAN, expect_refusal(TV_ERR_NOT_FINITE), options = good;
  options.max_iterations = -1, expect_refusal(TV_ERR_ARGUMENT), options = good;
  options.max_iterations = 1001, expect_refusal(TV_ERR_ARGUMENT), options = good;
  options.hold_pose = 2, expect_refusal(TV_ERR_ARGUMENT), options = good;
  result.struct_size = start_result.struct_size = 1;
  expect_refusal(TV_ERR_STRUCT_SIZE);
}

/* That the present pair is refused and stays as it is; then it is as setUp made it. */
static void expect_pair_refused(tv_status expected) {
  const tv_camera_pair good = start_pair;
  start_pair = pair;
  expect_refusal(expected);
  pair = start_pair = good;
}

static void test_poses_cameras_and_counts_are_checked(void) {
  double *const R = pair.cam1_from_cam0_R, *const t = pair.cam1_from_cam0_t;
  R[0] = 1 + 1e-5, expect_pair_refused(TV_ERR_ARGUMENT);
  R[5] = NAN, expect_pair_refused(TV_ERR_NOT_FINITE);
  t[1] = INFINITY, expect_pair_refused(TV_ERR_NOT_FINITE);
  t[0] = t[1] = t[2] = 0, expect_pair_refused(TV_ERR_ARGUMENT);
  /* The length of t overflows to infinity. */
  t[0] = t[1] = t[2] = 1.5e308, expect_pair_refused(TV_ERR_ARGUMENT);
  t[0] = -1e-300, t[1] = t[2] = 0;
  pair.camera1.fx = 0, expect_pair_refused(TV_ERR_CAMERA);
  pair.camera0.fy = 0, expect_pair_refused(TV_ERR_CAMERA);
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, adjust_pixels(a.context, pixels0, pixels1, -1, &options,
                                                       &pair, points, &result));
  TEST_ASSERT_EQUAL_INT(TV_ERR_LIMITS, adjust_pixels(a.context, pixels0, pixels1, NUM_POINTS + 1,
                                                     &options, &pair, points, &result));
  expect_untouched();
}

static void test_sigmas_are_checked(void) {
  static float sigmas[NUM_POINTS];
  const float bad[] = {0, -1, 0.0099f, 1000.1f, NAN, INFINITY};
  tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, NUM_POINTS);
  int v, k;
  for (k = 0; k < NUM_POINTS; ++k) sigmas[k] = 1;
  for (v = 0; v < 2; ++v) {
    pairs.sigmas0 = v == 0 ? sigmas : NULL;
    pairs.sigmas1 = v == 1 ? sigmas : NULL;
    for (k = 0; k < (int)(sizeof bad / sizeof bad[0]); ++k) {
      sigmas[NUM_POINTS - 1] = bad[k];
      TEST_ASSERT_EQUAL_INT(
          isfinite(bad[k]) ? TV_ERR_ARGUMENT : TV_ERR_NOT_FINITE,
          tv_adjust_two_view(a.context, &pairs, &options, &pair, points, &result));
      expect_untouched();
    }
    sigmas[NUM_POINTS - 1] = 1;
  }
  /* The points over the sigmas: their bytes are sigmas of about 2. */
  memset(start, 0x40, sizeof start);
  memcpy(points, start, sizeof points);
  pairs.sigmas1 = (const float *)points;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_adjust_two_view(a.context, &pairs, &options, &pair, points, &result));
  expect_untouched();
}

static void test_outputs_may_not_overlap(void) {
  tv_context *c = a.context;
  double *inside = (double *)points;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, adjust_pixels(c, inside, pixels1, NUM_POINTS, &options,
                                                      &pair, points, &result));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, adjust_pixels(c, pixels0, inside, NUM_POINTS, &options,
                                                      &pair, points, &result));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, adjust_pixels(c, pixels0, pair.cam1_from_cam0_R, 2,
                                                      &options, &pair, points, &result));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, adjust_pixels(c, pixels0, pixels1, 1, &options, &pair,
                                                      (tv_point *)(void *)&pair.camera1, &result));
  expect_untouched();
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_OVERLAP, tv_point_covariances(&pair, points, NUM_POINTS, 0.5, NULL, (double *)points));
  expect_untouched();
}

static void test_covariances_are_symmetric_grow_with_the_pose_and_scale_with_t(void) {
  double with_pose[9 * NUM_POINTS], doubled[9 * NUM_POINTS];
  int i, k;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  covariances[9 * NUM_POINTS] = 77;
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_point_covariances(&pair, points, NUM_POINTS, 0.5, NULL, covariances));
  TEST_ASSERT_EQUAL_DOUBLE(77, covariances[9 * NUM_POINTS]);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_point_covariances(&pair, points, NUM_POINTS, 0.5, result.covariance, with_pose));
  for (i = 0; i < NUM_POINTS; ++i) {
    const double *C = covariances + 9 * i, *D = with_pose + 9 * i;
    TEST_ASSERT_TRUE(C[0] > 0 && C[4] > 0 && C[8] > 0);
    TEST_ASSERT_EQUAL_DOUBLE(C[1], C[3]);
    TEST_ASSERT_EQUAL_DOUBLE(C[2], C[6]);
    TEST_ASSERT_EQUAL_DOUBLE(C[5], C[7]);
    TEST_ASSERT_TRUE(D[0] > C[0] && D[4] > C[4] && D[8] > C[8]);
  }
  for (k = 0; k < 3; ++k) pair.cam1_from_cam0_t[k] *= 2;
  for (i = 0; i < NUM_POINTS; ++i) {
    for (k = 0; k < 3; ++k) points[i].position[k] *= 2;
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_point_covariances(&pair, points, NUM_POINTS, 0.5, NULL, doubled));
  for (k = 0; k < 9 * NUM_POINTS; ++k) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-9 * fabs(doubled[k]) + 1e-15, 4 * covariances[k], doubled[k]);
  }
}

static void test_points_that_are_not_ok_have_zero_covariance(void) {
  const double zeros[9] = {0};
  int i;
  points[0].status = TV_POINT_BEHIND;
  points[1].status = TV_POINT_INFINITE;
  points[2].status = TV_POINT_INVALID;
  points[3].position[0] = NAN;
  points[4].position[2] = -1; /* a depth below 0: behind camera 0 */
  for (i = 0; i < 3; ++i) points[5].position[i] = (i == 0 ? 2 : i == 2 ? -0.5 : 0) * 3;
  for (i = 0; i < 3; ++i) points[6].position[i] = 0;
  for (i = 0; i < 3; ++i) points[7].position[i] *= 1e200;
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_point_covariances(&pair, points, NUM_POINTS, 0.5, NULL, covariances));
  for (i = 0; i < NUM_POINTS; ++i) {
    const double *C = covariances + 9 * i;
    TEST_ASSERT_TRUE(i < 8 ? memcmp(zeros, C, sizeof zeros) == 0 : C[0] > 0);
  }
}

static void test_covariances_check_their_arguments(void) {
  double pose[25] = {0}, untouched[9 * NUM_POINTS];
  const int n = NUM_POINTS;
  memset(covariances, 0x5a, sizeof covariances);
  memcpy(untouched, covariances, sizeof untouched);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_point_covariances(NULL, points, n, 1, NULL, covariances));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_point_covariances(&pair, NULL, n, 1, NULL, covariances));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_point_covariances(&pair, points, n, 1, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_point_covariances(&pair, points, n, -1, NULL, covariances));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_point_covariances(&pair, points, -1, 1, NULL, covariances));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE,
                        tv_point_covariances(&pair, points, n, NAN, NULL, covariances));
  pose[7] = INFINITY;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE,
                        tv_point_covariances(&pair, points, n, 1, pose, covariances));
  pair.cam1_from_cam0_R[0] = 2;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_point_covariances(&pair, points, n, 1, NULL, covariances));
  pair.cam1_from_cam0_R[0] = 1, pair.camera0.fy = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA,
                        tv_point_covariances(&pair, points, n, 1, NULL, covariances));
  TEST_ASSERT_EQUAL_MEMORY(untouched, covariances, sizeof untouched);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_adjusts_pose_and_points);
  RUN_TEST(test_defaults_and_no_result_are_fine);
  RUN_TEST(test_no_iterations_only_measure);
  RUN_TEST(test_no_points_are_fine);
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_options_out_of_range_are_refused);
  RUN_TEST(test_poses_cameras_and_counts_are_checked);
  RUN_TEST(test_sigmas_are_checked);
  RUN_TEST(test_outputs_may_not_overlap);
  RUN_TEST(test_covariances_are_symmetric_grow_with_the_pose_and_scale_with_t);
  RUN_TEST(test_points_that_are_not_ok_have_zero_covariance);
  RUN_TEST(test_covariances_check_their_arguments);
  return UNITY_END();
}
