/* Guided matching compared with a direct implementation of match.h's definition that looks at
   all pairs, through a pinhole, a Brown-Conrady and a fisheye lens and without cameras. */

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

enum { MAX_POINTS = 90, SIZE = TV_DESCRIPTOR_BYTES };

static tv_keypoint keypoints0[MAX_POINTS], keypoints1[MAX_POINTS];
static uint8_t descriptors0[MAX_POINTS * SIZE], descriptors1[MAX_POINTS * SIZE];
static tv_correspondence found[MAX_POINTS], swapped[MAX_POINTS], expected[MAX_POINTS];
static api_context contexts[8];
static int num_contexts;

static double random_double(uint64_t *state, double low, double high) {
  return low + (high - low) * random_unit(state);
}

/* R and t of x1 = R x0 + t; R turns by 0.2 rad about y. */
static const double rotation[9] = {0.9800665778412416,   0, 0.19866933079506122, 0, 1, 0,
                                   -0.19866933079506122, 0, 0.9800665778412416};
static const double translation[3] = {-0.8, 0.36, 0.48};

void setUp(void) {}
void tearDown(void) {}

static void make_contexts(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 16;
  limits.max_keypoints = MAX_POINTS;
  num_contexts = api_make_all_kernels(limits, contexts);
}

static tv_camera make_camera(int model) {
  static const double distortion[3][8] = {{0}, {-0.25, 0.05, 1e-3, -2e-3}, {0.02, -0.01, 0.002}};
  tv_camera camera;
  memset(&camera, 0, sizeof camera);
  camera.model = model;
  camera.width = 640;
  camera.height = 480;
  camera.fx = model == TV_CAMERA_KANNALA_BRANDT ? 260 : 450;
  camera.fy = camera.fx + 3;
  camera.cx = 318;
  camera.cy = 243;
  memcpy(camera.k, distortion[model], sizeof camera.k);
  return camera;
}

/* E = [t]x R */
static void make_essential(double E[9]) {
  const double *t = translation;
  const double skew[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
  int r, c, k;
  for (r = 0; r < 3; ++r) {
    for (c = 0; c < 3; ++c) {
      E[3 * r + c] = 0;
      for (k = 0; k < 3; ++k) E[3 * r + c] += skew[3 * r + k] * rotation[3 * k + c];
    }
  }
}

static void transpose(const double a[9], double b[9]) {
  int k;
  for (k = 0; k < 9; ++k) b[k] = a[k % 3 * 3 + k / 3];
}

static void set_pixel(tv_keypoint *k, double x, double y) {
  memset(k, 0, sizeof *k);
  k->x = (float)x;
  k->y = (float)y;
  k->size = 4;
}

/* Points in front of both cameras that both see; keypoint k of each image is point k. */
static void make_scene(uint64_t *state, const tv_camera *camera0, const tv_camera *camera1,
                       int count) {
  int k = 0, r;
  while (k < count) {
    const double z = random_double(state, 2, 9);
    const double X[3] = {random_double(state, -0.6, 0.6) * z, random_double(state, -0.5, 0.5) * z,
                         z};
    double Y[3], pixel0[2], pixel1[2];
    for (r = 0; r < 3; ++r) {
      Y[r] = rotation[3 * r] * X[0] + rotation[3 * r + 1] * X[1] + rotation[3 * r + 2] * X[2] +
             translation[r];
    }
    if (tv_camera_project(camera0, X, pixel0, NULL) != TV_OK) continue;
    if (tv_camera_project(camera1, Y, pixel1, NULL) != TV_OK) continue;
    set_pixel(&keypoints0[k], pixel0[0], pixel0[1]);
    set_pixel(&keypoints1[k], pixel1[0], pixel1[1]);
    ++k;
  }
}

static int64_t distance_sq(const uint8_t *a, const uint8_t *b) {
  int64_t sum = 0;
  int k;
  for (k = 0; k < SIZE; ++k) sum += (int64_t)(a[k] - b[k]) * (a[k] - b[k]);
  return sum;
}

/* Sampson's distance in pixels; -1 where a keypoint has no ray. */
static double sampson(const tv_camera *camera0, const tv_camera *camera1, const double M[9],
                      const tv_keypoint *a, const tv_keypoint *b) {
  const double pixel0[2] = {a->x, a->y}, pixel1[2] = {b->x, b->y};
  double ray0[3] = {a->x, a->y, 1}, ray1[3] = {b->x, b->y, 1}, line0[3], line1[3], r = 0, g = 0;
  double slope0[6] = {1, 0, 0, 1, 0, 0}, slope1[6] = {1, 0, 0, 1, 0, 0};
  int i, c;
  if (camera0 != NULL) {
    if (tv_camera_unproject(camera0, pixel0, ray0, slope0) != TV_OK) return -1;
    if (tv_camera_unproject(camera1, pixel1, ray1, slope1) != TV_OK) return -1;
  }
  for (i = 0; i < 3; ++i) {
    line1[i] = M[3 * i] * ray0[0] + M[3 * i + 1] * ray0[1] + M[3 * i + 2] * ray0[2];
    line0[i] = M[i] * ray1[0] + M[3 + i] * ray1[1] + M[6 + i] * ray1[2];
  }
  for (i = 0; i < 3; ++i) r += line1[i] * ray1[i];
  for (c = 0; c < 2; ++c) {
    double g1 = 0, g0 = 0;
    for (i = 0; i < 3; ++i) {
      g1 += slope1[2 * i + c] * line1[i];
      g0 += slope0[2 * i + c] * line0[i];
    }
    g += g1 * g1 + g0 * g0;
  }
  return g > 0 ? fabs(r) / sqrt(g) : 1e300;
}

typedef struct problem {
  const tv_camera *camera0, *camera1;
  const double *M;
  int num0, num1;
  tv_guided_options options;
} problem;

static int candidate(const problem *p, int i, int j) {
  const double d = sampson(p->camera0, p->camera1, p->M, &keypoints0[i], &keypoints1[j]);
  return d >= 0 && d < p->options.max_error_px;
}

static int64_t distance(int i, int j) {
  return distance_sq(descriptors0 + i * SIZE, descriptors1 + j * SIZE);
}

static int beside(const problem *p, const tv_keypoint *a, const tv_keypoint *b) {
  const double dx = (double)a->x - b->x, dy = (double)a->y - b->y;
  return sqrt(dx * dx + dy * dy) <= p->options.neighbourhood_px;
}

static int match_by_definition(const problem *p) {
  const double largest = (double)p->options.max_distance * p->options.max_distance;
  int count = 0, i, j, k;
  for (i = 0; i < p->num0; ++i) {
    int best = -1, back = -1;
    double rival = largest, ratio;
    for (j = 0; j < p->num1; ++j) {
      if (candidate(p, i, j) && (best < 0 || distance(i, j) < distance(i, best))) best = j;
    }
    if (best < 0) continue;
    for (k = 0; k < p->num0; ++k) {
      if (candidate(p, k, best) && (back < 0 || distance(k, best) < distance(back, best))) back = k;
    }
    if (back != i || !((double)distance(i, best) < largest)) continue;
    for (j = 0; j < p->num1; ++j) {
      if (candidate(p, i, j) && !beside(p, &keypoints1[j], &keypoints1[best]) &&
          (double)distance(i, j) < rival) {
        rival = (double)distance(i, j);
      }
    }
    for (k = 0; k < p->num0; ++k) {
      if (candidate(p, k, best) && !beside(p, &keypoints0[k], &keypoints0[i]) &&
          (double)distance(k, best) < rival) {
        rival = (double)distance(k, best);
      }
    }
    ratio = rival > 0 ? sqrt((double)distance(i, best) / rival) : 1;
    if ((float)ratio >= p->options.ratio) continue;
    expected[count].idx0 = i;
    expected[count].idx1 = best;
    expected[count].dist_sq = (uint32_t)distance(i, best);
    expected[count].ratio = (float)ratio;
    ++count;
  }
  return count;
}

static int32_t run(const api_context *a, const problem *p, tv_correspondence *out) {
  int32_t count = -1;
  TEST_ASSERT_EQUAL_INT(
      TV_OK,
      match_rows_guided(a->context, p->camera0, p->camera1, p->M, keypoints0, descriptors0, p->num0,
                        keypoints1, descriptors1, p->num1, &p->options, out, MAX_POINTS, &count));
  return count;
}

static int32_t run_swapped(const api_context *a, const problem *p, tv_correspondence *out) {
  double M[9];
  int32_t count = -1;
  transpose(p->M, M);
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows_guided(a->context, p->camera1, p->camera0, M, keypoints1,
                                                 descriptors1, p->num1, keypoints0, descriptors0,
                                                 p->num0, &p->options, out, MAX_POINTS, &count));
  return count;
}

static int check(const problem *p) {
  const int32_t count = match_by_definition(p);
  int k, c, other;
  for (c = 0; c < num_contexts; ++c) {
    TEST_ASSERT_EQUAL_INT(count, run(&contexts[c], p, found));
    if (count > 0) TEST_ASSERT_EQUAL_MEMORY(expected, found, (size_t)count * sizeof found[0]);
    TEST_ASSERT_EQUAL_INT(count, run_swapped(&contexts[c], p, swapped));
    for (k = 0; k < count; ++k) {
      for (other = 0; swapped[other].idx1 != found[k].idx0; ++other) {
        TEST_ASSERT_TRUE(other + 1 < count);
      }
      TEST_ASSERT_EQUAL_INT(found[k].idx1, swapped[other].idx0);
      TEST_ASSERT_EQUAL_UINT32(found[k].dist_sq, swapped[other].dist_sq);
      TEST_ASSERT_EQUAL_MEMORY(&found[k].ratio, &swapped[other].ratio, sizeof(float));
    }
  }
  return count;
}

static problem make_problem(const tv_camera *camera0, const tv_camera *camera1, const double *M) {
  problem p;
  p.camera0 = camera0;
  p.camera1 = camera1;
  p.M = M;
  p.num0 = p.num1 = MAX_POINTS;
  tv_guided_options_init(&p.options);
  return p;
}

/* Descriptors of point k in both images; they differ by at most `noise` in each byte. */
static void fill_descriptors(uint64_t *state, int noise) {
  int k;
  random_bytes(state, descriptors0, sizeof descriptors0);
  for (k = 0; k < (int)sizeof descriptors0; ++k) {
    const int v = descriptors0[k] % 64 + random_int(state, -noise, noise);
    descriptors0[k] = (uint8_t)(descriptors0[k] % 64);
    descriptors1[k] = (uint8_t)(v < 0 ? 0 : v);
  }
}

static void test_matches_equal_the_definition_and_swap_with_the_views(void) {
  static const float bands[3] = {0.5f, 4.0f, 60.0f}, ratios[3] = {0.6f, 0.87f, 1.0f};
  uint64_t state = 21;
  double E[9];
  int pair, round, total = 0;
  make_essential(E);
  for (pair = 0; pair < 9; ++pair) {
    const tv_camera camera0 = make_camera(pair % 3), camera1 = make_camera(pair / 3);
    problem p = make_problem(&camera0, &camera1, E);
    for (round = 0; round < 6; ++round) {
      int k;
      make_scene(&state, &camera0, &camera1, MAX_POINTS);
      fill_descriptors(&state, 12);
      if (round % 2 == 1) { /* only 0 and 1, so that many distances are equal */
        for (k = 0; k < (int)sizeof descriptors0; ++k) {
          descriptors0[k] = (uint8_t)(k % SIZE < 4 ? descriptors0[k] & 1 : 0);
          descriptors1[k] = (uint8_t)(k % SIZE < 4 ? descriptors1[k] & 1 : 0);
        }
      }
      /* A third of image 1's keypoints lie anywhere, some outside the lens's valid region. */
      for (k = 0; k < MAX_POINTS; k += 3) {
        set_pixel(&keypoints1[k], random_double(&state, -900, 1500), random_double(&state, 0, 480));
      }
      p.num0 = random_int(&state, 0, MAX_POINTS);
      p.num1 = random_int(&state, MAX_POINTS / 2, MAX_POINTS);
      p.options.max_error_px = bands[round % 3];
      p.options.ratio = ratios[round / 2];
      p.options.max_distance = round % 2 == 1 ? 1.5f : 180.0f;
      p.options.neighbourhood_px = round < 3 ? 0.0f : 30.0f;
      total += check(&p);
    }
  }
  TEST_ASSERT_TRUE(total > 500);
}

static void test_without_cameras_the_matrix_is_of_pixels(void) {
  const tv_camera camera = make_camera(TV_CAMERA_PINHOLE);
  const double inverse[9] = {
      1 / camera.fx, 0, -camera.cx / camera.fx, 0, 1 / camera.fy, -camera.cy / camera.fy, 0, 0, 1};
  uint64_t state = 22;
  double E[9], half[9], F[9];
  int r, c, k;
  problem p;
  make_essential(E);
  for (r = 0; r < 3; ++r) {
    for (c = 0; c < 3; ++c) {
      half[3 * r + c] = 0;
      for (k = 0; k < 3; ++k) half[3 * r + c] += E[3 * r + k] * inverse[3 * k + c];
    }
  }
  for (r = 0; r < 3; ++r) {
    for (c = 0; c < 3; ++c) {
      F[3 * r + c] = 0;
      for (k = 0; k < 3; ++k) F[3 * r + c] += inverse[3 * k + r] * half[3 * k + c];
    }
  }
  make_scene(&state, &camera, &camera, MAX_POINTS);
  fill_descriptors(&state, 12);
  p = make_problem(NULL, NULL, F);
  TEST_ASSERT_EQUAL_INT(MAX_POINTS, check(&p));
  p = make_problem(&camera, &camera, E);
  TEST_ASSERT_EQUAL_INT(MAX_POINTS, check(&p));
}

/* Points in groups that look alike: over the whole image a descriptor has rivals, along an
   epipolar line it has none. */
static void test_repeated_structure_is_matched_along_the_lines(void) {
  const tv_camera camera0 = make_camera(TV_CAMERA_KANNALA_BRANDT);
  const tv_camera camera1 = make_camera(TV_CAMERA_BROWN_CONRADY);
  uint64_t state = 23;
  double E[9];
  int32_t plain = -1;
  int k, count, right = 0;
  problem p;
  make_essential(E);
  make_scene(&state, &camera0, &camera1, MAX_POINTS);
  fill_descriptors(&state, 3);
  for (k = 0; k < MAX_POINTS; ++k) {
    memcpy(descriptors0 + k * SIZE, descriptors0 + k % 6 * SIZE, SIZE);
    memcpy(descriptors1 + k * SIZE, descriptors1 + k % 6 * SIZE, SIZE);
  }
  TEST_ASSERT_EQUAL_INT(
      TV_OK, match_rows(contexts[0].context, descriptors0, MAX_POINTS, descriptors1, MAX_POINTS,
                        NULL, found, MAX_POINTS, &plain));
  TEST_ASSERT_EQUAL_INT(0, plain);
  p = make_problem(&camera0, &camera1, E);
  p.options.max_error_px = 1;
  count = check(&p);
  for (k = 0; k < count; ++k) right += found[k].idx0 == found[k].idx1;
  TEST_ASSERT_TRUE(right > MAX_POINTS / 2);
  TEST_ASSERT_TRUE(count - right < right / 10);
}

/* For a sideways motion the epipolar lines are the rows. Two keypoints of image 1 lie on the
   line of image 0's only keypoint, 3 pixels from each other. The farther descriptor is no rival
   of the nearest one while it lies within neighbourhood_px (4, then 2) of it. */
static void test_what_lies_beside_the_nearest_is_no_rival(void) {
  const tv_camera camera = make_camera(TV_CAMERA_PINHOLE);
  const double E[9] = {0, 0, 0, 0, 0, -1, 0, 1, 0};
  problem p = make_problem(&camera, &camera, E);
  memset(descriptors0, 0, sizeof descriptors0);
  memset(descriptors1, 0, sizeof descriptors1);
  descriptors1[0] = 20;
  descriptors1[SIZE] = 21;
  set_pixel(&keypoints0[0], 300, 200);
  set_pixel(&keypoints1[0], 280, 200);
  set_pixel(&keypoints1[1], 283, 200);
  p.num0 = 1;
  p.num1 = 2;
  TEST_ASSERT_EQUAL_INT(1, check(&p));
  TEST_ASSERT_EQUAL_INT(0, found[0].idx1);
  TEST_ASSERT_EQUAL_FLOAT(20.0f / 180.0f, found[0].ratio);
  p.options.neighbourhood_px = 2;
  TEST_ASSERT_EQUAL_INT(0, check(&p));
  set_pixel(&keypoints1[1], 283, 230); /* 30 px off the epipolar line */
  TEST_ASSERT_EQUAL_INT(1, check(&p));
}

static void test_a_distance_beyond_the_largest_is_no_match(void) {
  const tv_camera camera = make_camera(TV_CAMERA_PINHOLE);
  const double E[9] = {0, 0, 0, 0, 0, -1, 0, 1, 0};
  problem p = make_problem(&camera, &camera, E);
  memset(descriptors0, 0, sizeof descriptors0);
  memset(descriptors1, 0, sizeof descriptors1);
  descriptors1[0] = 180;
  set_pixel(&keypoints0[0], 300, 200);
  set_pixel(&keypoints1[0], 280, 200);
  p.num0 = p.num1 = 1;
  p.options.ratio = 1;
  TEST_ASSERT_EQUAL_INT(0, check(&p));
  descriptors1[0] = 179;
  TEST_ASSERT_EQUAL_INT(1, check(&p));
}

static void test_a_keypoint_outside_the_lens_is_not_matched(void) {
  tv_camera camera = make_camera(TV_CAMERA_BROWN_CONRADY);
  const double E[9] = {0, 0, 0, 0, 0, -1, 0, 1, 0};
  problem p;
  /* With k1 alone, the lens's valid region ends 346 pixels from the centre (520 undistorted). */
  camera.k[1] = camera.k[2] = camera.k[3] = 0;
  camera.cy = 0; /* both pixels lie on the same epipolar line, the row y = 0 */
  p = make_problem(&camera, &camera, E);
  memset(descriptors0, 0, sizeof descriptors0);
  memset(descriptors1, 0, sizeof descriptors1);
  set_pixel(&keypoints0[0], 300, 0);
  set_pixel(&keypoints1[0], 280, 0);
  p.num0 = p.num1 = 1;
  TEST_ASSERT_EQUAL_INT(1, check(&p));
  set_pixel(&keypoints1[0], 5000, 0);
  TEST_ASSERT_EQUAL_INT(0, check(&p));
}

static void test_nothing_matches_at_the_epipoles_or_with_a_zero_matrix(void) {
  const tv_camera camera = make_camera(TV_CAMERA_PINHOLE);
  const double forward[9] = {0, -1, 0, 1, 0, 0, 0, 0, 0}, zero[9] = {0};
  problem p = make_problem(&camera, &camera, forward);
  memset(descriptors0, 0, sizeof descriptors0);
  memset(descriptors1, 0, sizeof descriptors1);
  set_pixel(&keypoints0[0], camera.cx, camera.cy);
  set_pixel(&keypoints1[0], camera.cx, camera.cy);
  p.num0 = p.num1 = 1;
  p.options.max_error_px = 1000;
  TEST_ASSERT_EQUAL_INT(0, check(&p));
  set_pixel(&keypoints0[0], 100, 100);
  set_pixel(&keypoints1[0], 90, 90);
  TEST_ASSERT_EQUAL_INT(1, check(&p));
  p.M = zero;
  TEST_ASSERT_EQUAL_INT(0, check(&p));
}

int main(void) {
  int k, status;
  make_contexts();
  UNITY_BEGIN();
  RUN_TEST(test_matches_equal_the_definition_and_swap_with_the_views);
  RUN_TEST(test_without_cameras_the_matrix_is_of_pixels);
  RUN_TEST(test_repeated_structure_is_matched_along_the_lines);
  RUN_TEST(test_what_lies_beside_the_nearest_is_no_rival);
  RUN_TEST(test_a_distance_beyond_the_largest_is_no_match);
  RUN_TEST(test_a_keypoint_outside_the_lens_is_not_matched);
  RUN_TEST(test_nothing_matches_at_the_epipoles_or_with_a_zero_matrix);
  for (k = 0; k < num_contexts; ++k) api_release(&contexts[k]);
  status = UNITY_END();
  return status;
}
