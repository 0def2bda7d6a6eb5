/* Which sets this build has, and which of them this CPU runs. */
#include <stddef.h>

#include "kernels/kernels.h"
#include "twoview/context.h"

extern const tvk_table tvk_table_c;
#if defined(__x86_64__)
extern const tvk_table tvk_table_avx2;
extern const tvk_table tvk_table_avx512;
#endif

const tvk_table *tvk_select(int32_t set) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if ((set == TV_KERNELS_AUTO || set == TV_KERNELS_AVX512) && __builtin_cpu_supports("avx512f") &&
      __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
      __builtin_cpu_supports("avx512vnni")) {
    return &tvk_table_avx512;
  }
  if ((set == TV_KERNELS_AUTO || set == TV_KERNELS_AVX2) && __builtin_cpu_supports("avx2")) {
    return &tvk_table_avx2;
  }
#endif
  return set == TV_KERNELS_AUTO || set == TV_KERNELS_C ? &tvk_table_c : NULL;
}
