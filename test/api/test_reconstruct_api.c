/* Tests of tv_reconstruct: every status of reconstruct.h, outputs that stay untouched on errors,
   where its arrays lie, and determinism. Other tests check how accurate the poses are. */

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <unity.h>

#include "support/api.h"
#include "support/calls.h"
#include "support/real_pair.h"

enum { WIDTH = 200, HEIGHT = 150, CAP = 300 };

static uint8_t drawn[2][WIDTH * HEIGHT];
static tv_camera camera;
static tv_view views[2];
static tv_two_view two_view;
static tv_reconstruction reconstruction;
static api_context a;

static tv_limits limits_of(int32_t width, int32_t height, int32_t max_keypoints) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = width;
  limits.max_height = height;
  limits.max_keypoints = max_keypoints;
  return limits;
}

static tv_camera camera_of(int32_t width, int32_t height) {
  tv_camera c;
  memset(&c, 0, sizeof c);
  c.model = TV_CAMERA_PINHOLE;
  c.width = width;
  c.height = height;
  c.fx = c.fy = width;
  c.cx = 0.5 * (width - 1);
  c.cy = 0.5 * (height - 1);
  return c;
}

/* The second image is the first one moved sideways, its lower half by twice as much. */
static void draw_pair(uint64_t seed) {
  int32_t x, y;
  api_draw(seed, drawn[0], WIDTH, HEIGHT);
  for (y = 0; y < HEIGHT; ++y) {
    const int32_t shift = y < HEIGHT / 2 ? 6 : 12;
    for (x = 0; x < WIDTH; ++x) {
      drawn[1][y * WIDTH + x] = drawn[0][y * WIDTH + (x + shift < WIDTH ? x + shift : WIDTH - 1)];
    }
  }
}

void setUp(void) {
  const tv_limits limits = limits_of(WIDTH, HEIGHT, CAP);
  int v;
  a = api_make(&limits);
  draw_pair(81);
  camera = camera_of(WIDTH, HEIGHT);
  for (v = 0; v < 2; ++v) {
    views[v] = view_of(api_image(drawn[v], WIDTH, HEIGHT, WIDTH), &camera, NULL);
  }
  tv_two_view_init(&two_view);
  tv_reconstruction_init(&reconstruction);
}

void tearDown(void) { api_release(&a); }

static tv_status run(tv_context *context) {
  return tv_reconstruct(context, &views[0], &views[1], NULL, &two_view, NULL, &reconstruction);
}

/* Fills the outputs except struct_size with a pattern, which a refused call must leave as it is. */
static void refused(tv_status expected, const tv_reconstruct_options *options) {
  const size_t skip = sizeof two_view.struct_size;
  memset((uint8_t *)&two_view + skip, API_PATTERN, sizeof two_view - skip);
  memset((uint8_t *)&reconstruction + skip, API_PATTERN, sizeof reconstruction - skip);
  TEST_ASSERT_EQUAL_INT(expected, tv_reconstruct(a.context, &views[0], &views[1], options,
                                                 &two_view, NULL, &reconstruction));
  TEST_ASSERT_TRUE(api_is_pattern((uint8_t *)&two_view + skip, sizeof two_view - skip));
  TEST_ASSERT_TRUE(api_is_pattern((uint8_t *)&reconstruction + skip, sizeof reconstruction - skip));
}

/* The options of every stage of a reconstruction. */
typedef struct stage_options {
  tv_feature_options feature;
  tv_match_options match;
  tv_estimate_options estimate;
  tv_reconstruct_options all;
} stage_options;

static void default_stages(stage_options *o) {
  tv_feature_options_init(&o->feature);
  tv_match_options_init(&o->match);
  tv_estimate_options_init(&o->estimate);
  tv_reconstruct_options_init(&o->all);
  o->feature.max_keypoints = CAP;
  o->all.feature = &o->feature;
  o->all.match = &o->match;
  o->all.estimate = &o->estimate;
}

static void test_null_pointers_are_refused(void) {
  tv_view *v = views;
  tv_reconstruction *r = &reconstruction;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_reconstruct(NULL, v, v + 1, NULL, &two_view, NULL, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL,
                        tv_reconstruct(a.context, NULL, v + 1, NULL, &two_view, NULL, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_reconstruct(a.context, v, NULL, NULL, &two_view, NULL, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_reconstruct(a.context, v, v + 1, NULL, NULL, NULL, r));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL,
                        tv_reconstruct(a.context, v, v + 1, NULL, &two_view, NULL, NULL));
  views[1].image.data = NULL;
  refused(TV_ERR_NULL, NULL);
  tv_reconstruction_init(NULL);
  tv_reconstruct_options_init(NULL);
}

static void test_structs_of_another_size_are_refused(void) {
  stage_options o;
  uint32_t *sizes[4] = {&o.feature.struct_size, &o.match.struct_size, &o.estimate.struct_size,
                        &o.all.struct_size};
  int k;
  for (k = 0; k < 4; ++k) {
    default_stages(&o);
    *sizes[k] = 3;
    refused(TV_ERR_STRUCT_SIZE, &o.all);
  }
  for (k = 0; k < 2; ++k) {
    const uint32_t size = views[k].struct_size;
    views[k].struct_size = 0;
    refused(TV_ERR_STRUCT_SIZE, NULL);
    views[k].struct_size = size;
  }
  two_view.struct_size += 1;
  refused(TV_ERR_STRUCT_SIZE, NULL);
  tv_two_view_init(&two_view);
  reconstruction.struct_size = 0;
  refused(TV_ERR_STRUCT_SIZE, NULL);
}

static void test_results_that_overlap_are_refused(void) {
  union {
    tv_two_view two_view;
    tv_evidence evidence;
    tv_reconstruction reconstruction;
  } both;
  tv_view view0 = view_of(api_image(drawn[0], WIDTH, HEIGHT, WIDTH), &camera, NULL);
  tv_view view1 = view_of(api_image(drawn[1], WIDTH, HEIGHT, WIDTH), &camera, NULL);
  tv_reconstruction_init(&both.reconstruction);
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_reconstruct(a.context, &view0, &view1, NULL,
                                                       &both.two_view, NULL, &both.reconstruction));
  tv_reconstruction_init(&both.reconstruction);
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_reconstruct(a.context, &view0, &view1, NULL, &two_view,
                                                       &both.evidence, &both.reconstruction));
  tv_two_view_init(&both.two_view);
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_reconstruct(a.context, &view0, &view1, NULL, &both.two_view,
                                       &both.evidence, &reconstruction));
}

static void test_what_the_stages_refuse_is_refused(void) {
  stage_options o;
  tv_camera bad = camera;
  tv_image mask = api_image(drawn[0], WIDTH - 1, HEIGHT, WIDTH);
  default_stages(&o);
  o.feature.arc = 8;
  refused(TV_ERR_ARGUMENT, &o.all);
  default_stages(&o);
  o.feature.max_keypoints = CAP + 1;
  refused(TV_ERR_LIMITS, &o.all);
  default_stages(&o);
  o.match.ratio = 0;
  refused(TV_ERR_ARGUMENT, &o.all);
  default_stages(&o);
  o.estimate.max_error_px = NAN;
  refused(TV_ERR_NOT_FINITE, &o.all);
  default_stages(&o);
  o.all.triangulation = 7;
  refused(TV_ERR_ARGUMENT, &o.all);
  o.all.triangulation = -1;
  refused(TV_ERR_ARGUMENT, &o.all);
  default_stages(&o);
  o.all.guided_matching = 2;
  refused(TV_ERR_ARGUMENT, &o.all);
  o.all.guided_matching = -1;
  refused(TV_ERR_ARGUMENT, &o.all);
  default_stages(&o);
  o.all.bundle_adjustment = 2;
  refused(TV_ERR_ARGUMENT, &o.all);
  o.all.bundle_adjustment = -1;
  refused(TV_ERR_ARGUMENT, &o.all);
  default_stages(&o);
  o.all.sigma_by_size = -0.001;
  refused(TV_ERR_ARGUMENT, &o.all);
  o.all.sigma_by_size = 2.001;
  refused(TV_ERR_ARGUMENT, &o.all);
  o.all.sigma_by_size = NAN;
  refused(TV_ERR_NOT_FINITE, &o.all);
  o.all.sigma_by_size = INFINITY;
  refused(TV_ERR_NOT_FINITE, &o.all);
  default_stages(&o);
  o.all.align_matches = 2;
  refused(TV_ERR_ARGUMENT, &o.all);
  o.all.align_matches = -1;
  refused(TV_ERR_ARGUMENT, &o.all);
  default_stages(&o);
  o.all.reserved = 1;
  refused(TV_ERR_ARGUMENT, &o.all);
  default_stages(&o);
  views[1].mask = &mask;
  refused(TV_ERR_ARGUMENT, NULL);
  views[1].mask = NULL;
  bad.fx = 0;
  views[1].camera = &bad;
  refused(TV_ERR_CAMERA, NULL);
  for (int k = 0; k < 3; ++k) {
    bad = camera;
    if (k == 0) bad.width = 2 * WIDTH;
    if (k == 1) bad.height = HEIGHT - 1;
    if (k == 2) TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_scale(&camera, 2.0, &bad));
    refused(TV_ERR_CAMERA, NULL);
    views[1].camera = &camera;
    views[0].camera = &bad;
    refused(TV_ERR_CAMERA, NULL);
    views[0].camera = &camera;
    views[1].camera = &bad;
  }
  views[1].camera = &camera;
  views[1].image.width = WIDTH + 1;
  views[1].image.stride_bytes = WIDTH + 1;
  refused(TV_ERR_LIMITS, NULL);
}

static void test_one_camera_alone_is_refused(void) {
  views[0].camera = NULL;
  refused(TV_ERR_ARGUMENT, NULL);
}

static int lies_in_context(const void *pointer, size_t bytes) {
  const uint8_t *p = (const uint8_t *)pointer;
  return p >= a.memory && p + bytes <= a.memory + a.size_bytes;
}

static void test_the_result_is_whole_and_lies_in_the_context(void) {
  const tv_reconstruction *r = &reconstruction;
  int32_t k, v, inliers = 0, good = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context));
  TEST_ASSERT_TRUE(r->num_matches > 20);
  TEST_ASSERT_EQUAL_INT(r->num_matches, two_view.num_matches);
  for (v = 0; v < 2; ++v) {
    TEST_ASSERT_TRUE(r->num_keypoints[v] >= r->num_matches && r->num_keypoints[v] <= CAP);
    TEST_ASSERT_TRUE(lies_in_context(r->keypoints[v], CAP * sizeof(tv_keypoint)));
    TEST_ASSERT_TRUE(lies_in_context(r->descriptors[v], CAP * TV_DESCRIPTOR_BYTES));
  }
  TEST_ASSERT_TRUE(lies_in_context(r->matches, CAP * sizeof(tv_correspondence)));
  TEST_ASSERT_TRUE(lies_in_context(r->inlier_mask, CAP));
  TEST_ASSERT_TRUE(lies_in_context(r->points, CAP * sizeof(tv_point)));
  for (k = 0; k < r->num_matches; ++k) {
    TEST_ASSERT_TRUE(r->inlier_mask[k] <= 1);
    TEST_ASSERT_TRUE(r->inlier_mask[k] == 1 || r->points[k].status == TV_POINT_INVALID);
    TEST_ASSERT_TRUE(r->matches[k].idx0 < r->num_keypoints[0]);
    TEST_ASSERT_TRUE(r->matches[k].idx1 < r->num_keypoints[1]);
    inliers += r->inlier_mask[k];
    good += r->points[k].status == TV_POINT_OK;
  }
  TEST_ASSERT_EQUAL_INT(inliers, two_view.num_inliers);
  TEST_ASSERT_EQUAL_INT(good, r->num_points);
}

static void test_no_geometry_is_a_result(void) {
  memset(drawn, 90, sizeof drawn);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context));
  TEST_ASSERT_EQUAL_INT(0, reconstruction.num_matches);
  TEST_ASSERT_EQUAL_INT(0, reconstruction.num_points);
  TEST_ASSERT_EQUAL_INT(TV_KIND_DEGENERATE, two_view.kind);
  TEST_ASSERT_EQUAL_INT(0, two_view.has_R);
  views[0].image = api_image(drawn[0], 1, 1, 1);
  tv_camera one = camera_of(1, 1);
  views[0].camera = &one;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context));
}

/* One hash over everything that the result points to. */
static uint64_t hash_of_result(void) {
  const tv_reconstruction *r = &reconstruction;
  const size_t n = (size_t)r->num_matches;
  const struct {
    const void *data;
    size_t bytes;
  } parts[] = {{&two_view, sizeof two_view},
               {r->keypoints[0], (size_t)r->num_keypoints[0] * sizeof(tv_keypoint)},
               {r->keypoints[1], (size_t)r->num_keypoints[1] * sizeof(tv_keypoint)},
               {r->descriptors[0], (size_t)r->num_keypoints[0] * TV_DESCRIPTOR_BYTES},
               {r->descriptors[1], (size_t)r->num_keypoints[1] * TV_DESCRIPTOR_BYTES},
               {r->matches, n * sizeof(tv_correspondence)},
               {r->inlier_mask, n},
               {r->points, n * sizeof(tv_point)}};
  uint64_t hash = 14695981039346656037u; /* FNV-1a's start value */
  size_t p, k;
  for (p = 0; p < sizeof parts / sizeof parts[0]; ++p) {
    for (k = 0; k < parts[p].bytes; ++k) {
      hash = (hash ^ ((const uint8_t *)parts[p].data)[k]) * 1099511628211u;
    }
  }
  return hash;
}

static void test_the_same_call_gives_the_same_bytes(void) {
  const tv_limits limits = limits_of(WIDTH, HEIGHT, CAP);
  api_context b = api_make(&limits);
  uint64_t first;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context));
  first = hash_of_result();
  TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context));
  TEST_ASSERT_TRUE(first == hash_of_result());
  draw_pair(82); /* another pair is reconstructed in between, in both contexts */
  TEST_ASSERT_EQUAL_INT(TV_OK, run(b.context));
  TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context));
  TEST_ASSERT_TRUE(first != hash_of_result());
  draw_pair(81);
  TEST_ASSERT_EQUAL_INT(TV_OK, run(b.context));
  TEST_ASSERT_TRUE(first == hash_of_result());
  api_release(&b);
}

/* tv_context_size returns at least what a full call uses, and the call uses over 80 per cent of
   it. */
static void test_a_full_call_uses_most_of_the_memory(void) {
  size_t high_water;
  TEST_ASSERT_EQUAL_INT(TV_OK, run(a.context));
  high_water = tv_context_high_water(a.context);
  TEST_ASSERT_TRUE(high_water <= a.size_bytes);
  TEST_ASSERT_TRUE(high_water > a.size_bytes / 10 * 8);
}

static void view_real_pair(const real_pair *pair) {
  int v;
  /* The next test's setUp sets the camera of the drawn pair again. */
  camera = camera_of(pair->width, pair->height);
  for (v = 0; v < 2; ++v) {
    views[v].image = api_image(pair->luma[v], pair->width, pair->height, pair->width);
    views[v].camera = &camera;
  }
}

/* Each kernel set finds other bytes in the context's memory, too. */
static void test_a_real_pair_has_the_same_bytes_with_every_kernel_set(void) {
  real_pair pair;
  tv_limits limits;
  uint64_t first = 0;
  if (!real_pair_load(&pair)) TEST_IGNORE_MESSAGE("no real images");
  limits = limits_of(pair.width, pair.height, 2048);
  view_real_pair(&pair);
  for (limits.kernels = TV_KERNELS_C; limits.kernels <= TV_KERNELS_NEON; ++limits.kernels) {
    api_context b;
    if (api_try(&limits, &b) == TV_ERR_KERNELS) continue;
    memset(b.memory, limits.kernels % 2 != 0 ? 0 : 0xff, b.size_bytes);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_init(&b.context, &limits, b.memory, b.size_bytes));
    TEST_ASSERT_EQUAL_INT(TV_OK, run(b.context));
    TEST_ASSERT_TRUE(reconstruction.num_matches > 100);
    if (limits.kernels == TV_KERNELS_C) first = hash_of_result();
    TEST_ASSERT_TRUE(first == hash_of_result());
    free(b.block);
  }
  free(pair.luma[0]);
  free(pair.luma[1]);
}

/* sigma_by_size is tv_keypoint_sigmas of the keypoints, gathered for the matches, in the estimate
   and in the adjustment. */
static void test_sigmas_by_size_are_those_of_the_stages_by_hand(void) {
  static float sigmas[2][2048];
  static double pixels[2][2 * 2048];
  static float ratios[2048];
  static tv_point points[2048];
  static uint8_t mask[2048];
  real_pair pair;
  tv_limits limits;
  stage_options o;
  api_context b, c;
  tv_two_view without;
  static float gathered[2][2048];
  int adjusted, v, k, n;
  if (!real_pair_load(&pair)) TEST_IGNORE_MESSAGE("no real images");
  limits = limits_of(pair.width, pair.height, 2048);
  b = api_make(&limits);
  c = api_make(&limits);
  view_real_pair(&pair);
  default_stages(&o);
  o.feature.max_keypoints = 2048;
  o.feature.levels = 4;
  o.feature.scale_factor = 1.5f;
  o.feature.keypoint_size = 5;
  o.all.align_matches = 0;
  tv_two_view_init(&without);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &o.all, &without,
                                              NULL, &reconstruction));
  for (adjusted = 0; adjusted < 2; ++adjusted) {
    tv_pixel_pairs pairs;
    tv_two_view by_hand;
    o.all.sigma_by_size = 0.75;
    o.all.bundle_adjustment = adjusted;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &o.all, &two_view,
                                                NULL, &reconstruction));
    TEST_ASSERT_TRUE(two_view.has_t && two_view.num_inliers > 100);
    n = reconstruction.num_matches;
    for (v = 0; v < 2; ++v) {
      TEST_ASSERT_EQUAL_INT(
          TV_OK, tv_keypoint_sigmas(reconstruction.keypoints[v], reconstruction.num_keypoints[v], 5,
                                    0.75, sigmas[v]));
    }
    for (k = 0; k < n; ++k) {
      const tv_correspondence *m = &reconstruction.matches[k];
      for (v = 0; v < 2; ++v) {
        const int32_t i = v == 0 ? m->idx0 : m->idx1;
        pixels[v][2 * k] = reconstruction.keypoints[v][i].x;
        pixels[v][2 * k + 1] = reconstruction.keypoints[v][i].y;
      }
      ratios[k] = m->ratio;
    }
    pairs = pairs_of(pixels[0], pixels[1], ratios, n);
    for (k = 0; k < n; ++k) {
      gathered[0][k] = sigmas[0][reconstruction.matches[k].idx0];
      gathered[1][k] = sigmas[1][reconstruction.matches[k].idx1];
    }
    pairs.sigmas0 = gathered[0];
    pairs.sigmas1 = gathered[1];
    tv_two_view_init(&by_hand);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_two_view(c.context, &camera, &camera, &pairs,
                                                      &o.estimate, &by_hand, NULL, mask));
    if (adjusted) {
      tv_camera_pair corrected;
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_corrected_pair(&by_hand, &camera, &camera, &corrected));
      TEST_ASSERT_EQUAL_INT(
          TV_OK, tv_triangulate(&corrected, &pairs, TV_TRIANGULATION_ITERATIVE_LS, points));
      for (k = 0; k < n; ++k) {
        if (mask[k] == 0) points[k].status = TV_POINT_INVALID;
      }
      TEST_ASSERT_EQUAL_INT(TV_OK,
                            tv_adjust_two_view(c.context, &pairs, NULL, &corrected, points, NULL));
      memcpy(by_hand.R, corrected.cam1_from_cam0_R, sizeof by_hand.R);
      memcpy(by_hand.t, corrected.cam1_from_cam0_t, sizeof by_hand.t);
    }
    TEST_ASSERT_EQUAL_MEMORY(mask, reconstruction.inlier_mask, (size_t)n);
    TEST_ASSERT_EQUAL_MEMORY(by_hand.R, two_view.R, sizeof two_view.R);
    TEST_ASSERT_EQUAL_MEMORY(by_hand.t, two_view.t, sizeof two_view.t);
    TEST_ASSERT_TRUE(by_hand.noise_px == two_view.noise_px);
    TEST_ASSERT_TRUE(without.noise_px != two_view.noise_px);
  }
  free(pair.luma[0]);
  free(pair.luma[1]);
  api_release(&b);
  api_release(&c);
}

static int is_at(const tv_keypoint *k, const tv_keypoint *l) {
  return k->x == l->x && k->y == l->y;
}

/* With align_matches, only keypoints of matches move, one of each match at most; two matches of one
   place stay at one place; the estimate is that of the moved positions with the sigmas that
   tv_align_matches says; and exchanged views give the same positions. */
static void test_aligned_matches_are_estimated_from_moved_keypoints(void) {
  static tv_keypoint plain[2][2048], aligned[2][2048], again[2][2048];
  static double pixels[2][2 * 2048];
  static float ratios[2048], sigmas[2][2048];
  static uint8_t mask[2048], factors[2048];
  real_pair pair;
  tv_limits limits;
  tv_reconstruct_options options;
  tv_pixel_pairs pairs;
  tv_two_view by_hand;
  api_context b, c;
  int32_t num[2];
  int v, k, n, least = 255, most = 0, moved = 0, expected = 0, twice = 0;
  if (!real_pair_load(&pair)) TEST_IGNORE_MESSAGE("no real images");
  limits = limits_of(pair.width, pair.height, 2048);
  b = api_make(&limits);
  c = api_make(&limits);
  view_real_pair(&pair);
  tv_reconstruct_options_init(&options);
  options.align_matches = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &options, &two_view,
                                              NULL, &reconstruction));
  n = reconstruction.num_matches;
  for (v = 0; v < 2; ++v) {
    num[v] = reconstruction.num_keypoints[v];
    memcpy(plain[v], reconstruction.keypoints[v], (size_t)num[v] * sizeof plain[v][0]);
  }
  options.align_matches = 1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &options, &two_view,
                                              NULL, &reconstruction));
  TEST_ASSERT_EQUAL_INT(n, reconstruction.num_matches);
  for (v = 0; v < 2; ++v) {
    memcpy(aligned[v], reconstruction.keypoints[v], (size_t)num[v] * sizeof aligned[v][0]);
  }
  memcpy(again, plain, sizeof again);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, align_keypoints_of(c.context, views[0].image, views[1].image, reconstruction.matches,
                                n, 4, again[0], num[0], again[1], num[1], factors));
  for (k = 0; k < n; ++k) {
    const int32_t i[2] = {reconstruction.matches[k].idx0, reconstruction.matches[k].idx1};
    int changed[2];
    for (v = 0; v < 2; ++v) {
      const tv_keypoint *before = &plain[v][i[v]], *after = &aligned[v][i[v]];
      changed[v] = before->x != after->x || before->y != after->y;
      TEST_ASSERT_TRUE(fabs(before->x - after->x) < 1.2 * after->size / 4 + 1e-4);
      pixels[v][2 * k] = after->x;
      pixels[v][2 * k + 1] = after->y;
      sigmas[v][k] = after->size / 4;
    }
    TEST_ASSERT_FALSE(changed[0] && changed[1]);
    TEST_ASSERT_EQUAL_INT(factors[k] != 0, changed[0] || changed[1]);
    for (v = 0; v < 2 && factors[k] != 0; ++v) sigmas[v][k] *= (float)factors[k] / 128;
    if (factors[k] != 0) {
      least = factors[k] < least ? factors[k] : least;
      most = factors[k] > most ? factors[k] : most;
    }
    moved += changed[0] || changed[1];
    ratios[k] = reconstruction.matches[k].ratio;
    if (k > 0) {
      const tv_correspondence *last = &reconstruction.matches[k - 1];
      if (is_at(&plain[0][i[0]], &plain[0][last->idx0]) &&
          is_at(&plain[1][i[1]], &plain[1][last->idx1])) {
        TEST_ASSERT_TRUE(is_at(&aligned[0][i[0]], &aligned[0][last->idx0]));
        TEST_ASSERT_TRUE(is_at(&aligned[1][i[1]], &aligned[1][last->idx1]));
        twice += changed[0] || changed[1];
      }
    }
  }
  TEST_ASSERT_GREATER_THAN_INT(0, twice);
  TEST_ASSERT_GREATER_THAN_INT(n / 3, moved);
  TEST_ASSERT_GREATER_THAN_INT(3 * least, most);
  for (v = 0; v < 2; ++v) {
    for (k = 0; k < num[v]; ++k) {
      expected += memcmp(&plain[v][k], &aligned[v][k], sizeof plain[v][k]) != 0;
    }
  }
  TEST_ASSERT_EQUAL_INT(expected, moved); /* no other keypoint has moved */
  pairs = pairs_of(pixels[0], pixels[1], ratios, n);
  pairs.sigmas0 = sigmas[0];
  pairs.sigmas1 = sigmas[1];
  tv_two_view_init(&by_hand);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_estimate_two_view(c.context, &camera, &camera, &pairs, NULL, &by_hand, NULL, mask));
  TEST_ASSERT_EQUAL_MEMORY(mask, reconstruction.inlier_mask, (size_t)n);
  TEST_ASSERT_EQUAL_MEMORY(by_hand.R, two_view.R, sizeof two_view.R);
  TEST_ASSERT_EQUAL_MEMORY(by_hand.t, two_view.t, sizeof two_view.t);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[1], &views[0], &options, &two_view,
                                              NULL, &reconstruction));
  for (v = 0; v < 2; ++v) {
    TEST_ASSERT_EQUAL_MEMORY(aligned[v], reconstruction.keypoints[1 - v],
                             (size_t)num[v] * sizeof aligned[v][0]);
  }
  free(pair.luma[0]);
  free(pair.luma[1]);
  api_release(&b);
  api_release(&c);
}

/* The index of a match among the result's matches, or -1. */
static int32_t place_of(const tv_correspondence *match) {
  int32_t k;
  for (k = 0; k < reconstruction.num_matches; ++k) {
    const tv_correspondence *m = &reconstruction.matches[k];
    if (m->idx0 == match->idx0 && m->idx1 == match->idx1) return k;
  }
  return -1;
}

static void check_one_to_one(void) {
  const tv_reconstruction *r = &reconstruction;
  uint8_t used[2048] = {0};
  int32_t k, inliers = 0;
  for (k = 0; k < r->num_matches; ++k) {
    TEST_ASSERT_TRUE(k == 0 || r->matches[k].idx0 > r->matches[k - 1].idx0);
    TEST_ASSERT_TRUE(r->matches[k].idx0 < r->num_keypoints[0]);
    TEST_ASSERT_TRUE(r->matches[k].idx1 < r->num_keypoints[1]);
    TEST_ASSERT_EQUAL_INT(0, used[r->matches[k].idx1]++);
    inliers += r->inlier_mask[k];
  }
  TEST_ASSERT_EQUAL_INT(r->num_matches, two_view.num_matches);
  TEST_ASSERT_EQUAL_INT(inliers, two_view.num_inliers);
}

static void test_guided_matching_adds_matches_and_keeps_the_verdict(void) {
  static tv_correspondence plain[2048];
  static tv_two_view first, guided;
  real_pair pair;
  tv_limits limits;
  tv_evidence evidence[2];
  tv_reconstruct_options options;
  tv_match_options match;
  api_context b;
  int32_t num_plain, num_guided, k;
  if (!real_pair_load(&pair)) TEST_IGNORE_MESSAGE("no real images");
  limits = limits_of(pair.width, pair.height, 2048);
  b = api_make(&limits);
  view_real_pair(&pair);
  /* The plain ratio test at a strict ratio: with the defaults there is little left to add. */
  tv_match_options_init(&match);
  match.neighbourhood_px = 0;
  match.ratio = 0.8f;
  tv_reconstruct_options_init(&options);
  tv_evidence_init(&evidence[0]);
  options.match = &match;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &options, &two_view,
                                              &evidence[0], &reconstruction));
  first = two_view;
  num_plain = reconstruction.num_matches;
  memcpy(plain, reconstruction.matches, (size_t)num_plain * sizeof plain[0]);
  TEST_ASSERT_EQUAL_INT(1, first.has_t);
  options.guided_matching = 1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &options, &two_view,
                                              NULL, &reconstruction));
  guided = two_view;
  num_guided = reconstruction.num_matches;
  printf("matches %d, guided %d; inliers %d, guided %d\n", num_plain, num_guided, first.num_inliers,
         guided.num_inliers);
  TEST_ASSERT_TRUE(num_guided > num_plain + num_plain / 50);
  /* Asked for evidence, the call gives the same result, judged by the evidence of the first one. */
  tv_two_view_init(&two_view);
  tv_evidence_init(&evidence[1]);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &options, &two_view,
                                              &evidence[1], &reconstruction));
  TEST_ASSERT_EQUAL_MEMORY(&guided, &two_view, sizeof guided);
  TEST_ASSERT_EQUAL_MEMORY(&evidence[0].agreement, &evidence[1].agreement,
                           sizeof evidence[0] - offsetof(tv_evidence, agreement));
  TEST_ASSERT_TRUE(evidence[1].essential_inliers > evidence[0].essential_inliers);
  TEST_ASSERT_TRUE(guided.num_inliers > first.num_inliers);
  TEST_ASSERT_EQUAL_INT(first.kind, guided.kind);
  TEST_ASSERT_EQUAL_INT(first.verdict, guided.verdict);
  TEST_ASSERT_EQUAL_UINT32(first.reasons, guided.reasons);
  for (k = 0; k < num_plain; ++k) TEST_ASSERT_TRUE(place_of(&plain[k]) >= 0);
  check_one_to_one();
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[1], &views[0], &options, &two_view,
                                              NULL, &reconstruction));
  check_one_to_one();
  TEST_ASSERT_EQUAL_INT(num_guided, reconstruction.num_matches);
  for (k = 0; k < 9; ++k) {
    TEST_ASSERT_EQUAL_MEMORY(&guided.R[k], &two_view.R[k % 3 * 3 + k / 3], sizeof(double));
  }
  api_release(&b);
  free(pair.luma[0]);
  free(pair.luma[1]);
}

/* The sum of error_px^2 of `points`, over those whose status is TV_POINT_OK in both arrays. */
static double sum_sq(const tv_point *points, const tv_point *others, int32_t count) {
  double sum = 0;
  int32_t k;
  for (k = 0; k < count; ++k) {
    if (points[k].status != TV_POINT_OK || others[k].status != TV_POINT_OK) continue;
    sum += points[k].error_px * points[k].error_px;
  }
  return sum;
}

static void test_bundle_adjustment_moves_the_pose_and_what_follows_from_it(void) {
  static tv_point plain[2048];
  static tv_two_view first;
  real_pair pair;
  tv_limits limits;
  tv_reconstruct_options options;
  api_context b;
  int32_t k;
  if (!real_pair_load(&pair)) TEST_IGNORE_MESSAGE("no real images");
  limits = limits_of(pair.width, pair.height, 2048);
  b = api_make(&limits);
  view_real_pair(&pair);
  tv_reconstruct_options_init(&options);
  options.sigma_by_size = 0; /* the adjustment then lowers the sum of squares as it is compared */
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &options, &two_view,
                                              NULL, &reconstruction));
  first = two_view;
  memcpy(plain, reconstruction.points, (size_t)reconstruction.num_matches * sizeof plain[0]);
  TEST_ASSERT_EQUAL_INT(1, first.has_t);
  options.bundle_adjustment = 1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_reconstruct(b.context, &views[0], &views[1], &options, &two_view,
                                              NULL, &reconstruction));
  TEST_ASSERT_EQUAL_INT(first.num_inliers, two_view.num_inliers);
  TEST_ASSERT_TRUE(memcmp(first.R, two_view.R, sizeof first.R) != 0);
  TEST_ASSERT_TRUE(sum_sq(reconstruction.points, plain, first.num_matches) <
                   sum_sq(plain, reconstruction.points, first.num_matches));
  /* What was judged stays: the covariance, but for the axes across t that it is given along. */
  TEST_ASSERT_EQUAL_INT(1, two_view.has_covariance);
  TEST_ASSERT_EQUAL_INT(first.verdict, two_view.verdict);
  TEST_ASSERT_TRUE(first.noise_px == two_view.noise_px);
  for (k = 0; k < 9; ++k) {
    const int at = 5 * (k / 3) + k % 3;
    TEST_ASSERT_TRUE(first.covariance[at] == two_view.covariance[at]);
  }
  TEST_ASSERT_DOUBLE_WITHIN(1e-3 * first.covariance[18],
                            first.covariance[18] + first.covariance[24],
                            two_view.covariance[18] + two_view.covariance[24]);
  for (k = 0; k < 9; ++k) {
    const double *t = two_view.t, *R = two_view.R;
    const int row = k / 3, i = (row + 1) % 3, j = (row + 2) % 3, c = k % 3;
    const double E = (t[i] * R[3 * j + c] - t[j] * R[3 * i + c]) / sqrt(2.0);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, E, two_view.E[k]);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, first.E[k], two_view.E[k]);
    TEST_ASSERT_DOUBLE_WITHIN(0.1, first.F[k], two_view.F[k]);
  }
  api_release(&b);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_null_pointers_are_refused);
  RUN_TEST(test_structs_of_another_size_are_refused);
  RUN_TEST(test_results_that_overlap_are_refused);
  RUN_TEST(test_what_the_stages_refuse_is_refused);
  RUN_TEST(test_one_camera_alone_is_refused);
  RUN_TEST(test_the_result_is_whole_and_lies_in_the_context);
  RUN_TEST(test_no_geometry_is_a_result);
  RUN_TEST(test_the_same_call_gives_the_same_bytes);
  RUN_TEST(test_a_full_call_uses_most_of_the_memory);
  RUN_TEST(test_a_real_pair_has_the_same_bytes_with_every_kernel_set);
  RUN_TEST(test_sigmas_by_size_are_those_of_the_stages_by_hand);
  RUN_TEST(test_aligned_matches_are_estimated_from_moved_keypoints);
  RUN_TEST(test_guided_matching_adds_matches_and_keeps_the_verdict);
  RUN_TEST(test_bundle_adjustment_moves_the_pose_and_what_follows_from_it);
  return UNITY_END();
}
