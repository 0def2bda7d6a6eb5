/* Tests of tv_triangulate: the statuses and outputs that the header promises. */
#include <math.h>
#include <string.h>

#include "support/calls.h"
#include "unity.h"

#define NUM_POINTS 4

static tv_camera camera0, camera1;
static double R[9], t[3];
static double pixels0[2 * NUM_POINTS], pixels1[2 * NUM_POINTS];
static tv_point points[NUM_POINTS + 1], untouched[NUM_POINTS + 1];

/* Four points at depths of 2 to 5, with a baseline of 1. */
static const double truth[NUM_POINTS][3] = {
    {0.1, 0.2, 2}, {-0.3, 0.1, 3}, {0.5, -0.4, 4}, {1, 0.5, 5}};

static double corrected0[2 * NUM_POINTS], corrected1[2 * NUM_POINTS];
static uint8_t valid[NUM_POINTS];

void setUp(void) {
  int i;
  memset(&camera0, 0, sizeof camera0);
  camera0.model = TV_CAMERA_PINHOLE;
  camera0.width = 640, camera0.height = 480;
  camera0.fx = camera0.fy = 500, camera0.cx = 320, camera0.cy = 240;
  camera1 = camera0;
  camera1.cx = 350;
  for (i = 0; i < 9; ++i) R[i] = i % 4 == 0;
  t[0] = -1, t[1] = 0, t[2] = 0;
  for (i = 0; i < NUM_POINTS; ++i) {
    double moved[3];
    memcpy(moved, truth[i], sizeof moved);
    moved[0] -= 1;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera0, truth[i], pixels0 + 2 * i, NULL));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera1, moved, pixels1 + 2 * i, NULL));
  }
  memset(points, 0x5a, sizeof points);
  memset(untouched, 0x5a, sizeof untouched);
}

void tearDown(void) {}

static tv_status run(tv_triangulation method) {
  const tv_camera_pair pair = pair_of(&camera0, &camera1, R, t);
  return triangulate_pixels(&pair, pixels0, pixels1, NUM_POINTS, method, points);
}

static void expect_refusal(tv_status expected) {
  TEST_ASSERT_EQUAL_INT(expected, run(TV_TRIANGULATION_ITERATIVE_LS));
  TEST_ASSERT_EQUAL_MEMORY(untouched, points, sizeof points);
}

static void test_every_method_finds_the_points(void) {
  int m, i, axis;
  for (m = 0; m < 7; ++m) {
    TEST_ASSERT_EQUAL_INT(TV_OK, run((tv_triangulation)m));
    for (i = 0; i < NUM_POINTS; ++i) {
      TEST_ASSERT_EQUAL_INT(TV_POINT_OK, points[i].status);
      for (axis = 0; axis < 3; ++axis) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, truth[i][axis], points[i].position[axis]);
      }
    }
    TEST_ASSERT_EQUAL_MEMORY(&untouched[NUM_POINTS], &points[NUM_POINTS], sizeof(tv_point));
  }
}

static void test_other_methods_are_refused(void) {
  const int methods[3] = {7, -1, 1000000};
  int m;
  for (m = 0; m < 3; ++m) {
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, run((tv_triangulation)methods[m]));
    TEST_ASSERT_EQUAL_MEMORY(untouched, points, sizeof points);
  }
}

static void test_null_pointers_are_refused(void) {
  const tv_triangulation m = TV_TRIANGULATION_MIDPOINT;
  const tv_camera_pair pair = pair_of(&camera0, &camera1, R, t);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, triangulate_pixels(NULL, pixels0, pixels1, 4, m, points));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_triangulate(&pair, NULL, m, points));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, triangulate_pixels(&pair, NULL, pixels1, 4, m, points));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, triangulate_pixels(&pair, pixels0, NULL, 4, m, points));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, triangulate_pixels(&pair, pixels0, pixels1, 4, m, NULL));
  TEST_ASSERT_EQUAL_MEMORY(untouched, points, sizeof points);
}

static void test_no_points_are_fine_and_fewer_are_not(void) {
  const tv_triangulation m = TV_TRIANGULATION_MIDPOINT;
  const tv_camera_pair pair = pair_of(&camera0, &camera1, R, t);
  TEST_ASSERT_EQUAL_INT(TV_OK, triangulate_pixels(&pair, NULL, NULL, 0, m, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        triangulate_pixels(&pair, pixels0, pixels1, -1, m, points));
  TEST_ASSERT_EQUAL_MEMORY(untouched, points, sizeof points);
}

static void test_pairs_of_another_size_are_refused_and_sigmas_are_not_read(void) {
  const float bad[NUM_POINTS] = {-1};
  const tv_camera_pair pair = pair_of(&camera0, &camera1, R, t);
  tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, NUM_POINTS);
  pairs.struct_size = 2;
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE,
                        tv_triangulate(&pair, &pairs, TV_TRIANGULATION_POLY, points));
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE, tv_correct_matches(&pair, &pairs, TV_TRIANGULATION_POLY,
                                                               corrected0, corrected1, valid));
  TEST_ASSERT_EQUAL_MEMORY(untouched, points, sizeof points);
  pairs.struct_size = sizeof pairs;
  pairs.sigmas0 = pairs.sigmas1 = pairs.ratios = bad;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_triangulate(&pair, &pairs, TV_TRIANGULATION_POLY, points));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_correct_matches(&pair, &pairs, TV_TRIANGULATION_POLY, corrected0,
                                                  corrected1, valid));
}

static void test_r_is_a_rotation_to_a_millionth(void) {
  const double c = cos(0.3), s = sin(0.3);
  R[0] = 1 + 1e-5, expect_refusal(TV_ERR_ARGUMENT), setUp();
  R[1] = 1e-5, expect_refusal(TV_ERR_ARGUMENT), setUp();
  R[0] = R[4] = R[8] = -1, expect_refusal(TV_ERR_ARGUMENT), setUp(); /* det R = -1: a reflection */
  R[8] = -1, expect_refusal(TV_ERR_ARGUMENT), setUp();
  memset(R, 0, sizeof R), expect_refusal(TV_ERR_ARGUMENT), setUp();
  R[0] = 1e200, expect_refusal(TV_ERR_ARGUMENT), setUp();
  R[0] = c, R[1] = -s, R[3] = s, R[4] = c;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(TV_TRIANGULATION_ITERATIVE_LS));
  setUp();
  R[0] = 1 + 1e-7;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(TV_TRIANGULATION_ITERATIVE_LS));
}

static void test_t_is_not_zero(void) {
  t[0] = 0;
  expect_refusal(TV_ERR_ARGUMENT);
  t[2] = 1e-300;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(TV_TRIANGULATION_ITERATIVE_LS));
}

static void test_numbers_that_are_not_finite_are_refused(void) {
  const double bad[3] = {NAN, INFINITY, -INFINITY};
  int i, j;
  for (i = 0; i < 3; ++i) {
    for (j = 0; j < 9; ++j) R[j] = bad[i], expect_refusal(TV_ERR_NOT_FINITE), setUp();
    for (j = 0; j < 3; ++j) t[j] = bad[i], expect_refusal(TV_ERR_NOT_FINITE), setUp();
    camera0.fx = bad[i], expect_refusal(TV_ERR_CAMERA), setUp();
    camera1.k[3] = bad[i], expect_refusal(TV_ERR_CAMERA), setUp();
  }
}

static void test_a_bad_pixel_spoils_its_point_only(void) {
  const double zeros[3] = {0, 0, 0};
  int i;
  pixels0[3] = NAN;
  pixels1[4] = INFINITY;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(TV_TRIANGULATION_ITERATIVE_LS));
  for (i = 0; i < NUM_POINTS; ++i) {
    TEST_ASSERT_EQUAL_INT(i == 1 || i == 2 ? TV_POINT_INVALID : TV_POINT_OK, points[i].status);
  }
  TEST_ASSERT_EQUAL_MEMORY(zeros, points[1].position, sizeof zeros);
  TEST_ASSERT_EQUAL_MEMORY(zeros, points[2].position, sizeof zeros);
}

static void test_points_may_not_lie_over_pixels(void) {
  const tv_triangulation m = TV_TRIANGULATION_MIDPOINT;
  tv_camera_pair pair = pair_of(&camera0, &camera1, R, t);
  union {
    tv_point points[NUM_POINTS];
    double pixels[2 * NUM_POINTS];
  } both, before;
  memcpy(both.pixels, pixels0, sizeof both.pixels);
  memset((char *)&both + sizeof both.pixels, 0, sizeof both - sizeof both.pixels);
  before = both;
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_OVERLAP, triangulate_pixels(&pair, both.pixels, pixels1, NUM_POINTS, m, both.points));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_OVERLAP, triangulate_pixels(&pair, pixels1, both.pixels, NUM_POINTS, m, both.points));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_OVERLAP, triangulate_pixels(&pair, pixels0, pixels1, 1, m, (tv_point *)(void *)&pair));
  TEST_ASSERT_EQUAL_MEMORY(&before, &both, sizeof both);
}

static tv_status correct(tv_triangulation cost) {
  const tv_camera_pair pair = pair_of(&camera0, &camera1, R, t);
  return correct_pixels_of(&pair, pixels0, pixels1, NUM_POINTS, cost, corrected0, corrected1,
                           valid);
}

static void test_corrected_matches_meet_at_the_points_of_the_same_method(void) {
  const int costs[2] = {TV_TRIANGULATION_POLY, TV_TRIANGULATION_POLY_ABS};
  int c, i, k;
  for (i = 0; i < 2 * NUM_POINTS; ++i) pixels0[i] += i % 3 - 1, pixels1[i] -= i % 2;
  camera1.model = TV_CAMERA_BROWN_CONRADY, camera1.k[0] = -0.1;
  for (c = 0; c < 2; ++c) {
    TEST_ASSERT_EQUAL_INT(TV_OK, run((tv_triangulation)costs[c]));
    TEST_ASSERT_EQUAL_INT(TV_OK, correct((tv_triangulation)costs[c]));
    for (i = 0; i < NUM_POINTS; ++i) {
      double pixel[2], moved[3];
      TEST_ASSERT_EQUAL_INT(1, valid[i]);
      memcpy(moved, points[i].position, sizeof moved);
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera0, moved, pixel, NULL));
      for (k = 0; k < 2; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-9, pixel[k], corrected0[2 * i + k]);
      for (k = 0; k < 3; ++k) moved[k] += t[k];
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera1, moved, pixel, NULL));
      for (k = 0; k < 2; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-9, pixel[k], corrected1[2 * i + k]);
    }
  }
}

static void test_a_match_that_cannot_be_corrected_is_zeros(void) {
  const double zeros[2] = {0, 0};
  pixels0[3] = NAN;
  pixels1[4] = -INFINITY;
  TEST_ASSERT_EQUAL_INT(TV_OK, correct(TV_TRIANGULATION_POLY));
  TEST_ASSERT_EQUAL_INT(1, valid[0]);
  TEST_ASSERT_EQUAL_INT(0, valid[1]);
  TEST_ASSERT_EQUAL_INT(0, valid[2]);
  TEST_ASSERT_EQUAL_MEMORY(zeros, corrected0 + 2, sizeof zeros);
  TEST_ASSERT_EQUAL_MEMORY(zeros, corrected1 + 2, sizeof zeros);
  TEST_ASSERT_EQUAL_MEMORY(zeros, corrected0 + 4, sizeof zeros);
}

static void test_bad_arguments_of_a_correction_are_refused(void) {
  const tv_triangulation poly = TV_TRIANGULATION_POLY;
  double *const a = corrected0, *const b = corrected1;
  tv_camera_pair pair = pair_of(&camera0, &camera1, R, t);
  const tv_camera_pair *const c = &pair;
  int m;
  for (m = 2; m < 8; ++m) {
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, correct((tv_triangulation)m));
  }
#define CORRECT(c, p0, p1, n, q0, q1, v) correct_pixels_of(c, p0, p1, n, poly, q0, q1, v)
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, CORRECT(NULL, pixels0, pixels1, NUM_POINTS, a, b, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_correct_matches(c, NULL, poly, a, b, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, CORRECT(c, NULL, pixels1, NUM_POINTS, a, b, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, CORRECT(c, pixels0, NULL, NUM_POINTS, a, b, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, CORRECT(c, pixels0, pixels1, NUM_POINTS, NULL, b, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, CORRECT(c, pixels0, pixels1, NUM_POINTS, a, NULL, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, CORRECT(c, pixels0, pixels1, NUM_POINTS, a, b, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, CORRECT(c, pixels0, pixels1, -1, a, b, valid));
  TEST_ASSERT_EQUAL_INT(TV_OK, CORRECT(c, NULL, NULL, 0, NULL, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        CORRECT(c, pixels0, pixels1, NUM_POINTS, pixels0, b, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        CORRECT(c, pixels0, pixels1, NUM_POINTS, a, pixels0, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, CORRECT(c, pixels0, pixels1, NUM_POINTS, a, a + 2, valid));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        CORRECT(c, pixels0, pixels1, NUM_POINTS, a, b, (uint8_t *)b + 9));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        CORRECT(c, pixels0, pixels1, 1, a, b, (uint8_t *)&pair + 5));
#undef CORRECT
  R[0] = NAN;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, correct(poly));
  R[0] = 2;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, correct(poly));
  R[0] = 1, t[0] = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, correct(poly));
  t[0] = 1, camera0.fx = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA, correct(poly));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_every_method_finds_the_points);
  RUN_TEST(test_other_methods_are_refused);
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_no_points_are_fine_and_fewer_are_not);
  RUN_TEST(test_pairs_of_another_size_are_refused_and_sigmas_are_not_read);
  RUN_TEST(test_r_is_a_rotation_to_a_millionth);
  RUN_TEST(test_t_is_not_zero);
  RUN_TEST(test_numbers_that_are_not_finite_are_refused);
  RUN_TEST(test_a_bad_pixel_spoils_its_point_only);
  RUN_TEST(test_points_may_not_lie_over_pixels);
  RUN_TEST(test_corrected_matches_meet_at_the_points_of_the_same_method);
  RUN_TEST(test_a_match_that_cannot_be_corrected_is_zeros);
  RUN_TEST(test_bad_arguments_of_a_correction_are_refused);
  return UNITY_END();
}
