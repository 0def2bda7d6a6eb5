/* The rungs of effort of tv_reconstruct: the statuses, what a context needs for them, equal bytes,
   exchanged views, a wall that one view cannot match, and pictures that nothing can. */

#include <math.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

enum { WIDTH = 240, HEIGHT = 180, CAP = 400, RUNGS = 4, MOST = WIDTH * HEIGHT };

static uint8_t drawn[2][MOST], wall[4 * MOST];
static tv_camera camera;
static tv_view views[2];
static tv_two_view two_view;
static tv_reconstruction reconstruction;
static tv_reconstruct_options options;
static api_context a;

static tv_limits limits_of(int32_t max_effort) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = WIDTH;
  limits.max_height = HEIGHT;
  limits.max_keypoints = CAP;
  limits.max_effort = max_effort;
  return limits;
}

/* The grey level of the wall at a place in pixels of its texture; grey outside. */
static double wall_at(double x, double y) {
  const int32_t w = 2 * WIDTH, h = 2 * HEIGHT;
  const int32_t left = (int32_t)floor(x), top = (int32_t)floor(y);
  const double u = x - left, v = y - top;
  const uint8_t *p;
  if (left < 0 || top < 0 || left + 1 >= w || top + 1 >= h) return 102;
  p = wall + top * w + left;
  return (1 - v) * ((1 - u) * p[0] + u * p[1]) + v * ((1 - u) * p[w] + u * p[w + 1]);
}

/* Renders a wall at distance 1, two pictures wide, that camera 0 sees from the front; camera 1
   stands aside, turned by this angle about the vertical axis, and looks at the same place. The
   pixel is the mean of 9 x 9 rays. R and t: of x1 = R x0 + t. */
static void render_wall(uint64_t seed, double angle, double R[9], double t[3]) {
  const double c = cos(angle), s = sin(angle);
  int32_t v, x, y, k;
  api_draw(seed, wall, 2 * WIDTH, 2 * HEIGHT);
  for (v = 0; v < 2; ++v) {
    for (y = 0; y < HEIGHT; ++y) {
      for (x = 0; x < WIDTH; ++x) {
        double sum = 0;
        for (k = 0; k < 81; ++k) {
          const double px = (x + (k % 9 - 4) / 9.0 - camera.cx) / camera.fx;
          const double py = (y + (k / 9 - 4) / 9.0 - camera.cy) / camera.fy;
          double dx = px, dy = py, dz = 1, ox = 0, oz = 0, depth;
          if (v == 1) { /* the ray and the centre of camera 1 in camera 0's frame, at the middle */
            dx = c * px + s;
            dz = -s * px + c;
            ox = -s;
            oz = 1 - c;
          }
          depth = (1 - oz) / dz;
          sum += dz > 0.01 ? wall_at((ox + depth * dx) * camera.fx + WIDTH - 0.5,
                                     depth * dy * camera.fy + HEIGHT - 0.5)
                           : 102;
        }
        drawn[v][y * WIDTH + x] = (uint8_t)(sum / 81 + 0.5);
      }
    }
  }
  R[0] = R[8] = c;
  R[4] = 1;
  R[2] = -s;
  R[6] = s;
  R[1] = R[3] = R[5] = R[7] = 0;
  t[0] = s; /* -R times the centre (-s, 0, 1 - c) */
  t[1] = 0;
  t[2] = 1 - c;
}

void setUp(void) {
  const tv_limits limits = limits_of(3);
  int v;
  a = api_make(&limits);
  memset(&camera, 0, sizeof camera);
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = WIDTH;
  camera.height = HEIGHT;
  camera.fx = camera.fy = WIDTH;
  camera.cx = 0.5 * (WIDTH - 1);
  camera.cy = 0.5 * (HEIGHT - 1);
  for (v = 0; v < 2; ++v) {
    views[v] = view_of(api_image(drawn[v], WIDTH, HEIGHT, WIDTH), &camera, NULL);
  }
  tv_two_view_init(&two_view);
  tv_reconstruction_init(&reconstruction);
  tv_reconstruct_options_init(&options);
}

void tearDown(void) { api_release(&a); }

static tv_status run_in(tv_context *context, int32_t effort, int32_t max_effort) {
  options.effort = effort;
  options.max_effort = max_effort;
  return tv_reconstruct(context, &views[0], &views[1], &options, &two_view, NULL, &reconstruction);
}

static void run(int32_t effort, int32_t max_effort) {
  TEST_ASSERT_EQUAL_INT(TV_OK, run_in(a.context, effort, max_effort));
}

static uint64_t hash(uint64_t h, const void *data, size_t bytes) {
  const uint8_t *p = (const uint8_t *)data;
  size_t k;
  for (k = 0; k < bytes; ++k) h = (h ^ p[k]) * 0x100000001b3u;
  return h;
}

static uint64_t hash_of_result(void) {
  uint64_t h = hash(0xcbf29ce484222325u, two_view.R, sizeof two_view.R);
  int v;
  h = hash(h, &two_view.verdict, sizeof two_view.verdict);
  h = hash(h, &two_view.probability_wrong, sizeof two_view.probability_wrong);
  h = hash(h, two_view.covariance, sizeof two_view.covariance);
  for (v = 0; v < 2; ++v) {
    const size_t n = (size_t)reconstruction.num_keypoints[v];
    h = hash(h, reconstruction.keypoints[v], n * sizeof(tv_keypoint));
    h = hash(h, reconstruction.descriptors[v], n * TV_DESCRIPTOR_BYTES);
    if (reconstruction.tilts[v] != NULL) h = hash(h, reconstruction.tilts[v], n);
  }
  h = hash(h, reconstruction.matches,
           (size_t)reconstruction.num_matches * sizeof(tv_correspondence));
  return hash(h, reconstruction.points, (size_t)reconstruction.num_points * sizeof(tv_point));
}

static double turn_between(const double A[9], const double B[9]) {
  double sum = 0;
  int k;
  for (k = 0; k < 9; ++k) sum += (A[k] - B[k]) * (A[k] - B[k]);
  return 2 * asin(sqrt(sum / 8) < 1 ? sqrt(sum / 8) : 1);
}

static void test_an_effort_out_of_its_range_is_refused(void) {
  int32_t k;
  tv_limits limits = limits_of(4);
  size_t bytes = 7;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_context_size(&limits, &bytes));
  limits.max_effort = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_context_size(&limits, &bytes));
  TEST_ASSERT_TRUE(bytes == 7);
  for (k = 0; k < 2; ++k) {
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, run_in(a.context, k == 0 ? -1 : 4, 0));
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, run_in(a.context, 0, k == 0 ? -1 : 4));
  }
}

static void test_limits_too_small_for_the_rung_have_a_status_of_their_own(void) {
  int32_t made_for, rung;
  for (made_for = 0; made_for < RUNGS; ++made_for) {
    const tv_limits limits = limits_of(made_for);
    api_context b = api_make(&limits);
    for (rung = 0; rung < RUNGS; ++rung) {
      const tv_status expected = rung <= made_for ? TV_OK : TV_ERR_EFFORT;
      TEST_ASSERT_EQUAL_INT(expected, run_in(b.context, rung, 0));
      TEST_ASSERT_EQUAL_INT(expected, run_in(b.context, 0, rung));
    }
    api_release(&b);
  }
  TEST_ASSERT_NOT_NULL(strstr(tv_status_string(TV_ERR_EFFORT), "max_effort"));
}

static size_t bytes_of(int32_t width, int32_t height, int32_t keypoints, int32_t max_effort,
                       uint32_t purposes) {
  tv_limits limits;
  size_t bytes = 0;
  tv_limits_init(&limits);
  limits.max_width = width;
  limits.max_height = height;
  limits.max_keypoints = keypoints;
  limits.max_effort = max_effort;
  limits.purposes = purposes;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &bytes));
  return bytes;
}

static void test_memory_is_known_beforehand_and_rung_3_takes_16_mib_at_most_at_vga(void) {
  int32_t rung;
  for (rung = 1; rung < RUNGS; ++rung) {
    TEST_ASSERT_TRUE(bytes_of(640, 480, 2048, rung, 0) >= bytes_of(640, 480, 2048, rung - 1, 0));
  }
  TEST_ASSERT_TRUE(bytes_of(640, 480, 2048, 3, TV_PURPOSE_RECONSTRUCT) <= 16u << 20);
  /* Without tv_reconstruct there are no rungs. */
  TEST_ASSERT_TRUE(bytes_of(640, 480, 2048, 3, TV_PURPOSE_MATCH) ==
                   bytes_of(640, 480, 2048, 0, TV_PURPOSE_MATCH));
  TEST_ASSERT_TRUE(bytes_of(16384, 16384, 65535, 3, TV_PURPOSE_RECONSTRUCT) > 0);
}

/* Of large pictures with few keypoints the extraction needs most, and nothing is left over from
   other stages: a byte that the size query forgets is a null pointer then. */
static void test_large_pictures_have_memory_on_the_highest_rung(void) {
  enum { WIDE = 740, HIGH = 1290, FEW = 2000 };
  static uint8_t large[2][WIDE * HIGH];
  tv_camera of_large = camera;
  tv_limits limits = limits_of(3);
  api_context b;
  int32_t v;
  of_large.width = limits.max_width = WIDE;
  of_large.height = limits.max_height = HIGH;
  limits.max_keypoints = FEW;
  limits.purposes = TV_PURPOSE_RECONSTRUCT;
  b = api_make(&limits);
  for (v = 0; v < 2; ++v) {
    api_draw(50, large[v], WIDE, HIGH);
    views[v] = view_of(api_image(large[v], WIDE, HIGH, WIDE), &of_large, NULL);
  }
  memmove(large[1], large[1] + 20, sizeof large[1] - 20);
  TEST_ASSERT_EQUAL_INT(TV_OK, run_in(b.context, 3, 0));
  TEST_ASSERT_TRUE(reconstruction.num_keypoints[0] > FEW);
  api_release(&b);
}

static void test_a_rung_of_0_gives_what_a_context_without_effort_gives(void) {
  const tv_limits limits = limits_of(0);
  api_context b = api_make(&limits);
  double R[9], t[3];
  uint64_t first;
  render_wall(1, 0.2, R, t);
  TEST_ASSERT_EQUAL_INT(TV_OK, run_in(b.context, 0, 0));
  first = hash_of_result();
  run(0, 0);
  TEST_ASSERT_EQUAL_INT(0, reconstruction.effort);
  TEST_ASSERT_EQUAL_INT(1, reconstruction.num_rungs);
  /* Only the tilts, which the other context has no room for, are new: all are 0. */
  TEST_ASSERT_TRUE(reconstruction.tilts[0] != NULL);
  TEST_ASSERT_EQUAL_INT(0, reconstruction.tilts[0][0]);
  reconstruction.tilts[0] = reconstruction.tilts[1] = NULL;
  TEST_ASSERT_TRUE(first == hash_of_result());
  api_release(&b);
}

/* A turn of 72 degrees shortens the wall to a third. */
static void test_a_wall_at_a_slant_is_matched_in_squeezed_views(void) {
  double R[9], t[3];
  int32_t inliers[RUNGS], rung, k, from_views = 0;
  render_wall(2, 1.25, R, t);
  for (rung = 0; rung < RUNGS; ++rung) {
    run(rung, 0);
    TEST_ASSERT_EQUAL_INT(rung, reconstruction.effort);
    inliers[rung] = two_view.has_R ? two_view.num_inliers : 0;
  }
  TEST_ASSERT_TRUE(inliers[0] < 15);
  TEST_ASSERT_TRUE(inliers[2] >= 15);
  TEST_ASSERT_TRUE(inliers[3] >= 30);
  TEST_ASSERT_TRUE(turn_between(R, two_view.R) < 0.02 ||
                   (two_view.has_alternative && turn_between(R, two_view.alternative_R) < 0.02));
  for (k = 0; k < reconstruction.num_matches; ++k) {
    from_views += reconstruction.inlier_mask[k] != 0 &&
                  reconstruction.tilts[0][reconstruction.matches[k].idx0] != 0;
  }
  TEST_ASSERT_TRUE(from_views > 10);
  /* The ladder climbs to it by itself. */
  run(0, 3);
  TEST_ASSERT_TRUE(reconstruction.effort >= 2);
  TEST_ASSERT_TRUE(reconstruction.num_rungs == reconstruction.effort);
  TEST_ASSERT_TRUE(two_view.num_inliers >= 15);
}

/* A stair of three depths, seen from aside. */
static void draw_stair(uint64_t seed) {
  int32_t x, y;
  api_draw(seed, drawn[0], WIDTH, HEIGHT);
  for (y = 0; y < HEIGHT; ++y) {
    const int32_t shift = 4 + 4 * (3 * y / HEIGHT) + 3 * (y / 20 % 3);
    for (x = 0; x < WIDTH; ++x) {
      drawn[1][y * WIDTH + x] = drawn[0][y * WIDTH + (x + shift < WIDTH ? x + shift : WIDTH - 1)];
    }
  }
}

static void require_one_match_a_place(void) {
  int32_t j, k;
  for (k = 0; k < reconstruction.num_matches; ++k) {
    const tv_correspondence *m = &reconstruction.matches[k];
    const tv_keypoint *p = &reconstruction.keypoints[0][m->idx0];
    const tv_keypoint *q = &reconstruction.keypoints[1][m->idx1];
    for (j = 0; j < k; ++j) {
      const tv_keypoint *p1 = &reconstruction.keypoints[0][reconstruction.matches[j].idx0];
      const tv_keypoint *q1 = &reconstruction.keypoints[1][reconstruction.matches[j].idx1];
      TEST_ASSERT_FALSE(fabsf(p->x - p1->x) < 2 && fabsf(p->y - p1->y) < 2 &&
                        fabsf(q->x - q1->x) < 2 && fabsf(q->y - q1->y) < 2);
    }
  }
}

static void test_no_two_matches_of_squeezed_views_are_of_one_place(void) {
  double R[9], t[3];
  int32_t rung;
  render_wall(3, 0.6, R, t);
  for (rung = 2; rung < RUNGS; ++rung) {
    run(rung, 0);
    TEST_ASSERT_TRUE(reconstruction.num_matches > 50);
    require_one_match_a_place();
  }
}

/* Guided matching finds again, in other views, the places that are matched already. */
static void test_guided_matches_of_squeezed_views_are_of_further_places(void) {
  int32_t rung, num_matches;
  draw_stair(7);
  for (rung = 2; rung < RUNGS; ++rung) {
    options.guided_matching = 0;
    run(rung, 0);
    num_matches = reconstruction.num_matches;
    options.guided_matching = 1;
    run(rung, 0);
    TEST_ASSERT_TRUE(reconstruction.num_matches > num_matches);
    require_one_match_a_place();
  }
}

static void test_an_easy_pair_is_left_at_rung_0(void) {
  const tv_limits limits = limits_of(0);
  api_context b = api_make(&limits);
  uint64_t first;
  draw_stair(4);
  TEST_ASSERT_EQUAL_INT(TV_OK, run_in(b.context, 0, 0));
  TEST_ASSERT_EQUAL_INT(TV_VERDICT_OK, two_view.verdict);
  reconstruction.tilts[0] = reconstruction.tilts[1] = NULL;
  first = hash_of_result();
  run(0, 3);
  TEST_ASSERT_EQUAL_INT(0, reconstruction.effort);
  TEST_ASSERT_EQUAL_INT(1, reconstruction.num_rungs);
  reconstruction.tilts[0] = reconstruction.tilts[1] = NULL;
  TEST_ASSERT_TRUE(first == hash_of_result());
  api_release(&b);
}

static void test_every_kernel_set_gives_the_same_bytes_on_every_rung(void) {
  double R[9], t[3];
  api_context contexts[6];
  const int count = api_make_all_kernels(limits_of(3), contexts);
  int32_t rung;
  int k;
  render_wall(5, 0.9, R, t);
  for (rung = 1; rung < RUNGS; ++rung) {
    uint64_t first = 0;
    for (k = 0; k < count; ++k) {
      TEST_ASSERT_EQUAL_INT(TV_OK, run_in(contexts[k].context, rung, 0));
      if (k == 0) first = hash_of_result();
      TEST_ASSERT_TRUE(first == hash_of_result());
    }
  }
  for (k = 0; k < count; ++k) api_release(&contexts[k]);
}

static void test_exchanged_views_give_the_inverse_pose_on_every_rung(void) {
  double R[9], t[3];
  int32_t rung;
  int i, j;
  render_wall(6, 0.9, R, t);
  for (rung = 1; rung < RUNGS; ++rung) {
    tv_two_view first;
    int32_t num_matches;
    tv_view other = views[0];
    run(rung, 0);
    TEST_ASSERT_TRUE(two_view.has_R);
    first = two_view;
    num_matches = reconstruction.num_matches;
    views[0] = views[1];
    views[1] = other;
    run(rung, 0);
    TEST_ASSERT_EQUAL_INT(first.verdict, two_view.verdict);
    TEST_ASSERT_EQUAL_INT(first.num_inliers, two_view.num_inliers);
    TEST_ASSERT_EQUAL_INT(num_matches, reconstruction.num_matches);
    TEST_ASSERT_TRUE(first.probability_wrong == two_view.probability_wrong);
    for (i = 0; i < 3; ++i) {
      for (j = 0; j < 3; ++j) TEST_ASSERT_TRUE(first.R[3 * i + j] == two_view.R[3 * j + i]);
    }
  }
}

/* The next rung counts as a further trial: the same matches are then believed the less. */
static void test_a_later_trial_is_believed_less(void) {
  tv_estimate_options estimate;
  double R[9], t[3], first;
  tv_estimate_options_init(&estimate);
  options.estimate = &estimate;
  render_wall(7, 0.3, R, t);
  run(0, 0);
  first = two_view.probability_wrong;
  TEST_ASSERT_TRUE(first > 0 && first < 1);
  estimate.num_trials = 1;
  run(0, 0);
  TEST_ASSERT_TRUE(two_view.probability_wrong == first);
  estimate.num_trials = 3;
  run(0, 0);
  if (two_view.probability_wrong != 0.5) { /* which descriptors may raise it to */
    const double odds = first / (1 - first), later = two_view.probability_wrong;
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 3 * odds, later / (1 - later));
  }
  estimate.num_trials = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, run_in(a.context, 0, 0));
}

/* A rung that was climbed to is what the same rung gives as the trial that it is. */
static void test_a_rung_that_was_climbed_to_is_a_later_trial(void) {
  tv_estimate_options estimate;
  double R[9], t[3];
  int32_t rungs;
  uint64_t climbed;
  tv_estimate_options_init(&estimate);
  render_wall(2, 1.25, R, t);
  run(0, 2);
  rungs = reconstruction.num_rungs;
  climbed = hash_of_result();
  TEST_ASSERT_EQUAL_INT(2, rungs);
  options.estimate = &estimate;
  estimate.num_trials = rungs;
  run(2, 0);
  TEST_ASSERT_TRUE(climbed == hash_of_result());
}

static void test_shapes_are_of_the_keypoints_views(void) {
  double R[9], t[3];
  static double shapes[4 * 7 * CAP];
  int32_t k, slim = 0;
  render_wall(8, 0.9, R, t);
  run(3, 0);
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_keypoint_shapes(reconstruction.keypoints[0], reconstruction.tilts[0],
                                           reconstruction.num_keypoints[0], shapes));
  for (k = 0; k < reconstruction.num_keypoints[0]; ++k) {
    const double *s = shapes + 4 * k, size = reconstruction.keypoints[0][k].size;
    const double sum = s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + s[3] * s[3];
    TEST_ASSERT_DOUBLE_WITHIN(1e-3 * size * size, size * size, s[0] * s[3] - s[1] * s[2]);
    slim += sum > 2.01 * size * size; /* 2 for a circle, tilt + 1 / tilt for an ellipse */
    TEST_ASSERT_TRUE((sum > 2.01 * size * size) == (reconstruction.tilts[0][k] != 0));
  }
  TEST_ASSERT_TRUE(slim > CAP);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_keypoint_shapes(reconstruction.keypoints[0], NULL, 5, shapes));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_keypoint_shapes(NULL, NULL, 0, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_keypoint_shapes(NULL, NULL, 1, shapes));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_keypoint_shapes(reconstruction.keypoints[0], NULL, -1, shapes));
  {
    uint8_t unknown = 17;
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                          tv_keypoint_shapes(reconstruction.keypoints[0], &unknown, 1, shapes));
  }
  memcpy(shapes, reconstruction.keypoints[0], sizeof(tv_keypoint));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_OVERLAP,
      tv_keypoint_shapes((const tv_keypoint *)(const void *)shapes, NULL, 1, shapes));
}

static void fill(int v, int32_t kind, uint64_t seed) {
  int32_t x, y;
  for (y = 0; y < HEIGHT; ++y) {
    for (x = 0; x < WIDTH; ++x) {
      drawn[v][y * WIDTH + x] = (uint8_t)(kind == 0 ? 128 : (x / 4 + v) % 2 * 200 + 20);
    }
  }
  if (kind == 2) api_draw(seed, drawn[v], WIDTH, HEIGHT);
}

static void test_pictures_that_show_nothing_end_at_rung_0(void) {
  int32_t kind;
  for (kind = 0; kind < 2; ++kind) { /* blank, striped */
    fill(0, kind, 0);
    fill(1, kind, 0);
    run(0, 3);
    TEST_ASSERT_TRUE(two_view.verdict != TV_VERDICT_OK);
    TEST_ASSERT_EQUAL_INT(1, reconstruction.num_rungs);
    run(3, 3);
    TEST_ASSERT_TRUE(two_view.verdict != TV_VERDICT_OK);
  }
}

static void test_equal_pictures_end_at_rung_0_without_motion(void) {
  fill(0, 2, 9);
  memcpy(drawn[1], drawn[0], sizeof drawn[0]);
  run(0, 3);
  TEST_ASSERT_EQUAL_INT(TV_KIND_NO_MOTION, two_view.kind);
  TEST_ASSERT_EQUAL_INT(1, reconstruction.num_rungs);
  run(3, 0);
  TEST_ASSERT_EQUAL_INT(TV_KIND_NO_MOTION, two_view.kind);
}

static void test_unrelated_and_mirrored_pictures_are_never_ok(void) {
  uint64_t seed;
  int32_t rung, x, y;
  for (seed = 20; seed < 23; ++seed) {
    fill(0, 2, seed);
    fill(1, 2, seed + 100);
    for (rung = 0; rung < RUNGS; ++rung) {
      run(rung, 0);
      TEST_ASSERT_TRUE(two_view.verdict != TV_VERDICT_OK);
    }
    for (y = 0; y < HEIGHT; ++y) {
      for (x = 0; x < WIDTH; ++x) {
        drawn[1][y * WIDTH + x] = drawn[0][y * WIDTH + WIDTH - 1 - x];
      }
    }
    run(0, 3);
    TEST_ASSERT_TRUE(two_view.verdict != TV_VERDICT_OK);
  }
}

static void test_tiny_and_thin_pictures_have_few_views(void) {
  const int32_t sizes[][2] = {{40, 30}, {1, 1}, {7, 180}, {240, 7}, {25, 25}};
  size_t k;
  int32_t rung;
  fill(0, 2, 30);
  fill(1, 2, 31);
  for (k = 0; k < sizeof sizes / sizeof sizes[0]; ++k) {
    tv_camera small = camera;
    int v;
    small.width = sizes[k][0];
    small.height = sizes[k][1];
    for (v = 0; v < 2; ++v) {
      views[v].image = api_image(drawn[v], sizes[k][0], sizes[k][1], WIDTH);
      views[v].camera = &small;
    }
    for (rung = 0; rung < RUNGS; ++rung) {
      run(rung, 3);
      TEST_ASSERT_TRUE(two_view.verdict != TV_VERDICT_OK);
    }
  }
}

static void test_masked_places_have_no_keypoint_in_any_view(void) {
  static uint8_t mask[MOST];
  const tv_image of_mask = api_image(mask, WIDTH, HEIGHT, WIDTH);
  int32_t k, y;
  fill(0, 2, 40);
  fill(1, 2, 41);
  for (y = 0; y < HEIGHT; ++y) memset(mask + y * WIDTH, 1, WIDTH / 2);
  views[0].mask = &of_mask;
  run(3, 0);
  TEST_ASSERT_TRUE(reconstruction.num_keypoints[0] > CAP);
  for (k = 0; k < reconstruction.num_keypoints[0]; ++k) {
    /* A corner of the last level may be refined by 1.41^3 pixels along x, in a view more. */
    TEST_ASSERT_TRUE(reconstruction.keypoints[0][k].x < WIDTH / 2 + 12);
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_an_effort_out_of_its_range_is_refused);
  RUN_TEST(test_limits_too_small_for_the_rung_have_a_status_of_their_own);
  RUN_TEST(test_memory_is_known_beforehand_and_rung_3_takes_16_mib_at_most_at_vga);
  RUN_TEST(test_large_pictures_have_memory_on_the_highest_rung);
  RUN_TEST(test_a_rung_of_0_gives_what_a_context_without_effort_gives);
  RUN_TEST(test_a_wall_at_a_slant_is_matched_in_squeezed_views);
  RUN_TEST(test_no_two_matches_of_squeezed_views_are_of_one_place);
  RUN_TEST(test_guided_matches_of_squeezed_views_are_of_further_places);
  RUN_TEST(test_an_easy_pair_is_left_at_rung_0);
  RUN_TEST(test_every_kernel_set_gives_the_same_bytes_on_every_rung);
  RUN_TEST(test_exchanged_views_give_the_inverse_pose_on_every_rung);
  RUN_TEST(test_a_later_trial_is_believed_less);
  RUN_TEST(test_a_rung_that_was_climbed_to_is_a_later_trial);
  RUN_TEST(test_shapes_are_of_the_keypoints_views);
  RUN_TEST(test_pictures_that_show_nothing_end_at_rung_0);
  RUN_TEST(test_equal_pictures_end_at_rung_0_without_motion);
  RUN_TEST(test_unrelated_and_mirrored_pictures_are_never_ok);
  RUN_TEST(test_tiny_and_thin_pictures_have_few_views);
  RUN_TEST(test_masked_places_have_no_keypoint_in_any_view);
  return UNITY_END();
}
