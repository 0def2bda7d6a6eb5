/* No call after tv_context_init allocates: this program defines malloc, calloc, realloc and free
   itself, and counts their calls. */

#include <unity.h>

#include "support/api.h"
#include "support/calls.h"

#if defined(__GLIBC__) && !defined(TWOVIEW_SANITIZED)
extern void *__libc_malloc(size_t size);
extern void *__libc_calloc(size_t count, size_t size);
extern void *__libc_realloc(void *block, size_t size);
extern void __libc_free(void *block);

/* `volatile`, since the compiler assumes that malloc does not read these variables */
static volatile int watching;
static volatile long allocations;

/* The dynamic linker uses these definitions for the shared library too. */
void *malloc(size_t size) {
  allocations += watching;
  return __libc_malloc(size);
}
void *calloc(size_t count, size_t size) {
  allocations += watching;
  return __libc_calloc(count, size);
}
void *realloc(void *block, size_t size) {
  allocations += watching;
  return __libc_realloc(block, size);
}
void free(void *block) {
  allocations += watching;
  __libc_free(block);
}

enum { WIDTH = 320, HEIGHT = 240, MOST = 512 };

static api_context context;
static uint8_t pixels[2][WIDTH * HEIGHT];
static tv_keypoint keypoints[2][MOST];
static uint8_t descriptors[2][MOST * TV_DESCRIPTOR_BYTES];

void setUp(void) {
  tv_limits limits;
  int32_t y;
  tv_limits_init(&limits);
  limits.max_width = WIDTH;
  limits.max_height = HEIGHT;
  limits.max_keypoints = MOST;
  context = api_make(&limits);
  api_draw(3, pixels[0], WIDTH, HEIGHT);
  for (y = 0; y < HEIGHT; ++y) { /* image 1 is image 0, moved 5 pixels to the left */
    memmove(pixels[1] + y * WIDTH, pixels[0] + y * WIDTH + 5, WIDTH - 5);
  }
}

void tearDown(void) { api_release(&context); }

static tv_camera camera(void) {
  tv_camera c;
  memset(&c, 0, sizeof c);
  c.model = TV_CAMERA_PINHOLE;
  c.width = WIDTH;
  c.height = HEIGHT;
  c.fx = c.fy = 300;
  c.cx = WIDTH / 2.0;
  c.cy = HEIGHT / 2.0;
  return c;
}

/* Calls each stage by itself, and the functions that need a pose. */
static void call_stages(void) {
  static tv_correspondence matches[MOST], guided[MOST];
  static double at[2][2 * MOST], covariances[9 * MOST];
  static float ratios[MOST];
  static uint8_t inliers[MOST];
  static tv_point points[MOST];
  const tv_camera c = camera();
  tv_feature_options options;
  tv_two_view pose;
  tv_camera_pair pair = {c, c, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {1, 0, 0}};
  int32_t counts[2] = {0, 0}, num = 0, k, v;
  tv_feature_options_init(&options);
  options.max_keypoints = MOST;
  for (v = 0; v < 2; ++v) {
    const tv_image image = api_image(pixels[v], WIDTH, HEIGHT, WIDTH);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_extract(context.context, &image, NULL, &options, keypoints[v],
                                            descriptors[v], MOST, &counts[v]));
    TEST_ASSERT_TRUE(counts[v] > 100);
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, match_rows(context.context, descriptors[0], counts[0],
                                          descriptors[1], counts[1], NULL, matches, MOST, &num));
  TEST_ASSERT_TRUE(num > 50);
  for (k = 0; k < num; ++k) {
    at[0][2 * k] = keypoints[0][matches[k].idx0].x;
    at[0][2 * k + 1] = keypoints[0][matches[k].idx0].y;
    at[1][2 * k] = keypoints[1][matches[k].idx1].x;
    at[1][2 * k + 1] = keypoints[1][matches[k].idx1].y;
    ratios[k] = matches[k].ratio;
  }
  tv_two_view_init(&pose);
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_pixels(context.context, &c, &c, at[0], at[1], ratios, num,
                                               NULL, &pose, inliers));
  TEST_ASSERT_TRUE(pose.has_F);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, match_rows_guided(context.context, NULL, NULL, pose.F, keypoints[0], descriptors[0],
                               counts[0], keypoints[1], descriptors[1], counts[1], NULL, guided,
                               MOST, &k));
  tv_two_view_init(&pose);
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_pixels(context.context, NULL, NULL, at[0], at[1], NULL, num,
                                               NULL, &pose, NULL));
  TEST_ASSERT_EQUAL_INT(
      TV_OK, triangulate_pixels(&pair, at[0], at[1], num, TV_TRIANGULATION_POLY, points));
  TEST_ASSERT_EQUAL_INT(
      TV_OK, adjust_pixels(context.context, at[0], at[1], num, NULL, &pair, points, NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_point_covariances(&pair, points, num, 0.5, NULL, covariances));
}

static void call_reconstruct(void) {
  const tv_camera c = camera();
  tv_view views[2];
  tv_two_view pose;
  tv_reconstruction cloud;
  int32_t v;
  for (v = 0; v < 2; ++v) {
    views[v] = view_of(api_image(pixels[v], WIDTH, HEIGHT, WIDTH), &c, NULL);
  }
  tv_two_view_init(&pose);
  tv_reconstruction_init(&cloud);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, tv_reconstruct(context.context, &views[0], &views[1], NULL, &pose, NULL, &cloud));
}

static void test_the_counters_see_an_allocation(void) {
  void *volatile block;
  watching = 1;
  allocations = 0;
  block = malloc(16);
  free(block);
  watching = 0;
  TEST_ASSERT_EQUAL_INT(2, allocations);
}

static void test_no_call_after_init_takes_heap(void) {
  watching = 1;
  allocations = 0;
  call_stages();
  call_reconstruct();
  watching = 0;
  TEST_ASSERT_EQUAL_INT(0, allocations);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_counters_see_an_allocation);
  RUN_TEST(test_no_call_after_init_takes_heap);
  return UNITY_END();
}
#else
void setUp(void) {}
void tearDown(void) {}
int main(void) {
  puts("no malloc of glibc that could be replaced");
  return TWOVIEW_SKIP_CODE;
}
#endif
