/* The sets that kernels/select.c finds by its own cpuid and xgetbv, compared with the compiler's
   __builtin_cpu_supports; under an emulator (`select SET`) also with the set that the emulated CPU
   is known to have. */

#include <stdio.h>
#include <stdlib.h>
#include <unity.h>

#include "kernels/kernels.h"
#include "twoview/context.h"

void setUp(void) {}
void tearDown(void) {}

#if defined(__x86_64__)
static int32_t fastest_known = TV_KERNELS_AUTO;

/* A set requires the instructions that lib/CMakeLists.txt compiles it with. */
static int32_t has_instructions_of(int32_t set) {
  if (set == TV_KERNELS_AVX2) return __builtin_cpu_supports("avx2") != 0;
  if (set == TV_KERNELS_AVX512) {
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("avx512f") &&
           __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("avx512vnni");
  }
  return 1;
}

static void test_the_sets_are_those_that_the_compiler_finds(void) {
  static const int32_t sets[] = {TV_KERNELS_C, TV_KERNELS_SSE2, TV_KERNELS_AVX2, TV_KERNELS_AVX512};
  int32_t n = 0;
  size_t k;
  __builtin_cpu_init();
  for (k = 0; k < sizeof sets / sizeof sets[0]; ++k) {
    const tvk_set *const table = tvk_nth(n);
    if (!has_instructions_of(sets[k])) continue;
    TEST_ASSERT_NOT_NULL(table);
    TEST_ASSERT_EQUAL_INT(sets[k], table->id);
    ++n;
  }
  TEST_ASSERT_NULL(tvk_nth(n));
}

static void test_the_fastest_is_that_of_the_cpu_named(void) {
  TEST_ASSERT_EQUAL_INT(fastest_known, tvk_select(TV_KERNELS_AUTO)->id);
}

int main(int argc, char **argv) {
  UNITY_BEGIN();
  RUN_TEST(test_the_sets_are_those_that_the_compiler_finds);
  if (argc == 2) { /* argv[1]: the fastest kernel set of the emulated CPU */
    fastest_known = atoi(argv[1]);
    RUN_TEST(test_the_fastest_is_that_of_the_cpu_named);
  }
  return UNITY_END();
}
#else
int main(void) {
  printf("skipped: elsewhere than on x86-64 the system says what the CPU has\n");
  return TWOVIEW_SKIP_CODE;
}
#endif
