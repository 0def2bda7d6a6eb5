/* Which sets this build has, and which of them this CPU runs. */
#include <stddef.h>

#include "kernels/kernels.h"
#include "twoview/context.h"

#if defined(__linux__) && (defined(__arm__) || defined(__aarch64__))
#include <asm/hwcap.h>
#include <sys/auxv.h>
#endif

extern const tvk_table tvk_table_c, tvk_table_sse2, tvk_table_avx2, tvk_table_avx512;
extern const tvk_table tvk_table_neon, tvk_table_neon_dot;

enum { MAX_TABLES = 4 };

#if defined(__x86_64__)
static int32_t tables_above_c(const tvk_table *tables[]) {
  int32_t n = 0;
  __builtin_cpu_init();
  tables[n++] = &tvk_table_sse2;
  if (__builtin_cpu_supports("avx2")) tables[n++] = &tvk_table_avx2;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512vnni")) {
    tables[n++] = &tvk_table_avx512;
  }
  return n;
}
#elif defined(__linux__) && defined(__aarch64__)
static int32_t tables_above_c(const tvk_table *tables[]) {
  int32_t n = 0;
  tables[n++] = &tvk_table_neon;
  if (getauxval(AT_HWCAP) & HWCAP_ASIMDDP) tables[n++] = &tvk_table_neon_dot;
  return n;
}
#elif defined(__linux__) && defined(__arm__)
static int32_t tables_above_c(const tvk_table *tables[]) {
  tables[0] = &tvk_table_neon;
  return (getauxval(AT_HWCAP) & HWCAP_NEON) != 0;
}
#else
static int32_t tables_above_c(const tvk_table *tables[]) {
  (void)tables;
  return 0;
}
#endif

const tvk_table *tvk_nth(int32_t n) {
  const tvk_table *tables[MAX_TABLES] = {&tvk_table_c};
  const int32_t count = 1 + tables_above_c(tables + 1);
  return n >= 0 && n < count ? tables[n] : NULL;
}

const tvk_table *tvk_select(int32_t set) {
  const tvk_table *found = NULL, *table;
  int32_t n;
  for (n = 0; (table = tvk_nth(n)) != NULL; ++n) {
    if (set == TV_KERNELS_AUTO || set == table->set) found = table;
  }
  return found;
}
