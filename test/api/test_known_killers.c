/* Inputs that are known to hang, crash or mislead libraries of this kind, and inputs at the
   limits of this one. Each must give a status or a verdict in bounded time, and never a NaN.
   Issue numbers name the reports about other libraries. */
#include <math.h>
#include <string.h>
#include <time.h>

#include "support/api.h"
#include "support/calls.h"
#include "twoview/alloc.h"

enum { MAX_MATCHES = 100000, MANY = 1000 };

/* The largest processor time that one call may take, on any machine and under the sanitizers:
   the bound is only meant to find calls that do not end. A desktop core needs 0.3 s for the
   slowest call. */
static const double max_seconds = 60;

static tv_context *context;
static tv_camera lenses[3]; /* one pinhole, one Brown-Conrady, one Kannala-Brandt */
static tv_estimate_options options;
static tv_two_view result;
static tv_evidence evidence;
static double pixels[2][2 * MAX_MATCHES];
static float ratios[MAX_MATCHES];
static uint8_t mask[MAX_MATCHES];
static tv_point points[MANY];
static uint64_t seed;

static double uniform(double low, double high) { return low + (high - low) * random_unit(&seed); }

/* Returns an approximately standard normal number: the sum of 12 uniform ones, less 6. */
static double normal(void) {
  double sum = -6;
  int k;
  for (k = 0; k < 12; ++k) sum += random_unit(&seed);
  return sum;
}

void setUp(void) {
  static const double brown[5] = {-0.28, 0.07, 0.0002, 0.00002, 0};
  static const double fisheye[4] = {0.01, -0.003, 0, 0};
  tv_limits limits;
  int k;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 64;
  limits.max_keypoints = 64;
  limits.max_matches = MAX_MATCHES;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_new(&context, &limits));
  memset(lenses, 0, sizeof lenses);
  for (k = 0; k < 3; ++k) {
    lenses[k].model = TV_CAMERA_PINHOLE + k;
    lenses[k].width = 640, lenses[k].height = 480;
    lenses[k].fx = lenses[k].fy = k == 2 ? 250 : 500;
    lenses[k].cx = 320, lenses[k].cy = 240;
  }
  memcpy(lenses[1].k, brown, sizeof brown);
  memcpy(lenses[2].k, fisheye, sizeof fisheye);
  tv_estimate_options_init(&options);
  seed = 24;
}

void tearDown(void) { tv_context_free(context); }

static void set_match(int i, double x0, double y0, double x1, double y1) {
  pixels[0][2 * i] = x0, pixels[0][2 * i + 1] = y0;
  pixels[1][2 * i] = x1, pixels[1][2 * i + 1] = y1;
  ratios[i] = 0.5f;
}

static int all_finite(const double *values, int count) {
  while (count > 0 && isfinite(values[count - 1])) --count;
  return count == 0;
}

/* Fails unless `result` fulfils the conditions that hold for every result of the library. */
static void expect_sound(int count) {
  int i, inliers = 0;
  TEST_ASSERT_TRUE(result.kind >= TV_KIND_DEGENERATE && result.kind <= TV_KIND_NO_MOTION);
  TEST_ASSERT_EQUAL_INT(result.verdict == TV_VERDICT_OK, result.reasons == 0);
  TEST_ASSERT_TRUE(all_finite(result.R, 9) && all_finite(result.t, 3) && all_finite(result.E, 9) &&
                   all_finite(result.F, 9) && all_finite(result.H, 9));
  TEST_ASSERT_TRUE(all_finite(result.alternative_R, 9) && all_finite(result.alternative_t, 3));
  TEST_ASSERT_TRUE(all_finite(result.covariance, 25));
  for (i = 0; i < 5; ++i) TEST_ASSERT_TRUE(result.covariance[6 * i] >= 0);
  TEST_ASSERT_TRUE(isfinite(result.median_parallax_rad) && isfinite(result.rms_error_px));
  TEST_ASSERT_TRUE(evidence.coverage >= 0 && evidence.coverage <= 1);
  TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK || result.has_F || result.has_H);
  for (i = 0; i < count; ++i) inliers += mask[i];
  TEST_ASSERT_EQUAL_INT(inliers, result.num_inliers);
}

static void estimate(const tv_camera *camera, int count) {
  const clock_t start = clock();
  tv_two_view_init(&result);
  memset(mask, 0x5A, (size_t)count);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, estimate_evidence(context, camera, camera, pixels[0], pixels[1], ratios, count,
                               &options, &result, &evidence, mask));
  TEST_ASSERT_TRUE((double)(clock() - start) / CLOCKS_PER_SEC < max_seconds);
  expect_sound(count);
}

/* Estimates with every lens and solver, and without cameras. Returns the best verdict that the
   pinhole or no camera gave, since the pairs are made with a pinhole, and whether any lens gave
   a translation. */
typedef struct best {
  int verdict, has_t;
} best;

static best estimate_every_way(int count) {
  static const int methods[3] = {TV_SOLVER_FIVE_POINT, TV_SOLVER_EIGHT_POINT,
                                 TV_SOLVER_SEVEN_POINT};
  best b = {TV_VERDICT_REFUSED, 0};
  int lens, m;
  for (lens = -1; lens < 3; ++lens) {
    for (m = lens < 0; m < 3; ++m) {
      options.method = methods[m];
      estimate(lens < 0 ? NULL : &lenses[lens], count);
      if (lens < 1 && result.verdict > b.verdict) b.verdict = result.verdict;
      b.has_t |= result.has_t;
    }
  }
  options.method = TV_SOLVER_FIVE_POINT;
  return b;
}

/* Triangulates the first `count` matches by all methods. No point may hold a NaN, and each must
   have expected_status (any if that is negative). */
static void expect_sound_points(const tv_camera *camera, const double R[9], const double t[3],
                                int count, int expected_status) {
  const tv_camera_pair pair = pair_of(camera, camera, R, t);
  int method, i;
  for (method = TV_TRIANGULATION_POLY; method <= TV_TRIANGULATION_MIDPOINT; ++method) {
    TEST_ASSERT_EQUAL_INT(TV_OK, triangulate_pixels(&pair, pixels[0], pixels[1], count,
                                                    (tv_triangulation)method, points));
    for (i = 0; i < count; ++i) {
      TEST_ASSERT_TRUE(all_finite(points[i].position, 3));
      TEST_ASSERT_TRUE(isfinite(points[i].angle_rad) && isfinite(points[i].error_px));
      TEST_ASSERT_TRUE(points[i].status >= TV_POINT_OK && points[i].status <= TV_POINT_INVALID);
      if (expected_status >= 0) TEST_ASSERT_EQUAL_INT(expected_status, points[i].status);
    }
  }
}

static void turn_about_y(double angle_rad, double R[9]) {
  const double c = cos(angle_rad), s = sin(angle_rad);
  const double turn[9] = {c, 0, s, 0, 1, 0, -s, 0, c};
  memcpy(R, turn, sizeof turn);
}

/* Sets match i to the pixels of point p in both views, with noise; false if the camera does not
   see the point in both. */
static int see(const tv_camera *camera, const double R[9], const double t[3], const double p[3],
               double noise_px, int i) {
  double moved[3], at[2][2];
  int k;
  for (k = 0; k < 3; ++k) {
    moved[k] = R[3 * k] * p[0] + R[3 * k + 1] * p[1] + R[3 * k + 2] * p[2] + t[k];
  }
  if (tv_camera_project(camera, p, at[0], NULL) != TV_OK) return 0;
  if (tv_camera_project(camera, moved, at[1], NULL) != TV_OK) return 0;
  for (k = 0; k < 2; ++k) {
    at[k][0] += noise_px * normal();
    at[k][1] += noise_px * normal();
  }
  set_match(i, at[0][0], at[0][1], at[1][0], at[1][1]);
  return 1;
}

/* Makes `count` matches of points at depths from `low` to `high`, over the whole image of the
   pinhole. */
static void make_scene(int count, double low, double high, double noise_px, const double R[9],
                       const double t[3]) {
  int i;
  for (i = 0; i < count; ++i) {
    double p[3];
    do {
      p[2] = uniform(low, high);
      p[0] = uniform(-0.6, 0.6) * p[2];
      p[1] = uniform(-0.45, 0.45) * p[2];
    } while (!see(&lenses[0], R, t, p, noise_px, i));
  }
}

static double direction_error_deg(const double a[3], const double b[3]) {
  const double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                           a[0] * b[1] - a[1] * b[0]};
  const double sine = sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
  return atan2(sine, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) * 57.29577951308232;
}

static const double still[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

/* OpenCV 24967: findEssentialMat never returned, since a sample of points that do not move gives
   the solver's polynomial coefficients that are not finite. The report's data: focal length
   1211.2, principal point (0, 0), threshold 5 px; matches of a camera that stands still, rounded
   to pixels. */
static void test_opencv_24967_a_still_camera_ends_with_a_verdict(void) {
  tv_camera camera = lenses[0];
  int trial, i;
  camera.fx = camera.fy = 1211.2073974609375;
  camera.cx = camera.cy = 0;
  options.max_error_px = 5;
  for (trial = 0; trial < 12; ++trial) {
    const int count = trial < 6 ? 5 + trial : 20 * trial;
    for (i = 0; i < count; ++i) {
      const double x = floor(uniform(-300, 300)), y = floor(uniform(-280, 280));
      const int moves = trial % 3 == 1 && i % 4 == 0;
      set_match(i, x, y, x + moves, y - moves);
    }
    options.method = trial % 2 == 0 ? TV_SOLVER_FIVE_POINT : TV_SOLVER_SEVEN_POINT;
    estimate(&camera, count);
    TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK);
    if (trial % 3 != 1) TEST_ASSERT_EQUAL_INT(TV_KIND_NO_MOTION, result.kind);
  }
}

/* OpenCV 24482: the call returned None for valid input. The report's data: points about the
   principal point, half of them equal in both views, the others moved by a tenth of a pixel in
   either direction; a camera that hardly moves. */
static void test_opencv_24482_points_a_tenth_of_a_pixel_apart_have_an_answer(void) {
  tv_camera camera = lenses[0];
  int i;
  camera.fx = camera.fy = 1211.2073974609375;
  camera.cx = camera.cy = 0;
  for (i = 0; i < 60; ++i) {
    const double x = uniform(-280, 300), y = uniform(-290, -60);
    set_match(i, x, y, x + 0.1 * (i % 2) * random_int(&seed, -1, 1),
              y + 0.1003 * (i % 2) * random_int(&seed, -1, 1));
  }
  options.max_error_px = 1;
  estimate(&camera, 60);
  TEST_ASSERT_TRUE(result.has_R && result.num_inliers == 60 && result.verdict != TV_VERDICT_OK);
  for (i = 0; i < 9; ++i) TEST_ASSERT_DOUBLE_WITHIN(1e-3, i % 4 == 0, result.R[i]);
}

/* The title of the same report: valid input must give a result. */
static void test_opencv_24482_valid_input_always_has_an_answer(void) {
  int trial;
  for (trial = 0; trial < 40; ++trial) {
    double R[9], t[3];
    turn_about_y(uniform(-0.2, 0.2), R);
    t[0] = uniform(-1, 1), t[1] = uniform(-1, 1), t[2] = uniform(-0.3, 0.3);
    make_scene(trial < 20 ? 30 : 200, 2, 8, 0.3, R, t);
    estimate(&lenses[0], trial < 20 ? 30 : 200);
    TEST_ASSERT_TRUE(result.has_R && result.has_t);
  }
}

/* OpenCV 19639: findFundamentalMat crashed on these seven matches; three of them have the same
   point in one image. */
static void test_opencv_19639_repeated_points_are_survived(void) {
  static const double x[14] = {941, 890, 596, 940, 898, 941, 894,
                               933, 586, 938, 902, 933, 887, 935};
  static const double y[14] = {1416, 806,  1157, 852,  1380, 855,  1378,
                               843,  1145, 849,  1378, 843,  1378, 843};
  int swap, i;
  for (swap = 0; swap < 2; ++swap) {
    for (i = 0; i < 14; ++i) pixels[swap][i] = x[i], pixels[1 - swap][i] = y[i];
    for (i = 0; i < 7; ++i) ratios[i] = 0.5f;
    options.max_error_px = 3;
    options.confidence = 0.99;
    TEST_ASSERT_TRUE(estimate_every_way(7).verdict != TV_VERDICT_OK);
  }
}

/* OpenCV 24394: triangulatePoints gave NaN and infinities where the rays are parallel, and where
   pixel coordinates are integers. */
static void test_opencv_24394_parallel_rays_are_points_at_infinity(void) {
  static const double t[3] = {-1, 0, 0};
  int lens, i;
  for (i = 0; i < 100; ++i) {
    const double x = floor(uniform(200, 440)), y = floor(uniform(150, 330));
    set_match(i, x, y, x, y);
  }
  for (lens = 0; lens < 3; ++lens) {
    expect_sound_points(&lenses[lens], still, t, 100, TV_POINT_INFINITE);
  }
}

/* OpenCV 8032: recoverPose rejected points farther away than a fixed 50 baselines. */
static void test_opencv_8032_points_beyond_fifty_baselines_count(void) {
  const double t[3] = {-1, 0, 0};
  tv_camera_pair cameras;
  double R[9];
  int i;
  turn_about_y(0.1, R);
  cameras = pair_of(&lenses[0], &lenses[0], R, t);
  make_scene(400, 60, 400, 0.02, R, t);
  estimate(&lenses[0], 400);
  TEST_ASSERT_TRUE(result.has_R && result.has_t);
  TEST_ASSERT_TRUE(direction_error_deg(result.t, t) < 5);
  TEST_ASSERT_GREATER_THAN_INT(390, result.num_inliers);
  TEST_ASSERT_EQUAL_INT(TV_OK, triangulate_pixels(&cameras, pixels[0], pixels[1], 400,
                                                  TV_TRIANGULATION_ITERATIVE_LS, points));
  for (i = 0; i < 400; ++i) {
    TEST_ASSERT_EQUAL_INT(TV_POINT_OK, points[i].status);
    TEST_ASSERT_TRUE(points[i].position[2] > 50 && points[i].position[2] < 600);
  }
}

/* OpenGV's issue 73: it crashed on the rotation-only problem. */
static void test_opengv_73_rotation_only_gives_the_rotation(void) {
  static const int counts[7] = {2, 3, 5, 10, 50, 300, 1000};
  static const double none[3] = {0, 0, 0};
  double R[9];
  int k;
  turn_about_y(0.15, R);
  for (k = 0; k < 14; ++k) {
    const int count = counts[k % 7];
    make_scene(count, 2, 8, k < 7 ? 0 : 0.3, R, none);
    estimate(&lenses[0], count);
    TEST_ASSERT_TRUE(result.verdict != TV_VERDICT_OK);
    if (count < 50) continue;
    TEST_ASSERT_TRUE(result.has_R && result.num_inliers > count / 2);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, R[2], result.R[2]);
    if (k >= 7 && count < 300) continue;
    TEST_ASSERT_EQUAL_INT(TV_KIND_PANORAMIC, result.kind);
    TEST_ASSERT_TRUE((result.reasons & TV_REASON_PURE_ROTATION) != 0 && !result.has_t);
  }
}

static void test_equal_points_are_refused(void) {
  int i;
  for (i = 0; i < MANY; ++i) set_match(i, 320, 240, 300, 250);
  TEST_ASSERT_EQUAL_INT(0, estimate_every_way(MANY).has_t);
  for (i = 0; i < MANY; ++i) set_match(i, uniform(100, 500), uniform(100, 400), 300, 250);
  TEST_ASSERT_EQUAL_INT(0, estimate_every_way(MANY).has_t);
}

static void test_a_thousand_copies_of_one_match_are_refused(void) {
  int count, i;
  for (count = 1; count <= 8; ++count) { /* `count` different matches; all others repeat them */
    for (i = 0; i < count; ++i) {
      set_match(i, uniform(0, 640), uniform(0, 480), uniform(0, 640), uniform(0, 480));
    }
    for (i = count; i < MANY; ++i) {
      const int j = i % count;
      set_match(i, pixels[0][2 * j], pixels[0][2 * j + 1], pixels[1][2 * j], pixels[1][2 * j + 1]);
    }
    TEST_ASSERT_TRUE(estimate_every_way(MANY).verdict != TV_VERDICT_OK);
  }
}

static void test_points_on_a_line_are_not_ok(void) {
  const double t[3] = {-1, 0.1, 0.2};
  double R[9];
  int trial, i;
  turn_about_y(0.1, R);
  for (trial = 0; trial < 2; ++trial) {
    for (i = 0; i < MANY;) {
      const double s = uniform(-2, 2), p[3] = {s, 0.3 * s - 0.2, 5 + 0.4 * s * trial};
      i += see(&lenses[0], R, t, p, 0, i);
    }
    TEST_ASSERT_TRUE(estimate_every_way(MANY).verdict != TV_VERDICT_OK);
  }
  /* Pixels on one line in each image, in an order that no motion explains. */
  for (i = 0; i < MANY; ++i) {
    const double s = uniform(0, 600);
    set_match(i, s, 200 + 0.1 * s, 600 - s, 300);
  }
  TEST_ASSERT_TRUE(estimate_every_way(MANY).verdict != TV_VERDICT_OK);
}

static void test_points_on_a_conic_of_a_plane_have_a_verdict(void) {
  const double t[3] = {-1, 0.1, 0.2};
  double R[9];
  int i;
  turn_about_y(0.1, R);
  for (i = 0; i < MANY;) {
    const double s = uniform(-3.14, 3.14), p[3] = {1.5 * cos(s), sin(s), 5};
    i += see(&lenses[0], R, t, p, i % 2 == 0 ? 0 : 0.3, i);
  }
  estimate_every_way(MANY);
  for (i = 0; i < MANY; ++i) { /* pixels on a conic in view 0 and random pixels in view 1 */
    set_match(i, 320 + 200 * cos(0.01 * i), 240 + 200 * sin(0.01 * i), uniform(0, 640),
              uniform(0, 480));
  }
  TEST_ASSERT_TRUE(estimate_every_way(MANY).verdict != TV_VERDICT_OK);
}

static void test_points_on_the_baseline_are_refused(void) {
  const double t[3] = {0.1, 0.05, -1};
  int i;
  for (i = 0; i < 200; ++i) {
    const double s = 1.5 + 0.05 * i, p[3] = {-s * t[0], -s * t[1], -s * t[2]};
    TEST_ASSERT_TRUE(see(&lenses[0], still, t, p, 0, i));
  }
  TEST_ASSERT_EQUAL_INT(0, estimate_every_way(200).has_t);
  expect_sound_points(&lenses[0], still, t, 200, -1);
  for (i = 0; i < 200; ++i) {
    pixels[0][2 * i] += uniform(-0.5, 0.5);
    pixels[1][2 * i] += uniform(-0.5, 0.5);
  }
  TEST_ASSERT_TRUE(estimate_every_way(200).verdict != TV_VERDICT_OK);
  expect_sound_points(&lenses[0], still, t, 200, -1);
}

static void test_coordinates_that_are_no_numbers_take_no_part(void) {
  const double t[3] = {-1, 0.1, 0.2};
  const double bad[6] = {NAN, INFINITY, -INFINITY, 1e300, -1e18, 5e-324};
  double R[9];
  int i;
  turn_about_y(0.1, R);
  make_scene(MANY, 2, 8, 0.3, R, t);
  for (i = 0; i < MANY; i += 5) pixels[i / 5 % 2][2 * i + i / 10 % 2] = bad[i / 5 % 5];
  for (i = 0; i < 9; ++i) ratios[7 * i] = i % 3 == 0 ? NAN : i % 3 == 1 ? INFINITY : -INFINITY;
  estimate(&lenses[0], MANY);
  TEST_ASSERT_TRUE(result.has_t && direction_error_deg(result.t, t) < 3);
  for (i = 0; i < MANY; i += 5) TEST_ASSERT_EQUAL_INT(0, mask[i]);
  estimate_every_way(MANY);
  expect_sound_points(&lenses[0], R, t, MANY, -1);
  for (i = 0; i < MANY; ++i) set_match(i, bad[i % 6], bad[i % 5], bad[i % 4], bad[i % 3]);
  TEST_ASSERT_EQUAL_INT(0, estimate_every_way(MANY).has_t);
  expect_sound_points(&lenses[0], R, t, MANY, -1);
}

static void test_rays_of_no_length_and_turned_rays_are_told(void) {
  const double t[3] = {-1, 0, 0}, zero[3] = {0, 0, 0}, behind[3] = {0.1, 0.1, -1};
  const tv_camera_pair pair = pair_of(&lenses[0], &lenses[0], still, zero);
  double pixel[2];
  int lens, i;
  for (lens = 0; lens < 3; ++lens) {
    TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_project(&lenses[lens], zero, pixel, NULL));
  }
  TEST_ASSERT_EQUAL_INT(TV_ERR_OUTSIDE, tv_camera_project(&lenses[0], behind, pixel, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, triangulate_pixels(&pair, pixels[0], pixels[1], 1,
                                                            TV_TRIANGULATION_MIDPOINT, points));
  for (i = 0; i < 100; ++i) { /* the sign of t is wrong, so the rays meet behind both cameras */
    const double x = uniform(220, 420), y = uniform(140, 340);
    set_match(i, x, y, x + uniform(10, 50), y);
  }
  expect_sound_points(&lenses[0], still, t, 100, TV_POINT_BEHIND);
}

static void test_up_to_four_matches_are_too_few(void) {
  const double t[3] = {-1, 0, 0};
  int count;
  make_scene(4, 2, 8, 0, still, t);
  for (count = 0; count <= 4; ++count) {
    TEST_ASSERT_EQUAL_INT(0, estimate_every_way(count).has_t);
    TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, result.verdict);
    TEST_ASSERT_TRUE((result.reasons & TV_REASON_TOO_FEW_MATCHES) != 0);
  }
}

static void test_a_hundred_thousand_matches_end_in_bounded_time(void) {
  const double t[3] = {-1, 0.1, 0.2};
  double R[9];
  int i;
  turn_about_y(0.1, R);
  make_scene(MAX_MATCHES, 2, 8, 0.4, R, t);
  for (i = 0; i < MAX_MATCHES; i += 2) {
    set_match(i, uniform(0, 640), uniform(0, 480), uniform(0, 640), uniform(0, 480));
  }
  estimate(&lenses[0], MAX_MATCHES);
  TEST_ASSERT_TRUE(result.has_t && direction_error_deg(result.t, t) < 1);
  for (i = 0; i < MAX_MATCHES; ++i) { /* only wrong matches: sampling runs to max_iterations */
    set_match(i, uniform(0, 640), uniform(0, 480), uniform(0, 640), uniform(0, 480));
  }
  options.max_iterations = 200;
  estimate(&lenses[0], MAX_MATCHES);
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, result.verdict);
  for (i = 0; i < MAX_MATCHES; ++i) set_match(i, 100, 100, 110, 100);
  estimate(&lenses[0], MAX_MATCHES);
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_REFUSED, result.verdict);
}

static void test_thresholds_of_nothing_are_refused_and_of_everything_conclude_nothing(void) {
  static const double refused[5] = {0, -1, NAN, INFINITY, 1.01e9};
  const double t[3] = {-1, 0.1, 0.2};
  double R[9];
  int k;
  turn_about_y(0.1, R);
  make_scene(300, 2, 8, 0.3, R, t);
  for (k = 0; k < 5; ++k) {
    options.max_error_px = refused[k];
    tv_two_view_init(&result);
    TEST_ASSERT_TRUE(estimate_pixels(context, &lenses[0], &lenses[0], pixels[0], pixels[1], ratios,
                                     300, &options, &result, mask) != TV_OK);
  }
  options.max_error_px = 1e9; /* at this threshold every model fits every match */
  TEST_ASSERT_TRUE(estimate_every_way(300).verdict != TV_VERDICT_OK);
  options.max_error_px = 1e-9; /* at this threshold a model fits only its own sample */
  TEST_ASSERT_TRUE(estimate_every_way(300).verdict != TV_VERDICT_OK);
  options.max_error_px = 5e-324;
  TEST_ASSERT_TRUE(estimate_every_way(300).verdict != TV_VERDICT_OK);
}

/* expect_sound checks the numbers of a covariance; this test checks that some of the pairs have
   one. */
static void test_covariance_of_a_poor_pair_is_a_number_or_absent(void) {
  double R[9];
  int k, with = 0;
  for (k = 0; k < 40; ++k) {
    const double t[3] = {-pow(10, -0.1 * k), 0.1 * (k % 3), 0.02 * k};
    turn_about_y(0.01 * k, R);
    make_scene(k % 4 == 0 ? 8 : 100, 5, k % 2 == 0 ? 5.0001 : 40, k % 3 * 0.2, R, t);
    estimate(&lenses[0], k % 4 == 0 ? 8 : 100);
    with += result.has_covariance;
    if (!result.has_t) TEST_ASSERT_EQUAL_INT(0, result.has_covariance);
  }
  TEST_ASSERT_GREATER_THAN_INT(3, with);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_opencv_24967_a_still_camera_ends_with_a_verdict);
  RUN_TEST(test_opencv_24482_points_a_tenth_of_a_pixel_apart_have_an_answer);
  RUN_TEST(test_opencv_24482_valid_input_always_has_an_answer);
  RUN_TEST(test_opencv_19639_repeated_points_are_survived);
  RUN_TEST(test_opencv_24394_parallel_rays_are_points_at_infinity);
  RUN_TEST(test_opencv_8032_points_beyond_fifty_baselines_count);
  RUN_TEST(test_opengv_73_rotation_only_gives_the_rotation);
  RUN_TEST(test_equal_points_are_refused);
  RUN_TEST(test_a_thousand_copies_of_one_match_are_refused);
  RUN_TEST(test_points_on_a_line_are_not_ok);
  RUN_TEST(test_points_on_a_conic_of_a_plane_have_a_verdict);
  RUN_TEST(test_points_on_the_baseline_are_refused);
  RUN_TEST(test_coordinates_that_are_no_numbers_take_no_part);
  RUN_TEST(test_rays_of_no_length_and_turned_rays_are_told);
  RUN_TEST(test_up_to_four_matches_are_too_few);
  RUN_TEST(test_a_hundred_thousand_matches_end_in_bounded_time);
  RUN_TEST(test_thresholds_of_nothing_are_refused_and_of_everything_conclude_nothing);
  RUN_TEST(test_covariance_of_a_poor_pair_is_a_number_or_absent);
  return UNITY_END();
}
