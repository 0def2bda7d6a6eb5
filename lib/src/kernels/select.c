/* Lists the kernel sets that this build has and this CPU can run, and selects one of them. */
#include <stddef.h>

#include "kernels/kernels.h"
#include "twoview/context.h"

#if defined(__x86_64__)
#include <cpuid.h>
#endif
#if defined(__linux__) && (defined(__arm__) || defined(__aarch64__))
#include <asm/hwcap.h>
#include <sys/auxv.h>
#endif

extern const tvk_table tvk_table_c, tvk_table_sse2, tvk_table_avx2, tvk_table_avx512;
extern const tvk_table tvk_table_neon, tvk_table_neon_dot;

enum { MAX_TABLES = 4 };

#if defined(__x86_64__)
enum { LEVEL_SSE2, LEVEL_AVX2, LEVEL_AVX512 };

/* The highest level that both the CPU and the operating system support: the CPU has the
   instructions, and the system saves the registers (XCR0 bits 1 and 2 for AVX, bits 5 to 7 for
   AVX-512). __builtin_cpu_supports is not used: it detects every known CPU, with 4.4 kB of code and
   a mutable variable. */
static inline __attribute__((always_inline)) int32_t ask_cpu(void) {
  const unsigned avx512 = bit_AVX512F | bit_AVX512BW | bit_AVX512VL;
  unsigned a, b, c, d, saved, high;
  if (__get_cpuid_max(0, NULL) < 7) return LEVEL_SSE2;
  __cpuid(1, a, b, c, d);
  if (!(c & bit_OSXSAVE)) return LEVEL_SSE2;
  __asm__("xgetbv" : "=a"(saved), "=d"(high) : "c"(0));
  __cpuid_count(7, 0, a, b, c, d);
  if ((saved & 0x06) != 0x06 || !(b & bit_AVX2)) return LEVEL_SSE2;
  return (saved & 0xe0) == 0xe0 && (b & avx512) == avx512 && (c & bit_AVX512VNNI) ? LEVEL_AVX512
                                                                                  : LEVEL_AVX2;
}

#if defined(__GLIBC__)
/* The loader finds the level once and stores it as the address of a function. Each cpuid
   instruction traps in a virtual machine, 35 us for all of them, and small API calls select a
   table, too. */
static int32_t level_sse2(void) { return LEVEL_SSE2; }
static int32_t level_avx2(void) { return LEVEL_AVX2; }
static int32_t level_avx512(void) { return LEVEL_AVX512; }
typedef int32_t (*level_of)(void);
/* The loader calls this function before a sanitizer is initialised, so it must not be instrumented.
   `unused` suppresses a warning of clang, which does not see the use by ifunc. */
__attribute__((no_sanitize("address", "undefined"), unused)) static level_of resolve_level(void) {
  const int32_t level = ask_cpu();
  return level == LEVEL_AVX512 ? level_avx512 : level == LEVEL_AVX2 ? level_avx2 : level_sse2;
}
static int32_t cpu_level(void) __attribute__((ifunc("resolve_level")));
#else
static int32_t cpu_level(void) { return ask_cpu(); }
#endif

static int32_t tables_above_c(const tvk_table *tables[]) {
  const int32_t level = cpu_level();
  int32_t n = 0;
  tables[n++] = &tvk_table_sse2;
  if (level >= LEVEL_AVX2) tables[n++] = &tvk_table_avx2;
  if (level >= LEVEL_AVX512) tables[n++] = &tvk_table_avx512;
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
