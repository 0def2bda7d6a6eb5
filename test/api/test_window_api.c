/* Tests of tv_adjust_window: the statuses and outputs that the header promises, and windows in
   which there is little or nothing to adjust. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/api.h"
#include "support/random.h"

enum { VIEWS = 5, POINTS = 30, OBSERVATIONS = VIEWS * POINTS, GUARD = 256, MOST = 1 << 20 };

typedef struct outputs {
  tv_window_view views[VIEWS];
  double points[3 * POINTS];
  double covariances[36 * VIEWS];
  float errors[OBSERVATIONS];
  tv_window_result result;
} outputs;

static tv_camera camera;
static tv_observation observations[OBSERVATIONS];
static tv_pose_prior pose_prior;
static tv_gravity_prior gravity_prior;
static tv_distance_prior distance_prior;
static tv_window window;
static tv_window_options options;
static outputs out, before;
static uint8_t block[MOST];
static uint8_t *memory;
static size_t size_bytes;

static tv_status run(void) {
  return tv_adjust_window(memory, size_bytes, &window, &options, out.covariances, out.errors,
                          &out.result);
}

/* Expects a status other than TV_OK, and that no output has changed. */
static void expect_refused(tv_status expected, tv_status status) {
  TEST_ASSERT_EQUAL_INT(expected, status);
  TEST_ASSERT_EQUAL_MEMORY(&before, &out, sizeof out);
}

static void measure(void) {
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_adjust_window_size(&window, &size_bytes));
  TEST_ASSERT_TRUE(size_bytes + 2 * GUARD <= sizeof block);
}

/* Five views in a row, half a unit apart; points at depths of 4 to 10. Pixels are rounded to
   halves; the start is off by some hundredths. */
void setUp(void) {
  uint64_t seed = 7;
  int v, p, i;
  memset(&camera, 0, sizeof camera);
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = 640, camera.height = 480;
  camera.fx = camera.fy = 500, camera.cx = 320, camera.cy = 240;
  memset(&out, 0x5a, sizeof out);
  memset(out.views, 0, sizeof out.views);
  memset(observations, 0, sizeof observations);
  for (v = 0; v < VIEWS; ++v) {
    for (i = 0; i < 3; ++i) out.views[v].R[4 * i] = 1;
    out.views[v].t[0] = -0.5 * v;
    out.views[v].fixed = v == 0;
  }
  for (p = 0; p < POINTS; ++p) {
    double *X = out.points + 3 * p;
    X[2] = 4 + 6 * random_unit(&seed);
    X[0] = X[2] * (random_unit(&seed) - 0.3), X[1] = X[2] * (random_unit(&seed) - 0.5) * 0.8;
    for (v = 0; v < VIEWS; ++v) {
      tv_observation *o = &observations[VIEWS * p + v];
      const double x[3] = {X[0] - 0.5 * v, X[1], X[2]};
      o->idx_view = v, o->idx_point = p;
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, x, o->pixel, NULL));
      for (i = 0; i < 2; ++i) o->pixel[i] = floor(2 * o->pixel[i]) / 2;
    }
    for (i = 0; i < 3; ++i) X[i] += 0.05 * (random_unit(&seed) - 0.5);
  }
  for (v = 1; v < VIEWS; ++v) {
    for (i = 0; i < 3; ++i) out.views[v].t[i] += 0.05 * (random_unit(&seed) - 0.5);
  }
  memset(&pose_prior, 0, sizeof pose_prior);
  for (i = 0; i < 3; ++i) pose_prior.R[4 * i] = 1;
  for (i = 0; i < 6; ++i) pose_prior.information[7 * i] = 100;
  memset(&gravity_prior, 0, sizeof gravity_prior);
  gravity_prior.down[1] = 9.81;
  gravity_prior.sigma_rad = 0.01;
  distance_prior.idx_view0 = 0, distance_prior.idx_view1 = 4;
  distance_prior.distance = 2, distance_prior.sigma = 0.01;
  tv_window_init(&window);
  window.num_cameras = 1, window.cameras = &camera;
  window.num_views = VIEWS, window.views = out.views;
  window.num_points = POINTS, window.points = out.points;
  window.num_observations = OBSERVATIONS, window.observations = observations;
  window.num_pose_priors = 1, window.pose_priors = &pose_prior;
  window.num_gravity_priors = 1, window.gravity_priors = &gravity_prior;
  window.num_distance_priors = 1, window.distance_priors = &distance_prior;
  tv_window_options_init(&options);
  tv_window_result_init(&out.result);
  memset(block, 0x5a, sizeof block);
  memory = block + GUARD + (64 - (uintptr_t)(block + GUARD) % 64) % 64;
  measure();
  before = out;
}

void tearDown(void) {}

static void test_a_window_is_adjusted_within_its_memory(void) {
  outputs first;
  size_t i;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(VIEWS - 1, out.result.num_views);
  TEST_ASSERT_EQUAL_INT(POINTS, out.result.num_points);
  TEST_ASSERT_EQUAL_INT(OBSERVATIONS, out.result.num_observations);
  TEST_ASSERT_TRUE(out.result.converged && out.result.has_covariance);
  TEST_ASSERT_TRUE(!out.result.held_first_view && !out.result.scale_is_free);
  TEST_ASSERT_TRUE(out.result.final_cost < 0.1 * out.result.initial_cost);
  TEST_ASSERT_TRUE(out.result.rms_px < 0.5 && out.result.noise_px < 0.5);
  TEST_ASSERT_EQUAL_MEMORY(&before.views[0], &out.views[0], sizeof out.views[0]);
  for (i = 0; i < OBSERVATIONS; ++i) TEST_ASSERT_TRUE(out.errors[i] >= 0 && out.errors[i] < 2);
  TEST_ASSERT_TRUE(api_is_pattern(block, (size_t)(memory - block)));
  TEST_ASSERT_TRUE(api_is_pattern(memory + size_bytes, GUARD));
  first = out;
  out = before;
  memset(block, 0xff, sizeof block); /* the result does not depend on what the memory held */
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_MEMORY(&first, &out, sizeof out);
}

static void test_outputs_are_optional(void) {
  outputs first;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  first = out;
  out = before;
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_adjust_window(memory, size_bytes, &window, NULL, NULL, NULL, NULL));
  TEST_ASSERT_EQUAL_MEMORY(first.views, out.views, sizeof out.views);
  TEST_ASSERT_EQUAL_MEMORY(first.points, out.points, sizeof out.points);
  TEST_ASSERT_EQUAL_MEMORY(before.covariances, out.covariances, sizeof out.covariances);
}

static void test_no_iteration_only_measures(void) {
  options.max_iterations = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(0, out.result.num_iterations);
  TEST_ASSERT_TRUE(out.result.initial_cost == out.result.final_cost);
  TEST_ASSERT_EQUAL_MEMORY(before.views, out.views, sizeof out.views);
  TEST_ASSERT_EQUAL_MEMORY(before.points, out.points, sizeof out.points);
}

static void test_null_pointers_are_refused(void) {
  const tv_window whole = window;
  expect_refused(TV_ERR_NULL, tv_adjust_window(memory, size_bytes, NULL, NULL, NULL, NULL, NULL));
  expect_refused(TV_ERR_NULL, tv_adjust_window(NULL, size_bytes, &window, NULL, NULL, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_adjust_window_size(NULL, &size_bytes));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_adjust_window_size(&window, NULL));
  window.cameras = NULL, expect_refused(TV_ERR_NULL, run()), window = whole;
  window.views = NULL, expect_refused(TV_ERR_NULL, run()), window = whole;
  window.points = NULL, expect_refused(TV_ERR_NULL, run()), window = whole;
  window.observations = NULL, expect_refused(TV_ERR_NULL, run()), window = whole;
  window.pose_priors = NULL, expect_refused(TV_ERR_NULL, run()), window = whole;
  window.gravity_priors = NULL, expect_refused(TV_ERR_NULL, run()), window = whole;
  window.distance_priors = NULL, expect_refused(TV_ERR_NULL, run()), window = whole;
}

static void test_counts_out_of_range_are_refused(void) {
  int32_t *const counts[7] = {&window.num_cameras,        &window.num_views,
                              &window.num_points,         &window.num_observations,
                              &window.num_pose_priors,    &window.num_gravity_priors,
                              &window.num_distance_priors};
  const int32_t most[7] = {TV_WINDOW_MAX_VIEWS,     TV_WINDOW_MAX_VIEWS,
                           TV_WINDOW_MAX_POINTS,    TV_WINDOW_MAX_OBSERVATIONS,
                           4 * TV_WINDOW_MAX_VIEWS, 4 * TV_WINDOW_MAX_VIEWS,
                           4 * TV_WINDOW_MAX_VIEWS};
  const size_t size = size_bytes;
  int k;
  for (k = 0; k < 7; ++k) {
    const int32_t count = *counts[k];
    *counts[k] = -1;
    expect_refused(TV_ERR_ARGUMENT, run());
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_adjust_window_size(&window, &size_bytes));
    *counts[k] = most[k] + 1;
    expect_refused(TV_ERR_ARGUMENT, run());
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_adjust_window_size(&window, &size_bytes));
    TEST_ASSERT_TRUE(size == size_bytes);
    *counts[k] = most[k];
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_adjust_window_size(&window, &size_bytes));
    size_bytes = size;
    *counts[k] = count;
  }
}

static void test_memory_that_is_small_or_misaligned_is_refused(void) {
  --size_bytes;
  expect_refused(TV_ERR_MEMORY, run());
  ++size_bytes;
  memory += 8;
  expect_refused(TV_ERR_ALIGNMENT, run());
}

static void test_indices_out_of_range_are_refused(void) {
  int32_t *const indices[8] = {&observations[7].idx_view, &observations[7].idx_point,
                               &out.views[2].idx_camera,  &pose_prior.idx_view,
                               &gravity_prior.idx_view,   &distance_prior.idx_view0,
                               &distance_prior.idx_view1, &out.views[3].fixed};
  const int32_t most[8] = {VIEWS, POINTS, 1, VIEWS, VIEWS, VIEWS, VIEWS, 2};
  int k;
  for (k = 0; k < 8; ++k) {
    const int32_t index = *indices[k];
    *indices[k] = -1, before = out;
    expect_refused(TV_ERR_ARGUMENT, run());
    *indices[k] = most[k], before = out;
    expect_refused(TV_ERR_ARGUMENT, run());
    *indices[k] = index, before = out;
  }
  distance_prior.idx_view1 = distance_prior.idx_view0;
  expect_refused(TV_ERR_ARGUMENT, run());
}

static void test_numbers_that_are_not_finite_are_refused(void) {
  double *const numbers[] = {
      &out.views[1].R[4],       &out.views[1].t[2],         &pose_prior.R[0],
      &pose_prior.t[1],         &pose_prior.information[3], &gravity_prior.down[0],
      &gravity_prior.sigma_rad, &distance_prior.distance,   &distance_prior.sigma,
      &window.world_down[2],    &options.loss_scale_px,     &options.noise_px,
      &options.tolerance};
  size_t k;
  for (k = 0; k < sizeof numbers / sizeof *numbers; ++k) {
    const double number = *numbers[k];
    *numbers[k] = NAN, before = out;
    expect_refused(TV_ERR_NOT_FINITE, run());
    *numbers[k] = -INFINITY, before = out;
    expect_refused(TV_ERR_NOT_FINITE, run());
    *numbers[k] = number, before = out;
  }
  observations[3].sigma = NAN;
  expect_refused(TV_ERR_NOT_FINITE, run());
  observations[3].sigma = 0;
  pose_prior.t[0] = 1e300; /* its square overflows, and so does the cost */
  expect_refused(TV_ERR_NOT_FINITE, run());
}

static void test_values_out_of_range_are_refused(void) {
  double *const numbers[] = {
      &out.views[1].R[4],         &pose_prior.R[4],           &pose_prior.information[0],
      &pose_prior.information[1], &pose_prior.information[1], &gravity_prior.down[1],
      &gravity_prior.sigma_rad,   &distance_prior.distance,   &distance_prior.sigma,
      &window.world_down[1],      &options.loss_scale_px,     &options.noise_px,
      &options.tolerance,         &options.tolerance};
  const double values[] = {1.001, -1, -1, 50, 101, 0, 0, -1, 0, 0, 0, 0, -1, 0.2};
  size_t k;
  for (k = 0; k < sizeof numbers / sizeof *numbers; ++k) {
    const double number = *numbers[k];
    *numbers[k] = values[k], before = out;
    expect_refused(TV_ERR_ARGUMENT, run());
    *numbers[k] = number, before = out;
  }
  observations[3].sigma = 0.005f;
  expect_refused(TV_ERR_ARGUMENT, run());
  observations[3].sigma = 0;
  observations[3].reserved = 1;
  expect_refused(TV_ERR_ARGUMENT, run());
  observations[3].reserved = 0;
  options.loss = 3, expect_refused(TV_ERR_ARGUMENT, run()), options.loss = TV_LOSS_HUBER;
  options.max_iterations = 1001, expect_refused(TV_ERR_ARGUMENT, run());
  options.max_iterations = 50;
  options.reserved = 1, expect_refused(TV_ERR_ARGUMENT, run()), options.reserved = 0;
  camera.fx = 0, expect_refused(TV_ERR_CAMERA, run());
}

static void test_structs_of_other_releases(void) {
  struct {
    tv_window_options known;
    uint8_t more[8];
  } newer;
  struct {
    tv_window_result known;
    uint8_t more[8];
  } newer_result;
  tv_window_options_init_sized(&newer.known, sizeof newer);
  tv_window_result_init_sized(&newer_result.known, sizeof newer_result);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_adjust_window(memory, size_bytes, &window, &newer.known, NULL,
                                                NULL, &newer_result.known));
  TEST_ASSERT_EQUAL_UINT32(sizeof newer_result, newer_result.known.struct_size);
  TEST_ASSERT_TRUE(newer_result.known.final_cost > 0);
  out = before;
  newer.more[3] = 1;
  expect_refused(TV_ERR_STRUCT_SIZE,
                 tv_adjust_window(memory, size_bytes, &window, &newer.known, NULL, NULL, NULL));
  window.struct_size = 3;
  expect_refused(TV_ERR_STRUCT_SIZE, run());
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE, tv_adjust_window_size(&window, &size_bytes));
  window.struct_size = sizeof window;
  out.result.struct_size = 5, before = out;
  expect_refused(TV_ERR_STRUCT_SIZE, run());
}

static void test_overlapping_outputs_are_refused(void) {
  expect_refused(TV_ERR_OVERLAP, tv_adjust_window(memory, size_bytes, &window, &options,
                                                  (double *)(void *)memory, NULL, &out.result));
  expect_refused(TV_ERR_OVERLAP, tv_adjust_window(memory, size_bytes, &window, &options, out.points,
                                                  NULL, &out.result));
  expect_refused(TV_ERR_OVERLAP, tv_adjust_window(memory, size_bytes, &window, &options, NULL,
                                                  (float *)(void *)observations, &out.result));
}

static void test_observations_that_cannot_be_used_are_counted(void) {
  observations[0].pixel[1] = NAN;            /* invalid */
  observations[6].pixel[0] = INFINITY;       /* invalid */
  out.points[3 * 4 + 1] = NAN;               /* 5 observations invalid */
  out.points[3 * 5 + 2] = -6;                /* 5 behind */
  observations[VIEWS * 7 + 1].idx_point = 8; /* twice in view 1 */
  memcpy(observations[VIEWS * 7 + 1].pixel, observations[VIEWS * 8 + 1].pixel,
         sizeof observations[0].pixel);
  observations[VIEWS * 9 + 1].pixel[0] = NAN, observations[VIEWS * 9 + 2].pixel[0] = NAN;
  observations[VIEWS * 9 + 3].pixel[0] = NAN, observations[VIEWS * 9 + 4].pixel[0] = NAN;
  before = out;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(11, out.result.num_invalid);
  TEST_ASSERT_EQUAL_INT(5, out.result.num_behind);
  TEST_ASSERT_EQUAL_INT(1, out.result.num_single);
  TEST_ASSERT_EQUAL_INT(OBSERVATIONS - 17, out.result.num_observations);
  TEST_ASSERT_EQUAL_INT(POINTS - 3, out.result.num_points);
  TEST_ASSERT_TRUE(out.result.converged && out.result.rms_px < 0.5);
  TEST_ASSERT_EQUAL_MEMORY(before.points + 12, out.points + 12, 6 * sizeof(double));
  TEST_ASSERT_EQUAL_MEMORY(before.points + 27, out.points + 27, 3 * sizeof(double));
  TEST_ASSERT_TRUE(out.errors[0] == -1 && out.errors[VIEWS * 5] == -1 &&
                   out.errors[VIEWS * 9] == -1 && out.errors[1] >= 0);
}

static void test_a_pixel_without_a_ray_is_invalid(void) {
  camera.model = TV_CAMERA_BROWN_CONRADY;
  camera.k[0] = -0.05;
  observations[11].pixel[0] = 1e5;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(1, out.result.num_invalid);
}

static void test_a_point_seen_by_one_view_only_stays(void) {
  int v;
  for (v = 1; v < VIEWS; ++v) observations[v].idx_view = 0; /* five times by view 0 */
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(5, out.result.num_single);
  TEST_ASSERT_EQUAL_INT(POINTS - 1, out.result.num_points);
  TEST_ASSERT_EQUAL_MEMORY(before.points, out.points, 3 * sizeof(double));
}

static void test_a_view_without_observations_stays(void) {
  int k;
  window.num_pose_priors = window.num_gravity_priors = window.num_distance_priors = 0;
  for (k = 0; k < OBSERVATIONS; ++k) {
    if (observations[k].idx_view == 3) observations[k].idx_view = 1;
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(VIEWS - 2, out.result.num_views);
  TEST_ASSERT_EQUAL_MEMORY(&before.views[3], &out.views[3], sizeof out.views[3]);
  TEST_ASSERT_TRUE(out.result.scale_is_free && !out.result.held_first_view);
}

static void test_a_view_without_observations_goes_to_its_prior(void) {
  window.num_observations = window.num_points = 0;
  window.num_gravity_priors = window.num_distance_priors = 0;
  pose_prior.idx_view = 2, pose_prior.t[0] = 7;
  measure();
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(1, out.result.num_views);
  TEST_ASSERT_TRUE(fabs(out.views[2].t[0] - 7) < 1e-6 && fabs(out.views[2].t[1]) < 1e-6);
  TEST_ASSERT_EQUAL_MEMORY(&before.views[1], &out.views[1], sizeof out.views[1]);
  TEST_ASSERT_TRUE(!out.result.has_covariance && out.result.noise_px == 0);
}

static void test_an_empty_window_is_no_error(void) {
  tv_window_init(&window);
  measure();
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(0, out.result.num_observations);
  TEST_ASSERT_TRUE(out.result.converged && out.result.final_cost == 0);
  TEST_ASSERT_EQUAL_MEMORY(before.views, out.views, sizeof out.views);
}

static void test_fixed_views_leave_only_the_points(void) {
  int v;
  for (v = 0; v < VIEWS; ++v) out.views[v].fixed = 1;
  before = out;
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_EQUAL_INT(0, out.result.num_views);
  TEST_ASSERT_EQUAL_INT(POINTS, out.result.num_points);
  TEST_ASSERT_EQUAL_MEMORY(before.views, out.views, sizeof out.views);
  TEST_ASSERT_TRUE(out.result.final_cost < out.result.initial_cost);
  TEST_ASSERT_FALSE(out.result.has_covariance);
}

/* No point has parallax: depths are undetermined, and nothing may become infinite or NaN. */
static void test_views_in_one_place_give_finite_numbers(void) {
  size_t k;
  int v;
  window.num_pose_priors = window.num_gravity_priors = window.num_distance_priors = 0;
  for (v = 0; v < VIEWS; ++v) memset(out.views[v].t, 0, sizeof out.views[v].t);
  for (k = 0; k < OBSERVATIONS; ++k) {
    memcpy(observations[k].pixel, observations[k / VIEWS * VIEWS].pixel,
           sizeof observations[k].pixel);
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_TRUE(out.result.rms_px < 0.01);
  for (k = 0; k < 3 * POINTS; ++k) TEST_ASSERT_TRUE(isfinite(out.points[k]));
  for (v = 0; v < VIEWS; ++v) {
    for (k = 0; k < 9; ++k) TEST_ASSERT_TRUE(isfinite(out.views[v].R[k]));
    for (k = 0; k < 3; ++k) TEST_ASSERT_TRUE(isfinite(out.views[v].t[k]));
  }
  for (k = 0; k < 36 * VIEWS; ++k) TEST_ASSERT_TRUE(isfinite(out.covariances[k]));
}

static void test_exact_observations_end_at_once(void) {
  int k;
  tv_window_view start[VIEWS];
  window.num_pose_priors = window.num_gravity_priors = window.num_distance_priors = 0;
  memcpy(start, out.views, sizeof start);
  for (k = 0; k < OBSERVATIONS; ++k) {
    const double *X = out.points + 3 * observations[k].idx_point;
    const double *t = out.views[observations[k].idx_view].t;
    const double x[3] = {X[0] + t[0], X[1] + t[1], X[2] + t[2]};
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, x, observations[k].pixel, NULL));
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, run());
  TEST_ASSERT_TRUE(out.result.converged && out.result.final_cost < 1e-18);
}

/* Points of all sizes and places, poses far apart: a status, finite outputs, and no cost above that
   of the start. */
static void test_random_windows_stay_finite(void) {
  uint64_t seed = 11;
  int round, k;
  for (round = 0; round < 300; ++round) {
    tv_status status;
    const double size = pow(10, 24 * random_unit(&seed) - 12);
    out = before;
    for (k = 0; k < 3 * POINTS; ++k) out.points[k] = size * (random_unit(&seed) - 0.5);
    for (k = 0; k < VIEWS; ++k) {
      out.views[k].t[k % 3] = size * (random_unit(&seed) - 0.5);
      out.views[k].fixed = random_unit(&seed) < 0.2;
    }
    for (k = 0; k < OBSERVATIONS; ++k) {
      observations[k].pixel[0] = 640 * random_unit(&seed);
      observations[k].pixel[1] = 480 * random_unit(&seed);
    }
    options.loss = round % 3;
    window.num_pose_priors = round % 2;
    window.num_gravity_priors = round / 2 % 2;
    window.num_distance_priors = round / 4 % 2;
    status = run();
    TEST_ASSERT_EQUAL_INT(TV_OK, status);
    TEST_ASSERT_TRUE(out.result.final_cost <= out.result.initial_cost);
    for (k = 0; k < 3 * POINTS; ++k) TEST_ASSERT_TRUE(isfinite(out.points[k]));
    for (k = 0; k < VIEWS; ++k) TEST_ASSERT_TRUE(isfinite(out.views[k].t[0] + out.views[k].R[0]));
    for (k = 0; k < 36 * VIEWS; ++k) TEST_ASSERT_TRUE(isfinite(out.covariances[k]));
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_window_is_adjusted_within_its_memory);
  RUN_TEST(test_outputs_are_optional);
  RUN_TEST(test_no_iteration_only_measures);
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_counts_out_of_range_are_refused);
  RUN_TEST(test_memory_that_is_small_or_misaligned_is_refused);
  RUN_TEST(test_indices_out_of_range_are_refused);
  RUN_TEST(test_numbers_that_are_not_finite_are_refused);
  RUN_TEST(test_values_out_of_range_are_refused);
  RUN_TEST(test_structs_of_other_releases);
  RUN_TEST(test_overlapping_outputs_are_refused);
  RUN_TEST(test_observations_that_cannot_be_used_are_counted);
  RUN_TEST(test_a_pixel_without_a_ray_is_invalid);
  RUN_TEST(test_a_point_seen_by_one_view_only_stays);
  RUN_TEST(test_a_view_without_observations_stays);
  RUN_TEST(test_a_view_without_observations_goes_to_its_prior);
  RUN_TEST(test_an_empty_window_is_no_error);
  RUN_TEST(test_fixed_views_leave_only_the_points);
  RUN_TEST(test_views_in_one_place_give_finite_numbers);
  RUN_TEST(test_exact_observations_end_at_once);
  RUN_TEST(test_random_windows_stay_finite);
  return UNITY_END();
}
