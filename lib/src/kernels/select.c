/* Lists the kernel sets that this build has and this CPU can run, selects one of them, and finds
   the tables of its parts. */
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

/* TVK_SETS names the sets of this build, which `sets` lists in the same order. num_above_c returns
   how many of those after the C set this CPU can run. A set without a table of its own for a part
   has another's. */
#define TVK_SETS(X, part) X(part, c) X(part, sse2) X(part, avx2) X(part, avx512)
#define tvk_geometry_sse2 tvk_geometry_c
static const tvk_set sets[] = {
    {TV_KERNELS_C, 0}, {TV_KERNELS_SSE2, 1}, {TV_KERNELS_AVX2, 2}, {TV_KERNELS_AVX512, 3}};
static int32_t num_above_c(void) { return 1 + cpu_level(); }
#elif defined(__linux__) && defined(__aarch64__)
#define TVK_SETS(X, part) X(part, c) X(part, neon) X(part, neon_dot)
#define tvk_detect_neon_dot tvk_detect_neon
#define tvk_squeeze_neon_dot tvk_squeeze_neon
#define tvk_describe_neon_dot tvk_describe_neon
#define tvk_align_neon_dot tvk_align_neon
#define tvk_geometry_neon tvk_geometry_c
#define tvk_geometry_neon_dot tvk_geometry_c
static const tvk_set sets[] = {{TV_KERNELS_C, 0}, {TV_KERNELS_NEON, 1}, {TV_KERNELS_NEON, 2}};
static int32_t num_above_c(void) { return getauxval(AT_HWCAP) & HWCAP_ASIMDDP ? 2 : 1; }
#elif defined(__linux__) && defined(__arm__)
#define TVK_SETS(X, part) X(part, c) X(part, neon)
#define tvk_geometry_neon tvk_geometry_c
static const tvk_set sets[] = {{TV_KERNELS_C, 0}, {TV_KERNELS_NEON, 1}};
static int32_t num_above_c(void) { return (getauxval(AT_HWCAP) & HWCAP_NEON) != 0; }
#else
#define TVK_SETS(X, part) X(part, c)
static const tvk_set sets[] = {{TV_KERNELS_C, 0}};
static int32_t num_above_c(void) { return 0; }
#endif

const tvk_set *tvk_nth(int32_t n) { return n >= 0 && n <= num_above_c() ? &sets[n] : NULL; }

const tvk_set *tvk_select(int32_t id) {
  const tvk_set *found = NULL, *set;
  int32_t n;
  for (n = 0; (set = tvk_nth(n)) != NULL; ++n) {
    if (id == TV_KERNELS_AUTO || id == set->id) found = set;
  }
  return found;
}

#define TVK_DECLARE_TABLE(part, name) extern const tvk_##part##_table tvk_##part##_##name;
#define TVK_ADDRESS(part, name) &tvk_##part##_##name,
#define TVK_DEFINE_PART(part, LIST)                                                  \
  TVK_SETS(TVK_DECLARE_TABLE, part)                                                  \
  const tvk_##part##_table *tvk_##part##_of(const tvk_set *set) {                    \
    static const tvk_##part##_table *const tables[] = {TVK_SETS(TVK_ADDRESS, part)}; \
    return tables[set->index];                                                       \
  }
TVK_PARTS(TVK_DEFINE_PART)
