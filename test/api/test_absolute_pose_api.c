/* Tests of tv_estimate_absolute_pose: the statuses and outputs that the header promises, wrong and
   degenerate matches, sigmas, gravity, and every camera model. */
#include <math.h>
#include <string.h>

#include "support/api.h"

enum { MAX_MATCHES = 600 };

static api_context api;
static tv_camera camera;
static tv_pixel_points matches;
static tv_absolute_pose_options options;
static tv_absolute_pose result;
static double pixels[2 * MAX_MATCHES], points[3 * MAX_MATCHES];
static float ratios[MAX_MATCHES], sigmas[MAX_MATCHES];
static uint8_t mask[MAX_MATCHES];
static double true_R[9], true_t[3];
static uint64_t seed;

static double uniform(double low, double high) { return low + (high - low) * random_unit(&seed); }

/* About normal, of the standard deviation 1. */
static double normal(void) {
  double sum = -6;
  int k;
  for (k = 0; k < 12; ++k) sum += random_unit(&seed);
  return sum;
}

static void set_pose(double about_y, double about_x, double x, double y, double z) {
  const double c = cos(about_y), s = sin(about_y), d = cos(about_x), e = sin(about_x);
  const double product[9] = {c, 0, s, e * s, d, -e * c, -d * s, e, d * c};
  memcpy(true_R, product, sizeof product);
  true_t[0] = x, true_t[1] = y, true_t[2] = z;
}

/* Writes point i of the world, from the point of the camera's frame, and its pixel with noise. */
static void see(const double seen[3], double noise_px, int i) {
  int k, r;
  for (k = 0; k < 3; ++k) {
    points[3 * i + k] = 0;
    for (r = 0; r < 3; ++r) points[3 * i + k] += true_R[3 * r + k] * (seen[r] - true_t[r]);
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, seen, pixels + 2 * i, NULL));
  for (k = 0; k < 2; ++k) pixels[2 * i + k] += noise_px * normal();
}

/* Points over the whole image; flatness 0: at 2 to 8, 1: on a slanted plane. */
static void make_scene(int num, double noise_px, double flatness) {
  int i;
  for (i = 0; i < num; ++i) {
    const double pixel[2] = {uniform(0, camera.width - 1), uniform(0, camera.height - 1)};
    double ray[3], depth;
    if (tv_camera_unproject(&camera, pixel, ray, NULL) != TV_OK || ray[2] < 0.3) {
      --i;
      continue;
    }
    depth = flatness * 4 / (ray[2] + 0.2 * ray[0]) + (1 - flatness) * uniform(2, 8);
    ray[0] *= depth, ray[1] *= depth, ray[2] *= depth;
    see(ray, noise_px, i);
  }
  matches.num = num;
}

static void spoil(int begin, int end) {
  for (; begin < end; ++begin) {
    pixels[2 * begin] = uniform(0, 640);
    pixels[2 * begin + 1] = uniform(0, 480);
  }
}

void setUp(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 64;
  limits.max_keypoints = 64;
  limits.max_matches = MAX_MATCHES;
  limits.purposes = TV_PURPOSE_ABSOLUTE_POSE;
  api = api_make(&limits);
  memset(&camera, 0, sizeof camera);
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = 640, camera.height = 480;
  camera.fx = 500, camera.fy = 510, camera.cx = 320, camera.cy = 240;
  tv_pixel_points_init(&matches);
  matches.pixels = pixels;
  matches.points = points;
  tv_absolute_pose_options_init(&options);
  tv_absolute_pose_init(&result);
  seed = 4;
  set_pose(0.4, -0.2, 0.5, -1, 2);
}

void tearDown(void) { api_release(&api); }

static tv_status estimate(void) {
  return tv_estimate_absolute_pose(api.context, &camera, &matches, &options, &result, mask);
}

static void must_estimate(void) { TEST_ASSERT_EQUAL_INT(TV_OK, estimate()); }

/* The largest difference between an entry of the pose and of the true one. */
static double pose_error(void) {
  double worst = 0;
  int k;
  for (k = 0; k < 9; ++k) worst = fmax(worst, fabs(result.R[k] - true_R[k]));
  for (k = 0; k < 3; ++k) worst = fmax(worst, fabs(result.t[k] - true_t[k]));
  return worst;
}

static void check_refused(uint32_t reason) {
  static const double zeros[36];
  must_estimate();
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, result.verdict);
  TEST_ASSERT_EQUAL_UINT32(reason, result.reasons);
  TEST_ASSERT_EQUAL_INT(0, result.has_pose + result.has_covariance + result.has_alternative);
  TEST_ASSERT_EQUAL_INT(0, result.num_inliers);
  TEST_ASSERT_EQUAL_MEMORY(zeros, result.R, sizeof result.R);
  TEST_ASSERT_EQUAL_MEMORY(zeros, result.covariance, sizeof result.covariance);
  if (matches.num > 0) TEST_ASSERT_EQUAL_INT(0, memchr(mask, 1, (size_t)matches.num) != NULL);
}

static void test_exact_matches_give_the_exact_pose(void) {
  int i, k;
  make_scene(100, 0, 0);
  must_estimate();
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, result.verdict);
  TEST_ASSERT_EQUAL_UINT32(0, result.reasons);
  TEST_ASSERT_EQUAL_INT(100, result.num_matches);
  TEST_ASSERT_EQUAL_INT(100, result.num_inliers);
  TEST_ASSERT_TRUE(result.has_pose == 1 && result.has_covariance == 1);
  TEST_ASSERT_TRUE(pose_error() < 1e-9);
  TEST_ASSERT_TRUE(result.coverage > 0.5 && result.rms_error_px < 1e-6);
  TEST_ASSERT_EQUAL_UINT64(options.seed, result.seed);
  for (i = 0; i < 100; ++i) TEST_ASSERT_EQUAL_INT(1, mask[i]);
  for (i = 0; i < 6; ++i) {
    TEST_ASSERT_TRUE(result.covariance[7 * i] > 0);
    for (k = 0; k < 6; ++k) {
      TEST_ASSERT_TRUE(result.covariance[6 * i + k] == result.covariance[6 * k + i]);
    }
  }
}

static void test_the_pose_is_found_among_wrong_matches(void) {
  static const double shares[] = {0, 0.2, 0.4, 0.6, 0.8};
  size_t s;
  int trial;
  for (s = 0; s < 5; ++s) {
    for (trial = 0; trial < 10; ++trial) {
      const int wrong = (int)(shares[s] * 400);
      set_pose(uniform(-3, 3), uniform(-3, 3), uniform(-2, 2), uniform(-2, 2), uniform(-2, 2));
      make_scene(400, 0.7, 0);
      spoil(0, wrong);
      must_estimate();
      TEST_ASSERT_TRUE(pose_error() < 0.05);
      TEST_ASSERT_INT_WITHIN(6, 400 - wrong, result.num_inliers);
      TEST_ASSERT_DOUBLE_WITHIN(0.12, 0.7, result.noise_px);
      TEST_ASSERT_EQUAL_INT(s < 4 ? TV_VERDICT_OK : TV_VERDICT_DOUBTFUL, result.verdict);
      TEST_ASSERT_EQUAL_UINT32(s < 4 ? 0 : TV_REASON_LOW_INLIER_RATIO, result.reasons);
    }
  }
}

static void test_every_camera_model_is_served(void) {
  static const double brown[8] = {-0.3, 0.1, 0.001, -0.002, 0, 0, 0, 0};
  static const double fisheye[8] = {-0.02, 0.004, -0.001, 0, 0, 0, 0, 0};
  int lens;
  for (lens = 0; lens < 3; ++lens) {
    camera.model = lens;
    memset(camera.k, 0, sizeof camera.k);
    if (lens == 1) memcpy(camera.k, brown, sizeof brown);
    if (lens == 2) memcpy(camera.k, fisheye, sizeof fisheye), camera.fx = camera.fy = 210;
    make_scene(300, 0, 0);
    spoil(0, 120);
    must_estimate();
    TEST_ASSERT_TRUE(pose_error() < 1e-8);
    make_scene(300, 0.5, 0);
    spoil(0, 120);
    must_estimate();
    TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, result.verdict);
    TEST_ASSERT_TRUE(pose_error() < 0.02);
  }
}

/* Points behind the camera's plane, which a fisheye sees. */
static void test_a_fisheye_sees_points_to_the_side_and_behind(void) {
  int i = 0;
  camera.model = TV_CAMERA_KANNALA_BRANDT;
  camera.width = camera.height = 640;
  camera.fx = camera.fy = 180, camera.cx = camera.cy = 319.5;
  while (i < 60) {
    const double angle = uniform(1.3, 1.75), turn = uniform(0, 6.28), depth = uniform(1, 5);
    const double seen[3] = {depth * sin(angle) * cos(turn), depth * sin(angle) * sin(turn),
                            depth * cos(angle)};
    see(seen, 0, i++);
  }
  matches.num = 60;
  must_estimate();
  TEST_ASSERT_EQUAL_INT(60, result.num_inliers);
  TEST_ASSERT_TRUE(pose_error() < 1e-8);
}

static void test_points_on_a_plane_are_no_obstacle(void) {
  make_scene(200, 0.5, 1);
  spoil(0, 80);
  must_estimate();
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, result.verdict);
  TEST_ASSERT_TRUE(pose_error() < 0.03);
}

/* A small square far away: its mirror image in depth fits as well. */
static void test_a_small_plane_far_away_has_two_poses(void) {
  int i, k, differs = 0;
  double error = 0, other = 0;
  for (i = 0; i < 40; ++i) {
    const double x = 0.5 * (i % 8), y = 0.5 * (i / 8);
    const double seen[3] = {x - 1.7, y - 1, 40 + 0.3 * x + 0.1 * y};
    see(seen, 0.5, i);
  }
  matches.num = 40;
  must_estimate();
  TEST_ASSERT_EQUAL_INT(1, result.has_alternative);
  TEST_ASSERT_TRUE((result.reasons & TV_REASON_TWO_PLANAR_SOLUTIONS) != 0);
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_DOUBTFUL, result.verdict);
  for (k = 0; k < 9; ++k) {
    error += pow(result.R[k] - true_R[k], 2);
    other += pow(result.alternative_R[k] - true_R[k], 2);
    differs += result.R[k] != result.alternative_R[k];
  }
  TEST_ASSERT_TRUE(differs > 0 && fmin(error, other) < 0.05 && fmax(error, other) > 0.2);
  /* Gravity decides which one it is. */
  options.gravity_in_world[1] = 1;
  for (k = 0; k < 3; ++k) options.gravity_in_camera[k] = true_R[3 * k + 1];
  options.gravity_sigma_rad = 0.01;
  must_estimate();
  TEST_ASSERT_EQUAL_INT(0, result.has_alternative);
  error = 0;
  for (k = 0; k < 9; ++k) error += pow(result.R[k] - true_R[k], 2);
  TEST_ASSERT_TRUE(error < 0.05);
}

static void test_too_few_matches_and_matches_on_a_line_are_refused(void) {
  int num, i, k;
  for (num = 0; num < 4; ++num) {
    make_scene(num, 0, 0);
    check_refused(TV_REASON_TOO_FEW_MATCHES);
  }
  for (i = 0; i < 40; ++i) {
    const double seen[3] = {0.1 * i - 2, 0.04 * i, 5 + 0.02 * i};
    see(seen, 0, i);
  }
  matches.num = 40;
  /* Exactly on a line in the world, too, which rounding in see() could spoil. */
  for (i = 0; i < 40; ++i) {
    for (k = 0; k < 3; ++k) points[3 * i + k] = points[k] + i * (0.25 * k + 0.5);
  }
  check_refused(TV_REASON_CROWDED_MATCHES);
  for (i = 0; i < 40; ++i) memcpy(points + 3 * i, points, 3 * sizeof *points);
  check_refused(TV_REASON_CROWDED_MATCHES);
}

static void test_noisy_points_near_a_line_are_never_ok(void) {
  int i, trial;
  for (trial = 0; trial < 20; ++trial) {
    for (i = 0; i < 60; ++i) {
      const double seen[3] = {0.1 * i - 3, 0.04 * i + 1e-4 * normal(), 5 + 1e-4 * normal()};
      see(seen, 0.5, i);
    }
    matches.num = 60;
    must_estimate();
    TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK);
    /* The pixels cover enough of the image; that the points are on a line is seen from them. */
    TEST_ASSERT_TRUE(result.has_pose == 0 || result.coverage > 5.0 / 64);
    TEST_ASSERT_TRUE((result.reasons & TV_REASON_CROWDED_MATCHES) != 0);
  }
}

static void test_all_points_in_one_place_are_never_ok(void) {
  int i;
  for (i = 0; i < 60; ++i) {
    const double seen[3] = {0.3 + 0.002 * normal(), 0.2 + 0.002 * normal(), 4 + 0.002 * normal()};
    see(seen, 0.5, i);
  }
  matches.num = 60;
  must_estimate();
  TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK);
  TEST_ASSERT_TRUE(result.has_pose == 0 || (result.reasons & TV_REASON_CROWDED_MATCHES) != 0);
}

/* No pose may be found by chance: random matches of any number, and of any threshold. */
static void test_random_matches_are_refused(void) {
  static const int numbers[] = {5, 8, 15, 30, 100, 400};
  size_t n;
  int trial;
  for (n = 0; n < 6; ++n) {
    for (trial = 0; trial < 10; ++trial) {
      make_scene(numbers[n], 0, 0);
      spoil(0, numbers[n]);
      options.max_iterations = 1000;
      options.max_error_px = trial % 2 != 0 ? 4 : 12;
      check_refused(numbers[n] < 15 ? TV_REASON_TOO_FEW_MATCHES : TV_REASON_LOW_INLIER_RATIO);
    }
  }
}

static void test_few_inliers_are_doubtful(void) {
  make_scene(12, 0.5, 0);
  must_estimate();
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_DOUBTFUL, result.verdict);
  TEST_ASSERT_EQUAL_UINT32(TV_REASON_TOO_FEW_MATCHES, result.reasons);
  TEST_ASSERT_TRUE(pose_error() < 0.1);
}

/* The order of the matches, and matches given twice, leave every byte of the pose as it is. */
static void test_order_and_repeats_do_not_count(void) {
  static tv_absolute_pose first;
  int i, k;
  make_scene(150, 0.7, 0);
  spoil(0, 60);
  must_estimate();
  first = result;
  for (i = 0; i < 75; ++i) { /* swaps match i with match 149 - i */
    const int j = 149 - i;
    for (k = 0; k < 3; ++k) {
      const double x = points[3 * i + k];
      points[3 * i + k] = points[3 * j + k];
      points[3 * j + k] = x;
      if (k == 2) break;
      const double y = pixels[2 * i + k];
      pixels[2 * i + k] = pixels[2 * j + k];
      pixels[2 * j + k] = y;
    }
  }
  must_estimate();
  TEST_ASSERT_EQUAL_MEMORY(&first, &result, sizeof first);
  memcpy(points + 3 * 150, points, 3 * 150 * sizeof *points);
  memcpy(pixels + 2 * 150, pixels, 2 * 150 * sizeof *pixels);
  matches.num = 300;
  must_estimate();
  TEST_ASSERT_EQUAL_INT(2 * first.num_inliers, result.num_inliers);
  TEST_ASSERT_EQUAL_MEMORY(first.R, result.R, sizeof first.R);
  TEST_ASSERT_EQUAL_MEMORY(first.t, result.t, sizeof first.t);
  TEST_ASSERT_EQUAL_MEMORY(first.covariance, result.covariance, sizeof first.covariance);
  for (i = 0; i < 150; ++i) TEST_ASSERT_EQUAL_INT(mask[i], mask[150 + i]);
}

/* Four matches that are given ten times are four. */
static void test_repeats_are_no_evidence(void) {
  int i;
  make_scene(5, 0, 0);
  spoil(4, 5);
  for (i = 1; i < 10; ++i) {
    memcpy(points + 15 * i, points, 15 * sizeof *points);
    memcpy(pixels + 10 * i, pixels, 10 * sizeof *pixels);
  }
  matches.num = 50;
  must_estimate();
  TEST_ASSERT_TRUE((result.reasons & TV_REASON_TOO_FEW_MATCHES) != 0);
}

static void test_matches_that_are_not_finite_are_never_inliers(void) {
  static const double bad[] = {NAN, INFINITY, -INFINITY, 1e300, -1e7};
  int i;
  make_scene(200, 0.3, 0);
  for (i = 0; i < 100; ++i) {
    if (i % 2 != 0) {
      pixels[2 * i + i / 2 % 2] = bad[i % 5];
    } else {
      points[3 * i + i / 2 % 3] = i % 5 == 4 ? 1e12 : bad[i % 5];
    }
  }
  must_estimate();
  TEST_ASSERT_TRUE(pose_error() < 0.02);
  for (i = 0; i < 200; ++i) TEST_ASSERT_EQUAL_INT(i >= 100, mask[i]);
  for (i = 0; i < 400; ++i) pixels[i] = NAN;
  check_refused(TV_REASON_TOO_FEW_MATCHES);
}

/* With sigmas the precise matches determine the pose, and the others count as they deserve. */
static void test_sigmas_weigh_the_matches(void) {
  double with = 0, without = 0;
  int trial, i;
  for (trial = 0; trial < 30; ++trial) {
    make_scene(120, 0, 0);
    for (i = 0; i < 120; ++i) {
      sigmas[i] = i < 40 ? 1 : 8;
      pixels[2 * i] += 0.2 * sigmas[i] * normal();
      pixels[2 * i + 1] += 0.2 * sigmas[i] * normal();
    }
    matches.sigmas = sigmas;
    must_estimate();
    TEST_ASSERT_DOUBLE_WITHIN(0.06, 0.2, result.noise_px);
    TEST_ASSERT_INT_WITHIN(2, 120, result.num_inliers);
    with += pose_error();
    matches.sigmas = NULL;
    must_estimate();
    without += pose_error();
  }
  TEST_ASSERT_TRUE(with < 0.85 * without);
}

static void test_ratios_lead_the_search(void) {
  int i, with = 0, without = 0;
  make_scene(300, 0.5, 0);
  for (i = 0; i < 300; ++i) ratios[i] = i < 240 ? 0.8f : 0.5f;
  spoil(0, 240);
  for (i = 0; i < 5; ++i) {
    options.seed = (uint64_t)i;
    matches.ratios = ratios;
    must_estimate();
    TEST_ASSERT_TRUE(result.has_pose);
    with += result.num_iterations;
    matches.ratios = NULL;
    must_estimate();
    without += result.num_iterations;
  }
  TEST_ASSERT_TRUE(with <= without);
}

static void test_gravity_helps_and_a_lie_does_no_harm(void) {
  double with = 0, without = 0, lied = 0;
  int trial, k;
  options.gravity_in_world[0] = 1, options.gravity_in_world[2] = -30;
  for (trial = 0; trial < 40; ++trial) {
    const double length = sqrt(901.0);
    make_scene(25, 1, 0);
    options.gravity_sigma_rad = 0;
    must_estimate();
    without += pose_error();
    options.gravity_sigma_rad = 5e-4;
    for (k = 0; k < 3; ++k) {
      options.gravity_in_camera[k] = 7 * (true_R[3 * k] - 30 * true_R[3 * k + 2]) / length;
    }
    must_estimate();
    with += pose_error();
    TEST_ASSERT_EQUAL_INT(1, result.has_covariance);
    options.gravity_in_camera[trial % 3] += 4;
    must_estimate();
    lied += pose_error();
  }
  TEST_ASSERT_TRUE(with < 0.85 * without);
  TEST_ASSERT_TRUE(lied < 1.2 * without);
}

/* The unit of the points and their distance from the origin make no difference. */
static void test_unit_and_origin_do_not_count(void) {
  static const double units[] = {1e-9, 1e-3, 1e6};
  static double R[9], t[3];
  size_t u;
  int i, k;
  make_scene(100, 0.5, 0);
  spoil(0, 30);
  must_estimate();
  memcpy(R, result.R, sizeof R);
  memcpy(t, result.t, sizeof t);
  for (u = 0; u < 3; ++u) {
    static double moved[3 * MAX_MATCHES];
    for (i = 0; i < 300; ++i) moved[i] = units[u] * points[i];
    matches.points = moved;
    must_estimate();
    for (k = 0; k < 9; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-6, R[k], result.R[k]);
    for (k = 0; k < 3; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-5, t[k], result.t[k] / units[u]);
    for (i = 0; i < 300; ++i) moved[i] = points[i] + (i % 3 == 0 ? 1e6 : -3e5);
    must_estimate();
    for (k = 0; k < 9; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-6, R[k], result.R[k]);
  }
}

static void test_fixed_iterations_are_drawn(void) {
  make_scene(100, 0.5, 0);
  options.fixed_iterations = 77;
  must_estimate();
  TEST_ASSERT_EQUAL_INT(77, result.num_iterations);
  options.fixed_iterations = 0;
  options.max_iterations = 3;
  spoil(0, 80);
  must_estimate();
  TEST_ASSERT_TRUE(result.num_iterations <= 3);
}

/* Every mistake of a caller: the status, and outputs that stay as they were. */
static void test_mistakes_are_refused_and_write_nothing(void) {
  tv_absolute_pose before;
  tv_limits limits;
  api_context other;
  int k;
  memset(&before, API_PATTERN, sizeof before);
  make_scene(50, 0, 0);
#define REFUSED(status, call)                                                        \
  memset(mask, API_PATTERN, sizeof mask);                                            \
  memcpy(&result, &before, sizeof result);                                           \
  result.struct_size = sizeof result;                                                \
  TEST_ASSERT_EQUAL_INT(status, call);                                               \
  TEST_ASSERT_TRUE(api_is_pattern(mask, sizeof mask));                               \
  TEST_ASSERT_TRUE(api_is_pattern((const char *)&result + sizeof result.struct_size, \
                                  sizeof result - sizeof result.struct_size))
#define WITH(place, value, status)        \
  do {                                    \
    const __typeof__(place) kept = place; \
    place = value;                        \
    REFUSED(status, estimate());          \
    place = kept;                         \
  } while (0)
  REFUSED(TV_ERR_NULL, tv_estimate_absolute_pose(NULL, &camera, &matches, NULL, &result, mask));
  REFUSED(TV_ERR_NULL, tv_estimate_absolute_pose(api.context, NULL, &matches, NULL, &result, mask));
  REFUSED(TV_ERR_NULL, tv_estimate_absolute_pose(api.context, &camera, NULL, NULL, &result, mask));
  REFUSED(TV_ERR_NULL, tv_estimate_absolute_pose(api.context, &camera, &matches, NULL, NULL, mask));
  WITH(matches.num, -1, TV_ERR_ARGUMENT);
  WITH(matches.num, MAX_MATCHES + 1, TV_ERR_LIMITS);
  WITH(matches.pixels, NULL, TV_ERR_NULL);
  WITH(matches.points, NULL, TV_ERR_NULL);
  WITH(matches.struct_size, 3, TV_ERR_STRUCT_SIZE);
  WITH(options.struct_size, 0, TV_ERR_STRUCT_SIZE);
  WITH(options.max_iterations, 0, TV_ERR_ARGUMENT);
  WITH(options.max_iterations, 1000001, TV_ERR_ARGUMENT);
  WITH(options.fixed_iterations, -1, TV_ERR_ARGUMENT);
  WITH(options.reserved, 1, TV_ERR_ARGUMENT);
  WITH(options.max_error_px, 0, TV_ERR_ARGUMENT);
  WITH(options.max_error_px, -1, TV_ERR_ARGUMENT);
  WITH(options.max_error_px, 2e9, TV_ERR_ARGUMENT);
  WITH(options.max_error_px, NAN, TV_ERR_NOT_FINITE);
  WITH(options.confidence, 1, TV_ERR_ARGUMENT);
  WITH(options.confidence, -INFINITY, TV_ERR_NOT_FINITE);
  WITH(options.gravity_sigma_rad, -1, TV_ERR_ARGUMENT);
  WITH(options.gravity_sigma_rad, 4, TV_ERR_ARGUMENT);
  WITH(options.gravity_sigma_rad, 0.1, TV_ERR_ARGUMENT); /* the directions are zero */
  options.gravity_in_world[0] = options.gravity_in_camera[1] = 1;
  options.gravity_sigma_rad = 0.1;
  WITH(options.gravity_in_world[2], NAN, TV_ERR_NOT_FINITE);
  WITH(options.gravity_in_camera[2], INFINITY, TV_ERR_NOT_FINITE);
  options.gravity_sigma_rad = 0;
  WITH(camera.fx, 0, TV_ERR_CAMERA);
  WITH(camera.model, 9, TV_ERR_CAMERA);
  for (k = 0; k < 50; ++k) sigmas[k] = 1;
  sigmas[49] = 0;
  WITH(matches.sigmas, sigmas, TV_ERR_ARGUMENT);
  sigmas[0] = NAN;
  WITH(matches.sigmas, sigmas, TV_ERR_NOT_FINITE);
  WITH(matches.pixels, (const double *)(const void *)&result, TV_ERR_OVERLAP);
  REFUSED(TV_ERR_OVERLAP, tv_estimate_absolute_pose(api.context, &camera, &matches, NULL, &result,
                                                    (uint8_t *)&result + 8));
#undef WITH
  tv_limits_init(&limits);
  limits.purposes = TV_PURPOSE_ESTIMATE;
  other = api_make(&limits);
  REFUSED(TV_ERR_LIMITS,
          tv_estimate_absolute_pose(other.context, &camera, &matches, NULL, &result, mask));
#undef REFUSED
  api_release(&other);
}

static void test_a_null_mask_and_null_options_are_allowed(void) {
  make_scene(50, 0, 0);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_estimate_absolute_pose(api.context, &camera, &matches, NULL, &result, NULL));
  TEST_ASSERT_TRUE(pose_error() < 1e-8);
}

/* Extreme but valid options and matches: nothing hangs, and no number is not finite. */
static void test_extreme_input_gives_finite_results(void) {
  static const double thresholds[] = {1e-300, 1e-9, 1, 1e9};
  static const double spreads[] = {1e-300, 1e-150, 1, 1e90};
  size_t a, b;
  int i;
  for (a = 0; a < 4; ++a) {
    for (b = 0; b < 4; ++b) {
      make_scene(60, 0.5, 0);
      for (i = 0; i < 180; ++i) points[i] *= spreads[b];
      options.max_error_px = thresholds[a];
      options.max_iterations = 300;
      must_estimate();
      for (i = 0; i < 36; ++i) TEST_ASSERT_TRUE(isfinite(result.covariance[i]));
      for (i = 0; i < 9; ++i) TEST_ASSERT_TRUE(isfinite(result.R[i]));
      for (i = 0; i < 3; ++i) TEST_ASSERT_TRUE(isfinite(result.t[i]));
      TEST_ASSERT_TRUE(isfinite(result.rms_error_px) && isfinite(result.noise_px));
    }
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_exact_matches_give_the_exact_pose);
  RUN_TEST(test_the_pose_is_found_among_wrong_matches);
  RUN_TEST(test_every_camera_model_is_served);
  RUN_TEST(test_a_fisheye_sees_points_to_the_side_and_behind);
  RUN_TEST(test_points_on_a_plane_are_no_obstacle);
  RUN_TEST(test_a_small_plane_far_away_has_two_poses);
  RUN_TEST(test_too_few_matches_and_matches_on_a_line_are_refused);
  RUN_TEST(test_noisy_points_near_a_line_are_never_ok);
  RUN_TEST(test_all_points_in_one_place_are_never_ok);
  RUN_TEST(test_random_matches_are_refused);
  RUN_TEST(test_few_inliers_are_doubtful);
  RUN_TEST(test_order_and_repeats_do_not_count);
  RUN_TEST(test_repeats_are_no_evidence);
  RUN_TEST(test_matches_that_are_not_finite_are_never_inliers);
  RUN_TEST(test_sigmas_weigh_the_matches);
  RUN_TEST(test_ratios_lead_the_search);
  RUN_TEST(test_gravity_helps_and_a_lie_does_no_harm);
  RUN_TEST(test_unit_and_origin_do_not_count);
  RUN_TEST(test_fixed_iterations_are_drawn);
  RUN_TEST(test_mistakes_are_refused_and_write_nothing);
  RUN_TEST(test_a_null_mask_and_null_options_are_allowed);
  RUN_TEST(test_extreme_input_gives_finite_results);
  return UNITY_END();
}
