/* Limits: a call for which the context was not made is refused; if there are more matches than
   fit, those of the lowest ratio are kept; and null options mean the same as initialised ones. */

#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

enum { WIDTH = 200, HEIGHT = 150, CAP = 300 };

static uint8_t drawn[2][WIDTH * HEIGHT];
static tv_camera camera;
static tv_view views[2];

/* The second image is the first one moved sideways, its lower half by twice as much. */
void setUp(void) {
  int v, x, y;
  api_draw(81, drawn[0], WIDTH, HEIGHT);
  for (y = 0; y < HEIGHT; ++y) {
    const int shift = y < HEIGHT / 2 ? 6 : 12;
    for (x = 0; x < WIDTH; ++x) {
      drawn[1][y * WIDTH + x] = drawn[0][y * WIDTH + (x + shift < WIDTH ? x + shift : WIDTH - 1)];
    }
  }
  memset(&camera, 0, sizeof camera);
  camera.width = WIDTH;
  camera.height = HEIGHT;
  camera.fx = camera.fy = WIDTH;
  camera.cx = 0.5 * (WIDTH - 1);
  camera.cy = 0.5 * (HEIGHT - 1);
  for (v = 0; v < 2; ++v) {
    views[v] = view_of(api_image(drawn[v], WIDTH, HEIGHT, WIDTH), &camera, NULL);
  }
}

void tearDown(void) {}

static api_context make(int32_t max_keypoints, int32_t max_matches, uint32_t purposes) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = WIDTH;
  limits.max_height = HEIGHT;
  limits.max_keypoints = max_keypoints;
  limits.max_matches = max_matches;
  limits.purposes = purposes;
  return api_make(&limits);
}

typedef struct outcome {
  tv_two_view two_view;
  tv_reconstruction cloud;
} outcome;

static tv_status run(tv_context *context, int first, const tv_reconstruct_options *options,
                     outcome *o) {
  tv_two_view_init(&o->two_view);
  tv_reconstruction_init(&o->cloud);
  return tv_reconstruct(context, &views[first], &views[1 - first], options, &o->two_view, NULL,
                        &o->cloud);
}

/* Makes every call that uses a context's memory, with valid arguments. Returns a bit for each
   call: 1 when its status is TV_OK. */
static uint32_t calls_that_work(tv_context *context) {
  static tv_keypoint keypoints[CAP];
  static uint8_t descriptors[CAP * TV_DESCRIPTOR_BYTES];
  static tv_correspondence matches[CAP];
  static const double E[9] = {0, 0, 0, 0, 0, -1, 0, 1, 0};
  static const double R[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, t[3] = {1, 0, 0};
  tv_camera_pair pair = pair_of(&camera, &camera, R, t);
  tv_reconstruct_options options;
  outcome o;
  int32_t count = 0, k = 0, c;
  tv_status status[11];
  uint32_t worked = 0;
  tv_reconstruct_options_init(&options);
  status[k++] = tv_detect(context, &views[0].image, NULL, NULL, keypoints, CAP, &count);
  status[k++] = tv_orient(context, &views[0].image, keypoints, 0, NULL, keypoints, 0, &count);
  status[k++] = tv_describe(context, &views[0].image, keypoints, 0, NULL, descriptors);
  status[k++] =
      tv_extract(context, &views[0].image, NULL, NULL, keypoints, descriptors, CAP, &count);
  status[k++] = match_rows(context, descriptors, 9, descriptors, 9, NULL, matches, CAP, &count);
  status[k++] = match_rows_guided(context, NULL, NULL, E, keypoints, descriptors, 0, keypoints,
                                  descriptors, 0, NULL, matches, CAP, &count);
  tv_two_view_init(&o.two_view);
  status[k++] =
      estimate_pixels(context, &camera, &camera, NULL, NULL, NULL, 0, NULL, &o.two_view, NULL);
  status[k++] = adjust_pixels(context, NULL, NULL, 0, NULL, &pair, NULL, NULL);
  status[k++] = run(context, 0, &options, &o);
  options.guided_matching = 1;
  status[k++] = run(context, 0, &options, &o);
  options.guided_matching = 0;
  options.bundle_adjustment = 1;
  status[k++] = run(context, 0, &options, &o);
  for (c = 0; c < k; ++c) {
    TEST_ASSERT_TRUE(status[c] == TV_OK || status[c] == TV_ERR_LIMITS);
    worked |= (uint32_t)(status[c] == TV_OK) << c;
  }
  return worked;
}

static void test_a_context_serves_its_purposes_alone(void) {
  static const struct {
    uint32_t purposes, calls;
  } cases[] = {{0, 0x7ff},
               {TV_PURPOSE_EXTRACT, 0x00f},
               {TV_PURPOSE_MATCH, 0x010},
               {TV_PURPOSE_MATCH_GUIDED, 0x020},
               {TV_PURPOSE_ESTIMATE, 0x040},
               {TV_PURPOSE_ADJUST, 0x080},
               {TV_PURPOSE_RECONSTRUCT, 0x15f},
               {TV_PURPOSE_RECONSTRUCT | TV_PURPOSE_MATCH_GUIDED, 0x37f},
               {TV_PURPOSE_RECONSTRUCT | TV_PURPOSE_ADJUST, 0x5df},
               {TV_PURPOSE_EXTRACT | TV_PURPOSE_MATCH, 0x01f}};
  size_t k;
  for (k = 0; k < sizeof cases / sizeof cases[0]; ++k) {
    api_context a = make(CAP, 0, cases[k].purposes);
    TEST_ASSERT_EQUAL_HEX32(cases[k].calls, calls_that_work(a.context));
    api_release(&a);
  }
}

/* In a context with room for few matches, both orders of the views must keep the same matches,
   and these must be the best of those that a context with room for all finds. */
static void test_the_best_matches_are_kept_whichever_view_is_first(void) {
  static const int32_t rooms[] = {1, 2, 7, 20, 50, 299};
  tv_reconstruct_options options;
  size_t k;
  int32_t i, j, guided;
  tv_reconstruct_options_init(&options);
  for (guided = 0; guided < 2; ++guided) {
    api_context all = make(CAP, CAP, 0);
    outcome full;
    options.guided_matching = guided;
    /* The upper and lower halves of the image are swapped, so that corners of equal score come in
       another order. */
    if (guided == 0) {
      memcpy(drawn[1], drawn[0] + sizeof drawn[0] / 2, sizeof drawn[0] / 2);
      memcpy(drawn[1] + sizeof drawn[0] / 2, drawn[0], sizeof drawn[0] / 2);
    } else {
      setUp();
    }
    TEST_ASSERT_EQUAL_INT(TV_OK, run(all.context, 0, &options, &full));
    TEST_ASSERT_EQUAL_INT(0, full.cloud.num_matches_left_out);
    TEST_ASSERT_TRUE(full.cloud.num_matches > 60);
    for (k = 0; k < sizeof rooms / sizeof rooms[0]; ++k) {
      api_context a = make(CAP, rooms[k], 0), b = make(CAP, rooms[k], 0);
      outcome kept, swapped;
      TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context, 0, &options, &kept));
      TEST_ASSERT_EQUAL_INT(TV_OK, run(b.context, 1, &options, &swapped));
      TEST_ASSERT_TRUE(kept.cloud.num_matches <= rooms[k]);
      TEST_ASSERT_EQUAL_INT(kept.cloud.num_matches, kept.two_view.num_matches);
      TEST_ASSERT_EQUAL_INT(kept.cloud.num_matches, swapped.cloud.num_matches);
      TEST_ASSERT_EQUAL_INT(kept.cloud.num_matches_left_out, swapped.cloud.num_matches_left_out);
      for (i = 0; i < kept.cloud.num_matches; ++i) {
        const tv_correspondence *m = &kept.cloud.matches[i];
        int32_t found = 0;
        TEST_ASSERT_TRUE(i == 0 || m->idx0 > m[-1].idx0);
        for (j = 0; j < swapped.cloud.num_matches; ++j) {
          const tv_correspondence *s = &swapped.cloud.matches[j];
          found += s->idx0 == m->idx1 && s->idx1 == m->idx0 && s->ratio == m->ratio;
        }
        TEST_ASSERT_EQUAL_INT(1, found);
      }
      if (guided == 0) {
        int32_t better = 0, as_good = 0;
        float worst = 0;
        TEST_ASSERT_EQUAL_INT(full.cloud.num_matches,
                              kept.cloud.num_matches + kept.cloud.num_matches_left_out);
        for (i = 0; i < kept.cloud.num_matches; ++i) {
          if (kept.cloud.matches[i].ratio > worst) worst = kept.cloud.matches[i].ratio;
        }
        for (i = 0; i < full.cloud.num_matches; ++i) {
          better += full.cloud.matches[i].ratio < worst;
          as_good += full.cloud.matches[i].ratio <= worst;
        }
        /* At most one place stays empty, where two matches of equal rank compete for it. */
        TEST_ASSERT_TRUE(better <= kept.cloud.num_matches && kept.cloud.num_matches <= as_good);
        TEST_ASSERT_TRUE(kept.cloud.num_matches_left_out == 0 ||
                         kept.cloud.num_matches >= rooms[k] - 1);
      }
      api_release(&a);
      api_release(&b);
    }
    api_release(&all);
  }
}

/* The images are identical, so every ratio is 0 and every match is (i, i). */
static void test_equal_ratios_leave_the_weaker_keypoints_out(void) {
  api_context a = make(CAP, 20, 0);
  outcome o;
  int32_t k;
  memcpy(drawn[1], drawn[0], sizeof drawn[0]);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context, 0, NULL, &o));
  TEST_ASSERT_EQUAL_INT(20, o.cloud.num_matches);
  TEST_ASSERT_TRUE(o.cloud.num_matches_left_out > 0);
  for (k = 0; k < 20; ++k) TEST_ASSERT_EQUAL_FLOAT(0, o.cloud.matches[k].ratio);
  TEST_ASSERT_TRUE(o.cloud.matches[19].idx0 < CAP / 2);
  api_release(&a);
}

typedef struct stage_results {
  int32_t num_detected, num_extracted[2], num_oriented, num_matches, num_guided;
  tv_keypoint detected[2100], oriented[2100], keypoints[2][2100];
  uint8_t described[2100 * TV_DESCRIPTOR_BYTES], descriptors[2][2100 * TV_DESCRIPTOR_BYTES];
  tv_correspondence matches[2100], guided[2100];
  tv_two_view estimate, whole;
  tv_bundle_result bundle;
  double R[9], t[3];
} stage_results;

/* Runs every call that takes options, and collects the outputs. */
static void run_stages(tv_context *context, const tv_camera *lens, int initialised,
                       stage_results *r) {
  tv_camera_pair pair;
  enum { ROOM = 2100 };
  static double pixels[2][2 * ROOM];
  static tv_point points[ROOM];
  tv_feature_options feature;
  tv_match_options match;
  tv_guided_options guided;
  tv_estimate_options estimate;
  tv_bundle_options bundle;
  tv_reconstruct_options all;
  const tv_feature_options *f = initialised ? &feature : NULL;
  const double E[9] = {0, 0, 0, 0, 0, -1, 0, 1, 0};
  tv_reconstruction cloud;
  int32_t v, k;
  memset(r, 0, sizeof *r);
  tv_feature_options_init(&feature);
  tv_match_options_init(&match);
  tv_guided_options_init(&guided);
  tv_estimate_options_init(&estimate);
  tv_bundle_options_init(&bundle);
  tv_reconstruct_options_init(&all);
  all.feature = &feature;
  all.match = &match;
  all.estimate = &estimate;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_detect(context, &views[0].image, NULL, f, r->detected, ROOM, &r->num_detected));
  for (v = 0; v < 2; ++v) {
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_extract(context, &views[v].image, NULL, f, r->keypoints[v],
                                            r->descriptors[v], ROOM, &r->num_extracted[v]));
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_orient(context, &views[0].image, r->detected, r->num_detected, f,
                                         r->oriented, ROOM, &r->num_oriented));
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_describe(context, &views[0].image, r->detected, r->num_detected, f, r->described));
  TEST_ASSERT_EQUAL_INT(
      TV_OK, match_rows(context, r->descriptors[0], r->num_extracted[0], r->descriptors[1],
                        r->num_extracted[1], initialised ? &match : NULL, r->matches, ROOM,
                        &r->num_matches));
  TEST_ASSERT_EQUAL_INT(
      TV_OK, match_rows_guided(context, lens, lens, E, r->keypoints[0], r->descriptors[0],
                               r->num_extracted[0], r->keypoints[1], r->descriptors[1],
                               r->num_extracted[1], initialised ? &guided : NULL, r->guided, ROOM,
                               &r->num_guided));
  for (k = 0; k < r->num_matches; ++k) {
    pixels[0][2 * k] = r->keypoints[0][r->matches[k].idx0].x;
    pixels[0][2 * k + 1] = r->keypoints[0][r->matches[k].idx0].y;
    pixels[1][2 * k] = r->keypoints[1][r->matches[k].idx1].x;
    pixels[1][2 * k + 1] = r->keypoints[1][r->matches[k].idx1].y;
  }
  tv_two_view_init(&r->estimate);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, estimate_pixels(context, lens, lens, pixels[0], pixels[1], NULL, r->num_matches,
                             initialised ? &estimate : NULL, &r->estimate, NULL));
  tv_two_view_init(&r->whole);
  tv_reconstruction_init(&cloud);
  views[0].camera = views[1].camera = lens;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(context, &views[0], &views[1],
                                              initialised ? &all : NULL, &r->whole, NULL, &cloud));
  r->R[0] = r->R[4] = r->R[8] = r->t[0] = 1;
  pair = pair_of(&camera, &camera, r->R, r->t);
  memset(points, 0, sizeof points);
  TEST_ASSERT_EQUAL_INT(TV_OK, triangulate_pixels(&pair, pixels[0], pixels[1], r->num_matches,
                                                  TV_TRIANGULATION_LINEAR_LS, points));
  tv_bundle_result_init(&r->bundle);
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        adjust_pixels(context, pixels[0], pixels[1], r->num_matches,
                                      initialised ? &bundle : NULL, &pair, points, &r->bundle));
  memcpy(r->R, pair.cam1_from_cam0_R, sizeof r->R);
  memcpy(r->t, pair.cam1_from_cam0_t, sizeof r->t);
}

static void test_null_options_mean_initialised_ones(void) {
  static const int32_t sizes[] = {1, 60, 1500, 2048, 2100};
  static stage_results with_null, initialised;
  size_t k;
  int calibrated;
  for (k = 0; k < sizeof sizes / sizeof sizes[0]; ++k) {
    api_context a = make(sizes[k], 0, 0);
    for (calibrated = 0; calibrated < 2; ++calibrated) {
      const tv_camera *lens = calibrated ? &camera : NULL;
      run_stages(a.context, lens, 0, &with_null);
      run_stages(a.context, lens, 1, &initialised);
      TEST_ASSERT_EQUAL_MEMORY(&with_null, &initialised, sizeof with_null);
      TEST_ASSERT_TRUE(sizes[k] == 1 || with_null.num_matches > 10);
    }
    api_release(&a);
  }
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_context_serves_its_purposes_alone);
  RUN_TEST(test_the_best_matches_are_kept_whichever_view_is_first);
  RUN_TEST(test_equal_ratios_leave_the_weaker_keypoints_out);
  RUN_TEST(test_null_options_mean_initialised_ones);
  return UNITY_END();
}
