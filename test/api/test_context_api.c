/* Limits, size, init, times: every status of context.h, and that outputs stay untouched on
   errors. */

#include <unity.h>

#include "support/api.h"

void setUp(void) {}
void tearDown(void) {}

static tv_limits small_limits(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = 64;
  limits.max_height = 48;
  limits.max_keypoints = 32;
  return limits;
}

static void test_limits_have_the_documented_defaults(void) {
  tv_limits limits;
  tv_limits_init(&limits);
  TEST_ASSERT_EQUAL_UINT(sizeof limits, limits.struct_size);
  TEST_ASSERT_EQUAL_INT(640, limits.max_width);
  TEST_ASSERT_EQUAL_INT(480, limits.max_height);
  TEST_ASSERT_EQUAL_INT(2048, limits.max_keypoints);
  TEST_ASSERT_EQUAL_INT(0, limits.max_matches);
  TEST_ASSERT_EQUAL_INT(TV_KERNELS_AUTO, limits.kernels);
  tv_limits_init(NULL);
}

static void check_size_status(tv_status expected, const tv_limits *limits) {
  size_t size = 77;
  tv_context *context = NULL;
  uint8_t memory[TV_CONTEXT_ALIGNMENT];
  memset(memory, API_PATTERN, sizeof memory);
  TEST_ASSERT_EQUAL_INT(expected, tv_context_size(limits, &size));
  TEST_ASSERT_EQUAL_UINT64(77, size);
  TEST_ASSERT_EQUAL_INT(expected, tv_context_init(&context, limits, memory, sizeof memory));
  TEST_ASSERT_NULL(context);
  TEST_ASSERT_TRUE(api_is_pattern(memory, sizeof memory));
}

static void test_limits_out_of_range_are_refused(void) {
  static const int32_t bad_sides[] = {0, -1, 16385, INT32_MAX, INT32_MIN};
  static const int32_t bad_counts[] = {0, -1, 65536, INT32_MAX, INT32_MIN};
  static const int32_t bad_matches[] = {-1, 1000001, INT32_MAX, INT32_MIN};
  static const int32_t bad_kernels[] = {-1, TV_KERNELS_NEON + 1, INT32_MAX, INT32_MIN};
  static const uint32_t bad_purposes[] = {128, UINT32_MAX, 1u << 31};
  tv_limits limits;
  size_t k;
  check_size_status(TV_ERR_NULL, NULL);
#define REFUSED(field, values)                             \
  for (k = 0; k < sizeof values / sizeof values[0]; ++k) { \
    limits = small_limits();                               \
    limits.field = values[k];                              \
    check_size_status(TV_ERR_ARGUMENT, &limits);           \
  }
  REFUSED(max_width, bad_sides)
  REFUSED(max_height, bad_sides)
  REFUSED(max_keypoints, bad_counts)
  REFUSED(max_matches, bad_matches)
  REFUSED(kernels, bad_kernels)
  REFUSED(purposes, bad_purposes)
#undef REFUSED
}

static void test_a_size_that_no_struct_has_is_refused(void) {
  static const uint32_t bad[] = {0, 1, 3, sizeof(tv_limits) - 1, 4100, UINT32_MAX};
  tv_limits limits = small_limits();
  size_t k;
  for (k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
    limits.struct_size = bad[k];
    check_size_status(TV_ERR_STRUCT_SIZE, &limits);
  }
}

static void test_an_older_callers_missing_fields_have_their_defaults(void) {
  const size_t before_kernels = offsetof(tv_limits, kernels);
  tv_limits limits = small_limits();
  size_t all = 0, older = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &all));
  limits.struct_size = (uint32_t)before_kernels;
  /* the field kernels lies beyond the caller's struct_size, so the library must not read it */
  limits.kernels = -1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &older));
  TEST_ASSERT_EQUAL_UINT64(all, older);
}

static void test_a_newer_callers_unknown_fields_must_be_zero(void) {
  struct {
    tv_limits known;
    uint8_t unknown[24];
  } limits;
  size_t k, size;
  memset(&limits, API_PATTERN, sizeof limits);
  tv_limits_init_sized(&limits.known, sizeof limits);
  TEST_ASSERT_EQUAL_UINT32(sizeof limits, limits.known.struct_size);
  TEST_ASSERT_EQUAL_INT(640, limits.known.max_width);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits.known, &size));
  for (k = 0; k < sizeof limits.unknown; ++k) {
    limits.unknown[k] = 1;
    check_size_status(TV_ERR_STRUCT_SIZE, &limits.known);
    limits.unknown[k] = 0;
  }
}

/* For every caller's size, init writes exactly that many bytes. */
static void test_init_writes_as_far_as_the_callers_size(void) {
  uint8_t memory[80], whole[sizeof(tv_limits)];
  tv_limits limits;
  size_t size, k;
  tv_limits_init(&limits);
  memcpy(whole, &limits, sizeof whole);
  for (size = 0; size <= 64; ++size) {
    const uint32_t own = (uint32_t)size;
    memset(memory, API_PATTERN, sizeof memory);
    tv_limits_init_sized((tv_limits *)(void *)memory, size);
    TEST_ASSERT_EQUAL_INT(0, memcmp(&own, memory, size < 4 ? size : 4));
    for (k = 4; k < size; ++k) TEST_ASSERT_EQUAL_UINT8(k < sizeof whole ? whole[k] : 0, memory[k]);
    TEST_ASSERT_TRUE(api_is_pattern(memory + size, sizeof memory - size));
  }
  tv_limits_init_sized(NULL, 24);
}

static void test_the_size_query_needs_somewhere_to_write(void) {
  const tv_limits limits = small_limits();
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_context_size(&limits, NULL));
}

static void test_the_extreme_limits_have_a_size(void) {
  tv_limits limits = small_limits();
  size_t small = 0, large = 0;
  limits.max_width = limits.max_height = limits.max_keypoints = limits.max_matches = 1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &small));
  limits.max_width = limits.max_height = 16384;
  limits.max_keypoints = 65535;
  limits.max_matches = 1000000;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &large));
  TEST_ASSERT_TRUE(small < 65536);
  TEST_ASSERT_TRUE(large > (size_t)16384 * 16384);
}

static void test_a_vga_context_is_within_8_mib(void) {
  tv_limits limits;
  size_t size = 0;
  tv_limits_init(&limits); /* the default limits: 640 x 480 pixels, 2048 keypoints */
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &size));
  TEST_ASSERT_TRUE(size <= (size_t)8 << 20);
}

static size_t size_for(uint32_t purposes) {
  tv_limits limits;
  size_t size_bytes = 0;
  tv_limits_init(&limits);
  limits.max_keypoints = 1000;
  limits.purposes = purposes;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &size_bytes));
  return size_bytes;
}

static void test_a_context_pays_for_its_purposes_alone(void) {
  const size_t all = size_for(0), whole = size_for(TV_PURPOSE_RECONSTRUCT);
  uint32_t purposes;
  TEST_ASSERT_TRUE(size_for(TV_PURPOSE_MATCH) <= 300 * 1024);
  TEST_ASSERT_EQUAL_UINT64(all, size_for(127));
  /* The purposes of odometry do not make the context of a program that names none larger. */
  TEST_ASSERT_EQUAL_UINT64(all, size_for(63));
  TEST_ASSERT_TRUE(size_for(TV_PURPOSE_ABSOLUTE_POSE) < size_for(TV_PURPOSE_ESTIMATE));
  TEST_ASSERT_TRUE(whole <= all);
  for (purposes = 1; purposes < 127; ++purposes) {
    const uint32_t one = purposes & (0u - purposes);
    TEST_ASSERT_TRUE(size_for(purposes) <= all);
    TEST_ASSERT_TRUE(size_for(purposes) >= size_for(one));
    TEST_ASSERT_TRUE((purposes & 8) != 0 || size_for(purposes) < whole);
    /* The bit that names reconstruction brings the purposes that it needs. */
    TEST_ASSERT_TRUE((purposes & 8) == 0 || size_for(purposes) == size_for(purposes | 7));
  }
}

static void test_several_mistakes_at_once_write_nothing(void) {
  tv_limits limits = small_limits();
  size_t size = 77;
  limits.struct_size = 0;
  limits.max_width = -1;
  TEST_ASSERT_TRUE(tv_context_size(&limits, &size) != TV_OK);
  TEST_ASSERT_TRUE(tv_context_init(NULL, &limits, NULL, 0) != TV_OK);
  TEST_ASSERT_EQUAL_UINT64(77, size);
}

static void test_memory_larger_than_needed_is_left_alone(void) {
  const tv_limits limits = small_limits();
  api_context a = api_make(&limits);
  tv_context *context = NULL;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_init(&context, &limits, a.memory, SIZE_MAX));
  TEST_ASSERT_EQUAL_PTR(a.memory, context);
  a.context = context;
  api_release(&a); /* api_release fails if bytes beyond the context's own size were changed */
}

static void test_the_size_never_falls_when_a_limit_rises(void) {
  tv_limits limits = small_limits();
  size_t before = 0, after = 0;
  int32_t k;
  for (k = 1; k < 400; ++k) {
    limits.max_width = 1 + k;
    limits.max_height = 1 + k / 2;
    limits.max_keypoints = 1 + k / 3;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &after));
    TEST_ASSERT_TRUE(after >= before);
    before = after;
  }
}

static void test_memory_that_is_null_misaligned_or_a_byte_short_is_refused(void) {
  const tv_limits limits = small_limits();
  api_context a = api_make(&limits);
  tv_context *context = NULL;
  uint8_t *memory = a.memory;
  memset(memory, API_PATTERN, a.size_bytes);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_context_init(NULL, &limits, memory, a.size_bytes));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_context_init(&context, &limits, NULL, a.size_bytes));
  TEST_ASSERT_EQUAL_INT(TV_ERR_MEMORY,
                        tv_context_init(&context, &limits, memory, a.size_bytes - 1));
  TEST_ASSERT_EQUAL_INT(TV_ERR_MEMORY, tv_context_init(&context, &limits, memory, 0));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ALIGNMENT,
                        tv_context_init(&context, &limits, memory + 1, a.size_bytes));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ALIGNMENT,
                        tv_context_init(&context, &limits, memory + 32, a.size_bytes));
  TEST_ASSERT_NULL(context);
  TEST_ASSERT_TRUE(api_is_pattern(memory, a.size_bytes));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_init(&context, &limits, memory, a.size_bytes));
  TEST_ASSERT_EQUAL_PTR(memory, context);
  api_release(&a);
}

static void test_a_kernel_set_is_what_was_asked_for_or_refused(void) {
  tv_limits limits = small_limits();
  int32_t set;
  int refused = 0;
  for (set = TV_KERNELS_AUTO; set <= TV_KERNELS_NEON; ++set) {
    api_context a = api_make(&limits);
    tv_context *context = NULL;
    tv_status status;
    tv_limits wanted = limits;
    wanted.kernels = set;
    memset(a.memory, API_PATTERN, a.size_bytes);
    status = tv_context_init(&context, &wanted, a.memory, a.size_bytes);
    if (status == TV_OK) {
      const tv_kernels got = tv_context_kernels(context);
      TEST_ASSERT_TRUE(set == TV_KERNELS_AUTO ? got != TV_KERNELS_AUTO : (int32_t)got == set);
      api_release(&a);
    } else {
      TEST_ASSERT_EQUAL_INT(TV_ERR_KERNELS, status);
      TEST_ASSERT_NULL(context);
      TEST_ASSERT_TRUE(set > TV_KERNELS_C);
      TEST_ASSERT_TRUE(api_is_pattern(a.memory, a.size_bytes));
      ++refused;
      free(a.block);
    }
  }
  TEST_ASSERT_TRUE(refused > 0); /* every CPU refuses some set, since none has both AVX2 and NEON */
}

static void test_a_null_context_is_answered(void) {
  uint64_t times[TV_NUM_STAGES];
  TEST_ASSERT_EQUAL_INT(TV_KERNELS_AUTO, tv_context_kernels(NULL));
  TEST_ASSERT_EQUAL_UINT64(0, tv_context_high_water(NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_context_set_clock(NULL, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_context_take_times(NULL, times, TV_NUM_STAGES));
}

static void test_strings_name_every_value(void) {
  static const char *const names[] = {"auto", "c", "sse2", "avx2", "avx512", "neon"};
  int k, other;
  for (k = 0; k <= TV_KERNELS_NEON; ++k) {
    TEST_ASSERT_EQUAL_STRING(names[k], tv_kernels_string((tv_kernels)k));
  }
  TEST_ASSERT_EQUAL_STRING("unknown", tv_kernels_string((tv_kernels)6));
  TEST_ASSERT_EQUAL_STRING("unknown", tv_kernels_string((tv_kernels)-1));
  for (k = TV_OK; k <= TV_ERR_EFFORT; ++k) {
    TEST_ASSERT_TRUE(strcmp(tv_status_string((tv_status)k), "unknown status") != 0);
    for (other = TV_OK; other < k; ++other) {
      TEST_ASSERT_TRUE(strcmp(tv_status_string((tv_status)k), tv_status_string((tv_status)other)));
    }
  }
  TEST_ASSERT_EQUAL_STRING("unknown status", tv_status_string((tv_status)18));
  TEST_ASSERT_EQUAL_STRING("unknown status", tv_status_string((tv_status)-1));
  TEST_ASSERT_EQUAL_STRING(TV_VERSION_STRING, tv_version_string());
}

static uint64_t ticking(void *user) { return *(uint64_t *)user += 5; }

static void test_times_come_from_the_callers_clock_and_start_again(void) {
  static uint8_t pixels[64 * 48];
  const tv_limits limits = small_limits();
  api_context a = api_make(&limits);
  const tv_image image = api_image(pixels, 64, 48, 64);
  tv_keypoint keypoints[32];
  uint64_t times[TV_NUM_STAGES + 2], ticks = 100;
  tv_feature_options options;
  int32_t count, k;
  tv_feature_options_init(&options);
  options.max_keypoints = 32;
  api_draw(1, pixels, 64, 48);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_detect(a.context, &image, NULL, &options, keypoints, 32, &count));
  memset(times, API_PATTERN, sizeof times);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_take_times(a.context, times, TV_NUM_STAGES + 1));
  for (k = 0; k <= TV_NUM_STAGES; ++k) TEST_ASSERT_EQUAL_UINT64(0, times[k]);
  TEST_ASSERT_TRUE(api_is_pattern(&times[TV_NUM_STAGES + 1], sizeof times[0]));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_set_clock(a.context, ticking, &ticks));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_detect(a.context, &image, NULL, &options, keypoints, 32, &count));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_context_take_times(a.context, NULL, 1));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_context_take_times(a.context, times, -1));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_take_times(a.context, times, TV_STAGE_DETECT + 1));
  TEST_ASSERT_TRUE(api_is_pattern(&times[TV_NUM_STAGES + 1], sizeof times[0]));
  TEST_ASSERT_EQUAL_UINT64(5, times[TV_STAGE_DETECT]);
  TEST_ASSERT_EQUAL_UINT64(0, times[TV_STAGE_MATCH]);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_take_times(a.context, NULL, 0));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_take_times(a.context, times, TV_NUM_STAGES));
  TEST_ASSERT_EQUAL_UINT64(0, times[TV_STAGE_DETECT]);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_set_clock(a.context, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_detect(a.context, &image, NULL, &options, keypoints, 32, &count));
  TEST_ASSERT_EQUAL_UINT64(110, ticks);
  api_release(&a);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_limits_have_the_documented_defaults);
  RUN_TEST(test_limits_out_of_range_are_refused);
  RUN_TEST(test_a_size_that_no_struct_has_is_refused);
  RUN_TEST(test_an_older_callers_missing_fields_have_their_defaults);
  RUN_TEST(test_a_newer_callers_unknown_fields_must_be_zero);
  RUN_TEST(test_init_writes_as_far_as_the_callers_size);
  RUN_TEST(test_the_size_query_needs_somewhere_to_write);
  RUN_TEST(test_the_extreme_limits_have_a_size);
  RUN_TEST(test_a_vga_context_is_within_8_mib);
  RUN_TEST(test_a_context_pays_for_its_purposes_alone);
  RUN_TEST(test_several_mistakes_at_once_write_nothing);
  RUN_TEST(test_memory_larger_than_needed_is_left_alone);
  RUN_TEST(test_the_size_never_falls_when_a_limit_rises);
  RUN_TEST(test_memory_that_is_null_misaligned_or_a_byte_short_is_refused);
  RUN_TEST(test_a_kernel_set_is_what_was_asked_for_or_refused);
  RUN_TEST(test_a_null_context_is_answered);
  RUN_TEST(test_strings_name_every_value);
  RUN_TEST(test_times_come_from_the_callers_clock_and_start_again);
  return UNITY_END();
}
