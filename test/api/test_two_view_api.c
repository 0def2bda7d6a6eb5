/* Tests of tv_estimate_two_view: the statuses and outputs that the header promises, and the kinds
   of pairs. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "support/api.h"
#include "support/calls.h"

enum { MAX_MATCHES = 1000 };

static api_context api;
static tv_camera camera0, camera1;
static tv_estimate_options options;
static tv_two_view result;
static tv_evidence evidence;
static double pixels0[2 * MAX_MATCHES], pixels1[2 * MAX_MATCHES];
static float ratios[MAX_MATCHES];
static uint8_t mask[MAX_MATCHES];
static double true_R[9], true_t[3];
static uint64_t seed;

static double uniform(double low, double high) { return low + (high - low) * random_unit(&seed); }

static void turn_about_y_and_x(double about_y, double about_x, double R[9]) {
  const double c = cos(about_y), s = sin(about_y), d = cos(about_x), e = sin(about_x);
  const double product[9] = {c, 0, s, e * s, d, -e * c, -d * s, e, d * c};
  memcpy(R, product, sizeof product);
}

static void motion(double about_y, double about_x, double x, double y, double z) {
  const double length = sqrt(x * x + y * y + z * z);
  turn_about_y_and_x(about_y, about_x, true_R);
  true_t[0] = x / length, true_t[1] = y / length, true_t[2] = z / length;
}

static int see(const double point[3], double baseline, int i) {
  double moved[3];
  int k;
  for (k = 0; k < 3; ++k) {
    moved[k] = true_R[3 * k] * point[0] + true_R[3 * k + 1] * point[1] +
               true_R[3 * k + 2] * point[2] + baseline * true_t[k];
  }
  return tv_camera_project(&camera0, point, pixels0 + 2 * i, NULL) == TV_OK &&
         tv_camera_project(&camera1, moved, pixels1 + 2 * i, NULL) == TV_OK;
}

/* Makes matches of points in a field of view of about 60 degrees. flatness 0 gives depths of 4
   to 12 in the unit of `baseline`, flatness 1 a slanted plane. */
static void make_scene(int count, double flatness, double baseline) {
  int i;
  for (i = 0; i < count; ++i) {
    double point[3], depth;
    do {
      point[0] = uniform(-0.55, 0.55), point[1] = uniform(-0.4, 0.4), point[2] = 1;
      depth =
          flatness / (0.12 + 0.05 * point[0] - 0.04 * point[1]) + (1 - flatness) * uniform(4, 12);
      point[0] *= depth, point[1] *= depth, point[2] = depth;
    } while (!see(point, baseline, i));
  }
}

static void spoil(int begin, int end) {
  for (; begin < end; ++begin) {
    pixels1[2 * begin] = uniform(0, 640);
    pixels1[2 * begin + 1] = uniform(0, 480);
  }
}

void setUp(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 64;
  limits.max_keypoints = 64;
  limits.max_matches = MAX_MATCHES;
  api = api_make(&limits);
  memset(&camera0, 0, sizeof camera0);
  camera0.model = TV_CAMERA_PINHOLE;
  camera0.width = 640, camera0.height = 480;
  camera0.fx = 500, camera0.fy = 510, camera0.cx = 320, camera0.cy = 240;
  camera1 = camera0;
  camera1.fx = 520, camera1.fy = 515, camera1.cx = 330;
  tv_estimate_options_init(&options);
  tv_two_view_init(&result);
  memset(mask, API_PATTERN, sizeof mask);
  seed = 6;
  motion(0.1, -0.05, 1, 0.2, 0.3);
  make_scene(MAX_MATCHES, 0, 1);
}

void tearDown(void) { api_release(&api); }

static double dot3(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double norm(const double *values, int count) {
  double sum = 0;
  int k;
  for (k = 0; k < count; ++k) sum += values[k] * values[k];
  return sqrt(sum);
}

static double distance(const double *a, const double *b, int count) {
  double difference[25];
  int k;
  for (k = 0; k < count; ++k) difference[k] = a[k] - b[k];
  return norm(difference, count);
}

static void expect_flagged(int has, const double *values, int count) {
  int k;
  TEST_ASSERT_TRUE(has == 0 || has == 1);
  for (k = 0; k < count; ++k) {
    TEST_ASSERT_TRUE(isfinite(values[k]));
    TEST_ASSERT_TRUE(has || values[k] == 0);
  }
}

static void expect_rotation(const double R[9]) {
  int i, j;
  for (i = 0; i < 3; ++i) {
    for (j = 0; j < 3; ++j) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-14, i == j, dot3(R + 3 * i, R + 3 * j));
    }
  }
  TEST_ASSERT_DOUBLE_WITHIN(1e-14,
                            R[0] * R[4] * R[8] + R[1] * R[5] * R[6] + R[2] * R[3] * R[7] -
                                R[2] * R[4] * R[6] - R[1] * R[3] * R[8] - R[0] * R[5] * R[7],
                            1);
}

/* E = [t]x R and F = K1^-T E K0^-1, each of norm 1. */
static void expect_e_and_f_of_pose(int cameras_given) {
  const double *R = result.R, *t = result.t;
  double E[9], F[9], scale;
  int c, k;
  for (c = 0; c < 3; ++c) {
    E[c] = t[1] * R[6 + c] - t[2] * R[3 + c];
    E[3 + c] = t[2] * R[c] - t[0] * R[6 + c];
    E[6 + c] = t[0] * R[3 + c] - t[1] * R[c];
  }
  scale = norm(E, 9);
  for (k = 0; k < 9; ++k) E[k] /= scale;
  TEST_ASSERT_TRUE(distance(E, result.E, 9) < 1e-14);
  if (!cameras_given) return;
  for (k = 0; k < 3; ++k) { /* F = E K0^-1, row by row */
    F[3 * k] = E[3 * k] / camera0.fx;
    F[3 * k + 1] = E[3 * k + 1] / camera0.fy;
    F[3 * k + 2] = E[3 * k + 2] - F[3 * k] * camera0.cx - F[3 * k + 1] * camera0.cy;
  }
  for (k = 0; k < 3; ++k) { /* F = K1^-T F, column by column */
    F[k] /= camera1.fx;
    F[3 + k] /= camera1.fy;
    F[6 + k] -= F[k] * camera1.cx + F[3 + k] * camera1.cy;
  }
  scale = norm(F, 9);
  for (k = 0; k < 9; ++k) F[k] /= scale;
  TEST_ASSERT_TRUE(distance(F, result.F, 9) < 1e-12);
}

static void expect_covariance(void) {
  int i, j;
  for (i = 0; i < 5; ++i) {
    TEST_ASSERT_TRUE(result.covariance[6 * i] >= 0);
    for (j = 0; j < 5; ++j) {
      const double entry = result.covariance[5 * i + j];
      TEST_ASSERT_TRUE(fabs(entry - result.covariance[5 * j + i]) <= 1e-12 * fabs(entry));
      TEST_ASSERT_TRUE(entry * entry <=
                       (1 + 1e-9) * result.covariance[6 * i] * result.covariance[6 * j]);
    }
  }
}

static const uint8_t has_by_config[7][5] = {
    /* 1: a pair of this kind has R, t, E, F, H */
    {0, 0, 0, 0, 0}, /* TV_KIND_DEGENERATE */
    {1, 1, 1, 1, 0}, /* TV_KIND_CALIBRATED */
    {0, 0, 0, 1, 0}, /* TV_KIND_UNCALIBRATED */
    {1, 1, 1, 1, 1}, /* TV_KIND_PLANAR */
    {1, 0, 0, 0, 0}, /* TV_KIND_PANORAMIC */
    {0, 0, 0, 0, 1}, /* TV_KIND_PLANAR_OR_PANORAMIC */
    {1, 0, 0, 0, 0}, /* TV_KIND_NO_MOTION */
};

static void expect_sound(int count, int cameras_given) {
  const uint8_t *has;
  int i, inliers = 0;
  TEST_ASSERT_EQUAL_UINT32(sizeof result, result.struct_size);
  TEST_ASSERT_TRUE(result.kind >= 0 && result.kind <= TV_KIND_NO_MOTION);
  TEST_ASSERT_TRUE(result.verdict >= 0 && result.verdict <= TV_VERDICT_OK);
  TEST_ASSERT_EQUAL_INT(result.verdict == TV_VERDICT_OK, result.reasons == 0);
  TEST_ASSERT_TRUE(result.has_alternative_covariance <= result.has_alternative);
  TEST_ASSERT_EQUAL_INT(count, result.num_matches);
  for (i = 0; i < count; ++i) {
    TEST_ASSERT_TRUE(mask[i] <= 1);
    inliers += mask[i];
  }
  TEST_ASSERT_EQUAL_INT(inliers, result.num_inliers);
  TEST_ASSERT_TRUE(count >= MAX_MATCHES || mask[count] == API_PATTERN);
  expect_flagged(result.has_R, result.R, 9);
  expect_flagged(result.has_t, result.t, 3);
  expect_flagged(result.has_E, result.E, 9);
  expect_flagged(result.has_F, result.F, 9);
  expect_flagged(result.has_H, result.H, 9);
  expect_flagged(result.has_alternative_covariance, result.alternative_covariance, 25);
  expect_flagged(result.has_alternative, result.alternative_R, 9);
  expect_flagged(result.has_alternative, result.alternative_t, 3);
  expect_flagged(result.has_covariance, result.covariance, 25);
  has = has_by_config[result.kind];
  TEST_ASSERT_EQUAL_INT(has[0] && cameras_given, result.has_R);
  TEST_ASSERT_EQUAL_INT(has[1], result.has_t);
  TEST_ASSERT_EQUAL_INT(has[2], result.has_E);
  TEST_ASSERT_EQUAL_INT(has[3], result.has_F);
  TEST_ASSERT_EQUAL_INT(has[4], result.has_H);
  if (result.has_R) expect_rotation(result.R);
  if (result.has_t) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 1, norm(result.t, 3));
    expect_e_and_f_of_pose(cameras_given);
  }
  if (result.has_alternative) {
    TEST_ASSERT_EQUAL_INT(TV_KIND_PLANAR, result.kind);
    expect_rotation(result.alternative_R);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 1, norm(result.alternative_t, 3));
  }
  if (result.has_F) TEST_ASSERT_DOUBLE_WITHIN(1e-14, 1, norm(result.F, 9));
  if (result.has_H && result.H[8] != 1) TEST_ASSERT_DOUBLE_WITHIN(1e-14, 1, norm(result.H, 9));
  if (result.has_covariance) expect_covariance();
  TEST_ASSERT_TRUE(evidence.coverage >= 0 && evidence.coverage <= 1);
  TEST_ASSERT_TRUE(result.probability_wrong > 0 && result.probability_wrong <= 1);
  TEST_ASSERT_TRUE((result.has_R && result.has_t) || result.probability_wrong == 1);
  TEST_ASSERT_TRUE(result.median_parallax_rad >= 0 && result.median_parallax_rad <= 3.15);
  TEST_ASSERT_TRUE(result.rms_error_px >= 0 && result.rms_error_px <= options.max_error_px * 1.25);
  TEST_ASSERT_TRUE(result.num_iterations >= 0 && result.num_iterations <= options.max_iterations);
  TEST_ASSERT_EQUAL_UINT64(options.seed, result.seed);
}

static void estimate(int count) {
  memset(mask, API_PATTERN, sizeof mask);
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_evidence(api.context, &camera0, &camera1, pixels0, pixels1,
                                                 NULL, count, &options, &result, &evidence, mask));
  expect_sound(count, 1);
}

static void estimate_uncalibrated(int count, int method) {
  options.method = method;
  memset(mask, API_PATTERN, sizeof mask);
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_evidence(api.context, NULL, NULL, pixels0, pixels1, NULL,
                                                 count, &options, &result, &evidence, mask));
  expect_sound(count, 0);
}

static void expect_refusal(tv_status expected, const tv_camera *c0, const tv_camera *c1,
                           int32_t count) {
  tv_two_view before;
  memset(&before, API_PATTERN, sizeof before);
  before.struct_size = sizeof before;
  result = before;
  memset(mask, API_PATTERN, sizeof mask);
  TEST_ASSERT_EQUAL_INT(expected, estimate_pixels(api.context, c0, c1, pixels0, pixels1, NULL,
                                                  count, &options, &result, mask));
  TEST_ASSERT_EQUAL_MEMORY(&before, &result, sizeof before);
  TEST_ASSERT_TRUE(api_is_pattern(mask, sizeof mask));
}

static void expect_options_refused(tv_status expected) {
  expect_refusal(expected, &camera0, &camera1, MAX_MATCHES);
  tv_estimate_options_init(&options);
}

static void test_init_sets_the_documented_defaults(void) {
  tv_two_view zero;
  tv_calibration exact;
  memset(&options, API_PATTERN, sizeof options);
  tv_estimate_options_init(&options);
  TEST_ASSERT_EQUAL_UINT32(sizeof options, options.struct_size);
  TEST_ASSERT_EQUAL_INT(TV_SOLVER_AUTO, options.method);
  TEST_ASSERT_TRUE(options.max_error_px == 1.0 && options.confidence == 0.9999);
  TEST_ASSERT_EQUAL_INT(10000, options.max_iterations);
  TEST_ASSERT_EQUAL_INT(0, options.fixed_iterations);
  memset(&exact, 0, sizeof exact);
  TEST_ASSERT_EQUAL_MEMORY(&exact, &options.calibration0, sizeof exact);
  TEST_ASSERT_EQUAL_MEMORY(&exact, &options.calibration1, sizeof exact);
  memset(&result, API_PATTERN, sizeof result);
  tv_two_view_init(&result);
  TEST_ASSERT_EQUAL_UINT32(sizeof result, result.struct_size);
  memset(&zero, 0, sizeof zero);
  zero.struct_size = sizeof zero;
  TEST_ASSERT_EQUAL_MEMORY(&zero, &result, sizeof zero);
  tv_estimate_options_init(NULL);
  tv_two_view_init(NULL);
}

static void test_null_pointers_are_refused(void) {
  const tv_camera *c0 = &camera0, *c1 = &camera1;
  const tv_two_view before = result;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, estimate_pixels(NULL, c0, c1, pixels0, pixels1, NULL, 10,
                                                     &options, &result, mask));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, estimate_pixels(api.context, c0, c1, NULL, pixels1, NULL, 10,
                                                     &options, &result, mask));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, estimate_pixels(api.context, c0, c1, pixels0, NULL, NULL, 10,
                                                     &options, &result, mask));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, estimate_pixels(api.context, c0, c1, pixels0, pixels1, NULL,
                                                     10, &options, NULL, mask));
  TEST_ASSERT_EQUAL_MEMORY(&before, &result, sizeof before);
  TEST_ASSERT_TRUE(api_is_pattern(mask, sizeof mask));
}

static void test_null_is_fine_where_the_header_says_so(void) {
  tv_two_view with_mask;
  estimate(MAX_MATCHES);
  with_mask = result;
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_pixels(api.context, &camera0, &camera1, pixels0, pixels1,
                                               NULL, MAX_MATCHES, NULL, &result, NULL));
  TEST_ASSERT_EQUAL_MEMORY(&with_mask, &result, sizeof result);
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_pixels(api.context, &camera0, &camera1, NULL, NULL, NULL, 0,
                                               &options, &result, NULL));
  TEST_ASSERT_EQUAL_INT(TV_KIND_DEGENERATE, result.kind);
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_pixels(api.context, NULL, NULL, pixels0, pixels1, NULL,
                                               MAX_MATCHES, NULL, &result, NULL));
  TEST_ASSERT_EQUAL_INT(TV_KIND_UNCALIBRATED, result.kind);
}

static void test_wrong_struct_sizes_are_refused(void) {
  tv_two_view before;
  options.struct_size -= 1, expect_options_refused(TV_ERR_STRUCT_SIZE);
  options.struct_size = 0, expect_options_refused(TV_ERR_STRUCT_SIZE);
  memset(&result, 0, sizeof result);
  before = result;
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE,
                        estimate_pixels(api.context, &camera0, &camera1, pixels0, pixels1, NULL, 10,
                                        &options, &result, mask));
  TEST_ASSERT_EQUAL_MEMORY(&before, &result, sizeof before);
}

static void test_options_out_of_range_are_refused(void) {
  const double bad[3] = {NAN, INFINITY, -INFINITY};
  const int methods[4] = {-1, TV_SOLVER_UPRIGHT, 5, 1 << 30};
  int k;
  for (k = 0; k < 3; ++k) {
    options.max_error_px = bad[k], expect_options_refused(TV_ERR_NOT_FINITE);
    options.confidence = bad[k], expect_options_refused(TV_ERR_NOT_FINITE);
  }
  for (k = 0; k < 4; ++k) options.method = methods[k], expect_options_refused(TV_ERR_ARGUMENT);
  options.max_error_px = 0, expect_options_refused(TV_ERR_ARGUMENT);
  options.max_error_px = -1, expect_options_refused(TV_ERR_ARGUMENT);
  options.max_error_px = 1.0000001e9, expect_options_refused(TV_ERR_ARGUMENT);
  options.confidence = 1, expect_options_refused(TV_ERR_ARGUMENT);
  options.confidence = -1e-9, expect_options_refused(TV_ERR_ARGUMENT);
  options.max_iterations = 0, expect_options_refused(TV_ERR_ARGUMENT);
  options.max_iterations = 1000001, expect_options_refused(TV_ERR_ARGUMENT);
  options.fixed_iterations = -1, expect_options_refused(TV_ERR_ARGUMENT);
  options.fixed_iterations = 1000001, expect_options_refused(TV_ERR_ARGUMENT);
  options.confidence = 0, options.max_iterations = 1, estimate(100);
}

/* Of either camera, and whether or not the cameras are equal. */
static void test_calibrations_out_of_range_are_refused(void) {
  static const double low[3] = {NAN, INFINITY, -INFINITY}, outside[2] = {-1e-9, 0.5000001};
  int which, k;
  for (which = 0; which < 2; ++which) {
    tv_calibration *const c = which == 0 ? &options.calibration0 : &options.calibration1;
    tv_calibration *const other = which == 0 ? &options.calibration1 : &options.calibration0;
    for (k = 0; k < 3; ++k) {
      c->focal_sigma = low[k], expect_options_refused(TV_ERR_NOT_FINITE);
      c->center_sigma = low[k], expect_options_refused(TV_ERR_NOT_FINITE);
    }
    for (k = 0; k < 2; ++k) {
      c->focal_sigma = outside[k], expect_options_refused(TV_ERR_ARGUMENT);
      c->center_sigma = outside[k], expect_options_refused(TV_ERR_ARGUMENT);
    }
    c->refine = 4, expect_options_refused(TV_ERR_ARGUMENT);
    c->refine = 1u << 31 | TV_REFINE_FOCAL_LENGTH, expect_options_refused(TV_ERR_ARGUMENT);
    c->reserved = 1, expect_options_refused(TV_ERR_ARGUMENT);
    /* Where one camera's principal point may be refined, both deviations are at most 0.1. */
    c->refine = TV_REFINE_PRINCIPAL_POINT;
    c->center_sigma = 0.1000001, expect_options_refused(TV_ERR_ARGUMENT);
    c->refine = TV_REFINE_PRINCIPAL_POINT;
    other->center_sigma = 0.1000001, expect_options_refused(TV_ERR_ARGUMENT);
    c->refine = TV_REFINE_FOCAL_LENGTH | TV_REFINE_PRINCIPAL_POINT;
    c->center_sigma = 0.1, c->focal_sigma = 0.5, estimate(100);
    tv_estimate_options_init(&options);
    c->center_sigma = 0.5, c->refine = TV_REFINE_FOCAL_LENGTH, estimate(100);
    tv_estimate_options_init(&options);
  }
}

/* What has a deviation of 0 is exact, whatever the mask allows. */
static void test_a_mask_without_deviations_changes_nothing(void) {
  tv_two_view exact;
  camera1 = camera0;
  estimate(300);
  exact = result;
  options.calibration0.refine = TV_REFINE_FOCAL_LENGTH | TV_REFINE_PRINCIPAL_POINT;
  estimate(300);
  TEST_ASSERT_EQUAL_MEMORY(&exact, &result, sizeof result);
}

static void test_more_or_fewer_matches_than_there_can_be_are_refused(void) {
  expect_refusal(TV_ERR_LIMITS, &camera0, &camera1, MAX_MATCHES + 1);
  expect_refusal(TV_ERR_ARGUMENT, &camera0, &camera1, -1);
}

static void test_cameras_are_checked(void) {
  tv_camera bad = camera0;
  expect_refusal(TV_ERR_ARGUMENT, &camera0, NULL, 10);
  expect_refusal(TV_ERR_ARGUMENT, NULL, &camera1, 10);
  /* The five-point solver needs cameras, and none are given. */
  options.method = TV_SOLVER_FIVE_POINT;
  expect_refusal(TV_ERR_ARGUMENT, NULL, NULL, 10);
  bad.fx = 0;
  expect_refusal(TV_ERR_CAMERA, &bad, &camera1, 10);
  expect_refusal(TV_ERR_CAMERA, &camera0, &bad, 10);
  bad = camera0, bad.cx = NAN;
  expect_refusal(TV_ERR_CAMERA, &camera0, &bad, 10);
  bad = camera0, bad.model = 17;
  expect_refusal(TV_ERR_CAMERA, &bad, &camera1, 10);
}

static void test_the_mask_may_not_lie_over_an_input(void) {
  const tv_two_view before = result;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        estimate_pixels(api.context, &camera0, &camera1, pixels0, pixels1, NULL, 10,
                                        &options, &result, (uint8_t *)pixels0));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_OVERLAP, estimate_pixels(api.context, &camera0, &camera1, pixels0, pixels1, ratios, 10,
                                      &options, &result, (uint8_t *)ratios));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        estimate_pixels(api.context, &camera0, &camera1, pixels0, pixels1, NULL, 10,
                                        &options, &result, (uint8_t *)&result + 8));
  TEST_ASSERT_EQUAL_MEMORY(&before, &result, sizeof before);
}

/* Cameras, options and similar structs are inputs too: an output may not overlap them. */
static void test_outputs_may_not_lie_over_a_struct_of_the_call(void) {
  tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, 4);
  const tv_pixel_pairs pairs_before = pairs;
  const tv_estimate_options options_before = options;
  uint8_t *const over[] = {(uint8_t *)&pairs + 4, (uint8_t *)&options + 8, (uint8_t *)&camera0};
  size_t k;
  for (k = 0; k < sizeof over / sizeof over[0]; ++k) {
    TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                          tv_estimate_two_view(api.context, &camera0, &camera1, &pairs, &options,
                                               &result, NULL, over[k]));
  }
  TEST_ASSERT_EQUAL_MEMORY(&pairs_before, &pairs, sizeof pairs);
  TEST_ASSERT_EQUAL_MEMORY(&options_before, &options, sizeof options);
}

/* The result has the same bytes whether the evidence is asked for or not; the evidence is written
   as far as the caller's struct reaches, and not at all by a call that is refused. */
static void test_evidence_is_asked_for_by_a_pointer(void) {
  const tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, 300);
  tv_two_view without;
  tv_evidence whole, part, before;
  uint8_t mask_without[300];
  spoil(240, 300);
  tv_two_view_init(&without);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_two_view(api.context, &camera0, &camera1, &pairs,
                                                    &options, &without, NULL, mask_without));
  estimate(300);
  TEST_ASSERT_EQUAL_MEMORY(&without, &result, sizeof result);
  TEST_ASSERT_EQUAL_MEMORY(mask_without, mask, sizeof mask_without);
  whole = evidence;
  TEST_ASSERT_EQUAL_UINT32(sizeof whole, whole.struct_size);
  TEST_ASSERT_EQUAL_INT(result.num_inliers, whole.essential_inliers);
  TEST_ASSERT_EQUAL_INT(-1, whole.fundamental_inliers);
  TEST_ASSERT_TRUE(whole.num_places > 15 && whole.coverage > 0.3 && whole.agreement > 0.5);
  TEST_ASSERT_TRUE(whole.region_shift_rad > 0 && whole.camera_chi2 > 0);
  memset(&part, API_PATTERN, sizeof part);
  before = part;
  part.struct_size = before.struct_size = offsetof(tv_evidence, coverage);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_two_view(api.context, &camera0, &camera1, &pairs,
                                                    &options, &result, &part, NULL));
  TEST_ASSERT_EQUAL_UINT32(before.struct_size, part.struct_size);
  TEST_ASSERT_EQUAL_INT(whole.num_places, part.num_places);
  TEST_ASSERT_EQUAL_INT(whole.rotation_inliers, part.rotation_inliers);
  TEST_ASSERT_EQUAL_MEMORY(&before.coverage, &part.coverage,
                           sizeof part - offsetof(tv_evidence, coverage));
  before.struct_size = 3;
  part = before;
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE,
                        tv_estimate_two_view(api.context, &camera0, &camera1, &pairs, &options,
                                             &result, &part, NULL));
  TEST_ASSERT_EQUAL_MEMORY(&before, &part, sizeof part);
  without = result;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_estimate_two_view(api.context, &camera0, &camera1, &pairs, &options,
                                             &result, (tv_evidence *)&result, NULL));
  TEST_ASSERT_EQUAL_MEMORY(&without, &result, sizeof result);
  tv_evidence_init(NULL);
}

/* Sigmas: [0.01, 1000] and finite, in each of the two arrays and at any place. */
static void test_sigmas_out_of_range_are_refused(void) {
  static float sigmas[2][MAX_MATCHES];
  const float bad[] = {0, -1, 0.0099f, 1000.1f, -0.0f, NAN, INFINITY, -INFINITY};
  const float good[] = {0.01f, 1000, 1};
  const tv_two_view before = result;
  tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, 100);
  int v, k, place;
  TEST_ASSERT_TRUE(pairs.sigmas0 == NULL && pairs.sigmas1 == NULL);
  for (v = 0; v < 2; ++v) {
    for (k = 0; k < MAX_MATCHES; ++k) sigmas[v][k] = 1;
  }
  for (v = 0; v < 2; ++v) {
    pairs.sigmas0 = v == 0 ? sigmas[0] : NULL;
    pairs.sigmas1 = v == 1 ? sigmas[1] : NULL;
    for (place = 0; place < 100; place += 99) {
      for (k = 0; k < (int)(sizeof bad / sizeof bad[0]); ++k) {
        sigmas[v][place] = bad[k];
        TEST_ASSERT_EQUAL_INT(isfinite(bad[k]) ? TV_ERR_ARGUMENT : TV_ERR_NOT_FINITE,
                              tv_estimate_two_view(api.context, &camera0, &camera1, &pairs,
                                                   &options, &result, NULL, mask));
        TEST_ASSERT_EACH_EQUAL_UINT8(API_PATTERN, mask, 100);
        TEST_ASSERT_EQUAL_MEMORY(&before, &result, sizeof before);
      }
      for (k = 0; k < 3; ++k) {
        tv_two_view found;
        tv_two_view_init(&found);
        sigmas[v][place] = good[k];
        TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_two_view(api.context, &camera0, &camera1, &pairs,
                                                          &options, &found, NULL, NULL));
        TEST_ASSERT_EQUAL_INT(TV_KIND_CALIBRATED, found.kind);
      }
    }
    sigmas[v][100] = NAN; /* behind the last match: not read */
    TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                          tv_estimate_two_view(api.context, &camera0, &camera1, &pairs, &options,
                                               &result, NULL, (uint8_t *)&sigmas[v][99]));
    pairs.num = 0;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_two_view(api.context, &camera0, &camera1, &pairs,
                                                      &options, &result, NULL, NULL));
    result = before;
    pairs.num = 100;
    /* A caller of 0.1.0 has a struct that ends before the sigmas. */
    sigmas[v][0] = NAN;
    pairs.struct_size = offsetof(tv_pixel_pairs, sigmas0);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_two_view(api.context, &camera0, &camera1, &pairs,
                                                      &options, &result, NULL, NULL));
    result = before;
    pairs.struct_size = sizeof pairs;
  }
}

/* Sigmas of any size that is allowed, in any mixture, are no harm. */
static void test_extreme_sigmas_do_no_harm(void) {
  static float sigmas[2][MAX_MATCHES];
  tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, ratios, 300);
  int round, k;
  pairs.sigmas0 = sigmas[0];
  pairs.sigmas1 = sigmas[1];
  spoil(200, 300);
  for (round = 0; round < 40; ++round) {
    for (k = 0; k < 300; ++k) {
      sigmas[0][k] = random_unit(&seed) < 0.5 ? 0.01f : 1000.0f;
      sigmas[1][k] = round % 2 == 0 ? sigmas[0][k] : (float)uniform(0.01, 1000);
      ratios[k] = (float)random_unit(&seed);
    }
    options.max_error_px = round % 4 < 2 ? 1 : 1e-3;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_two_view(api.context, &camera0, &camera1, &pairs,
                                                      &options, &result, &evidence, mask));
    expect_sound(300, 1);
  }
}

/* With exact true matches and a fifth of wrong ones every solver finds the motion. */
static void test_every_method_finds_an_exact_motion(void) {
  int method;
  spoil(800, 1000);
  for (method = TV_SOLVER_FIVE_POINT; method <= TV_SOLVER_SEVEN_POINT; ++method) {
    options.method = method;
    estimate(MAX_MATCHES);
    TEST_ASSERT_EQUAL_INT(TV_KIND_CALIBRATED, result.kind);
    TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, result.verdict);
    TEST_ASSERT_TRUE(result.num_inliers >= 800);
    TEST_ASSERT_TRUE(distance(true_R, result.R, 9) < 1e-4);
    TEST_ASSERT_TRUE(distance(true_t, result.t, 3) < 1e-3);
  }
}

static void test_a_pinhole_and_a_fisheye_make_a_pair(void) {
  camera1.model = TV_CAMERA_KANNALA_BRANDT;
  camera1.fx = camera1.fy = 220;
  camera1.k[0] = 0.01, camera1.k[1] = -0.003;
  make_scene(300, 0, 1);
  estimate(300);
  TEST_ASSERT_EQUAL_INT(TV_KIND_CALIBRATED, result.kind);
  TEST_ASSERT_EQUAL_INT(300, result.num_inliers);
  TEST_ASSERT_TRUE(distance(true_R, result.R, 9) < 1e-7);
  TEST_ASSERT_TRUE(distance(true_t, result.t, 3) < 1e-7);
}

static void test_without_cameras_f_holds_for_the_pixels(void) {
  int method, i;
  spoil(200, 250);
  for (method = TV_SOLVER_EIGHT_POINT; method <= TV_SOLVER_SEVEN_POINT; ++method) {
    estimate_uncalibrated(250, method);
    TEST_ASSERT_EQUAL_INT(TV_KIND_UNCALIBRATED, result.kind);
    TEST_ASSERT_TRUE(result.num_inliers >= 200);
    for (i = 0; i < 200; ++i) {
      const double *F = result.F;
      const double x0[3] = {pixels0[2 * i], pixels0[2 * i + 1], 1};
      const double x1[3] = {pixels1[2 * i], pixels1[2 * i + 1], 1};
      const double line[3] = {dot3(F, x0), dot3(F + 3, x0), dot3(F + 6, x0)};
      TEST_ASSERT_EQUAL_INT(1, mask[i]);
      /* The pixel is within 0.1 px of its epipolar line. */
      TEST_ASSERT_TRUE(fabs(dot3(x1, line)) < 0.1 * norm(line, 2));
    }
  }
}

static void test_pixels_that_are_not_finite_are_never_inliers(void) {
  const double bad[5] = {NAN, INFINITY, -INFINITY, 1.7e308, -1.7e308};
  int i;
  for (i = 0; i < 40; ++i) *((i % 2 ? pixels0 : pixels1) + 6 * i + i % 4 / 2) = bad[i % 5];
  for (i = 0; i < MAX_MATCHES; ++i) ratios[i] = i % 7 == 0 ? NAN : i % 11 == 0 ? INFINITY : 0.5f;
  estimate(MAX_MATCHES);
  for (i = 0; i < MAX_MATCHES; ++i) TEST_ASSERT_EQUAL_INT(i % 3 != 0 || i >= 120, mask[i]);
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_pixels(api.context, &camera0, &camera1, pixels0, pixels1,
                                               ratios, MAX_MATCHES, &options, &result, mask));
  expect_sound(MAX_MATCHES, 1);
  TEST_ASSERT_EQUAL_INT(MAX_MATCHES - 40, result.num_inliers);
  for (i = 0; i < 2 * MAX_MATCHES; ++i) pixels0[i] = NAN;
  estimate(MAX_MATCHES);
  TEST_ASSERT_EQUAL_INT(TV_KIND_DEGENERATE, result.kind);
  estimate_uncalibrated(MAX_MATCHES, TV_SOLVER_EIGHT_POINT);
  TEST_ASSERT_EQUAL_INT(TV_KIND_DEGENERATE, result.kind);
}

static void test_too_few_matches_are_never_ok(void) {
  int method, count;
  for (method = TV_SOLVER_FIVE_POINT; method <= TV_SOLVER_SEVEN_POINT; ++method) {
    for (count = 0; count < 8; ++count) {
      options.method = method;
      estimate(count);
      TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK);
      TEST_ASSERT_TRUE(result.reasons & TV_REASON_TOO_FEW_MATCHES);
      TEST_ASSERT_TRUE(count > 5 || result.kind == TV_KIND_DEGENERATE);
      if (method != TV_SOLVER_FIVE_POINT) estimate_uncalibrated(count, method);
    }
    options.method = method;
    estimate(8);
    if (method != TV_SOLVER_FIVE_POINT) estimate_uncalibrated(8, method);
  }
}

static void fill(int count, double x0, double y0, double x1, double y1) {
  int i;
  for (i = 0; i < count; ++i) {
    pixels0[2 * i] = x0, pixels0[2 * i + 1] = y0;
    pixels1[2 * i] = x1, pixels1[2 * i + 1] = y1;
  }
}

static void estimate_every_way(int count) {
  static const double thresholds[3] = {1e-9, 1, 1e9};
  int method, k;
  for (k = 0; k < 3; ++k) {
    options.max_error_px = thresholds[k];
    options.max_iterations = 300;
    for (method = TV_SOLVER_SEVEN_POINT; method >= TV_SOLVER_FIVE_POINT; --method) {
      if (method != TV_SOLVER_FIVE_POINT) estimate_uncalibrated(count, method);
      options.method = method;
      estimate(count);
    }
  }
}

static void test_one_match_many_times_is_one_witness(void) {
  fill(MAX_MATCHES, 100, 200, 130, 190);
  estimate(MAX_MATCHES);
  TEST_ASSERT_EQUAL_INT(TV_KIND_DEGENERATE, result.kind);
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, result.verdict);
  TEST_ASSERT_TRUE(result.reasons & TV_REASON_TOO_FEW_MATCHES);
  estimate_every_way(MAX_MATCHES);
  fill(MAX_MATCHES, 0, 0, 0, 0);
  estimate_every_way(MAX_MATCHES);
}

static void test_copies_of_seven_matches_are_seven_witnesses(void) {
  int i;
  for (i = 7; i < MAX_MATCHES; ++i) {
    memcpy(pixels0 + 2 * i, pixels0 + 2 * (i % 7), 2 * sizeof(double));
    memcpy(pixels1 + 2 * i, pixels1 + 2 * (i % 7), 2 * sizeof(double));
  }
  estimate(MAX_MATCHES);
  TEST_ASSERT_TRUE(result.reasons & TV_REASON_TOO_FEW_MATCHES);
  TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK);
}

static void test_points_on_a_line_are_never_ok(void) {
  int i;
  for (i = 0; i < 200; ++i) {
    const double s = uniform(-2, 2), point[3] = {s, 0.3 * s + 0.2, 6 + 0.5 * s};
    TEST_ASSERT_TRUE(see(point, 1, i));
  }
  estimate(200);
  TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK);
  estimate_every_way(200);
}

static void test_extreme_thresholds_do_no_harm(void) {
  spoil(150, 200);
  estimate_every_way(200);
}

static void test_random_matches_are_no_geometry(void) {
  spoil(0, 500);
  estimate(500);
  TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK);
  estimate_every_way(200);
}

static void test_numbers_of_any_size_do_no_harm(void) {
  static const double sizes[6] = {1e-300, 1e-9, 1e6, 1e11, 1e100, 1e300};
  int k, i;
  for (k = 0; k < 6; ++k) {
    for (i = 0; i < 100; ++i) {
      pixels0[i] = sizes[k] * uniform(-1, 1);
      pixels1[i] = sizes[k] * uniform(-1, 1);
    }
    estimate_every_way(50);
  }
}

static void test_equal_images_are_no_motion(void) {
  int i;
  camera1 = camera0;
  memcpy(pixels1, pixels0, sizeof pixels1);
  estimate(300);
  TEST_ASSERT_EQUAL_INT(TV_KIND_NO_MOTION, result.kind);
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, result.verdict);
  TEST_ASSERT_TRUE(result.reasons & TV_REASON_NO_MOTION);
  TEST_ASSERT_EQUAL_INT(300, result.num_inliers);
  for (i = 0; i < 9; ++i) TEST_ASSERT_TRUE(result.R[i] == (i % 4 == 0));
  estimate_uncalibrated(300, TV_SOLVER_EIGHT_POINT);
  TEST_ASSERT_EQUAL_INT(TV_KIND_NO_MOTION, result.kind);
}

static void test_a_pure_rotation_is_panoramic(void) {
  motion(0.15, 0.08, 1, 0, 0);
  make_scene(300, 0, 0);
  spoil(250, 300);
  estimate(300);
  TEST_ASSERT_EQUAL_INT(TV_KIND_PANORAMIC, result.kind);
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, result.verdict);
  TEST_ASSERT_TRUE(result.reasons & TV_REASON_PURE_ROTATION);
  TEST_ASSERT_TRUE(distance(true_R, result.R, 9) < 1e-6);
  TEST_ASSERT_TRUE(result.num_inliers >= 250);
  estimate_uncalibrated(300, TV_SOLVER_EIGHT_POINT);
  TEST_ASSERT_EQUAL_INT(TV_KIND_PLANAR_OR_PANORAMIC, result.kind);
}

static void test_a_plane_is_planar_and_one_of_its_poses_is_true(void) {
  double first, second;
  make_scene(300, 1, 1);
  spoil(250, 300);
  estimate(300);
  TEST_ASSERT_EQUAL_INT(TV_KIND_PLANAR, result.kind);
  TEST_ASSERT_EQUAL_INT(result.has_alternative,
                        (result.reasons & TV_REASON_TWO_PLANAR_SOLUTIONS) != 0);
  first = distance(true_R, result.R, 9) + distance(true_t, result.t, 3);
  second = distance(true_R, result.alternative_R, 9) + distance(true_t, result.alternative_t, 3);
  TEST_ASSERT_TRUE((first < second ? first : second) < 1e-5);
  estimate_uncalibrated(300, TV_SOLVER_EIGHT_POINT);
  TEST_ASSERT_EQUAL_INT(TV_KIND_PLANAR_OR_PANORAMIC, result.kind);
}

static void test_a_hundred_thousand_matches_fit_a_context_of_that_size(void) {
  enum { MANY = 100000 };
  double *many0 = (double *)malloc(2 * MANY * sizeof *many0);
  double *many1 = (double *)malloc(2 * MANY * sizeof *many1);
  uint8_t *many_mask = (uint8_t *)malloc(MANY);
  tv_limits limits;
  api_context large;
  int i, inliers = 0;
  TEST_ASSERT_TRUE(many0 != NULL && many1 != NULL && many_mask != NULL);
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 64;
  limits.max_keypoints = 64;
  limits.max_matches = MANY;
  large = api_make(&limits);
  for (i = 0; i < MANY / MAX_MATCHES; ++i) {
    make_scene(MAX_MATCHES, 0, 1);
    spoil(700, MAX_MATCHES);
    memcpy(many0 + 2 * MAX_MATCHES * i, pixels0, sizeof pixels0);
    memcpy(many1 + 2 * MAX_MATCHES * i, pixels1, sizeof pixels1);
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_pixels(large.context, &camera0, &camera1, many0, many1,
                                               NULL, MANY, &options, &result, many_mask));
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, result.verdict);
  TEST_ASSERT_TRUE(distance(true_R, result.R, 9) < 1e-4);
  for (i = 0; i < MANY; ++i) inliers += many_mask[i];
  TEST_ASSERT_EQUAL_INT(inliers, result.num_inliers);
  TEST_ASSERT_TRUE(inliers >= 7 * MANY / 10);
  TEST_ASSERT_EQUAL_INT(TV_ERR_LIMITS,
                        estimate_pixels(large.context, &camera0, &camera1, many0, many1, NULL,
                                        MANY + 1, &options, &result, NULL));
  api_release(&large);
  free(many0);
  free(many1);
  free(many_mask);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_init_sets_the_documented_defaults);
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_null_is_fine_where_the_header_says_so);
  RUN_TEST(test_wrong_struct_sizes_are_refused);
  RUN_TEST(test_options_out_of_range_are_refused);
  RUN_TEST(test_calibrations_out_of_range_are_refused);
  RUN_TEST(test_a_mask_without_deviations_changes_nothing);
  RUN_TEST(test_more_or_fewer_matches_than_there_can_be_are_refused);
  RUN_TEST(test_cameras_are_checked);
  RUN_TEST(test_the_mask_may_not_lie_over_an_input);
  RUN_TEST(test_outputs_may_not_lie_over_a_struct_of_the_call);
  RUN_TEST(test_evidence_is_asked_for_by_a_pointer);
  RUN_TEST(test_sigmas_out_of_range_are_refused);
  RUN_TEST(test_extreme_sigmas_do_no_harm);
  RUN_TEST(test_every_method_finds_an_exact_motion);
  RUN_TEST(test_a_pinhole_and_a_fisheye_make_a_pair);
  RUN_TEST(test_without_cameras_f_holds_for_the_pixels);
  RUN_TEST(test_pixels_that_are_not_finite_are_never_inliers);
  RUN_TEST(test_too_few_matches_are_never_ok);
  RUN_TEST(test_one_match_many_times_is_one_witness);
  RUN_TEST(test_copies_of_seven_matches_are_seven_witnesses);
  RUN_TEST(test_points_on_a_line_are_never_ok);
  RUN_TEST(test_extreme_thresholds_do_no_harm);
  RUN_TEST(test_random_matches_are_no_geometry);
  RUN_TEST(test_numbers_of_any_size_do_no_harm);
  RUN_TEST(test_equal_images_are_no_motion);
  RUN_TEST(test_a_pure_rotation_is_panoramic);
  RUN_TEST(test_a_plane_is_planar_and_one_of_its_poses_is_true);
  RUN_TEST(test_a_hundred_thousand_matches_fit_a_context_of_that_size);
  return UNITY_END();
}
