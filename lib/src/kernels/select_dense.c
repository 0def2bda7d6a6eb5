/* Selects the dense cloud's kernels that belong to a set. */
#include "kernels/dense.h"
#include "twoview/context.h"

extern const tvk_dense_table tvk_dense_c, tvk_dense_avx2, tvk_dense_neon;

const tvk_dense_table *tvk_dense_of(const tvk_set *set) {
#if defined(__x86_64__)
  if (set->id >= TV_KERNELS_AVX2) return &tvk_dense_avx2;
#elif defined(__linux__) && (defined(__arm__) || defined(__aarch64__))
  if (set->id == TV_KERNELS_NEON) return &tvk_dense_neon;
#endif
  (void)set;
  return &tvk_dense_c;
}
