/* Selects the kernels of a window's reduced system that belong to a set. */
#include "kernels/blocks.h"
#include "twoview/context.h"

extern const tvk_blocks tvk_blocks_c, tvk_blocks_avx2;

const tvk_blocks *tvk_blocks_of(const tvk_table *kernels) {
#if defined(__x86_64__)
  if (kernels->set >= TV_KERNELS_AVX2) return &tvk_blocks_avx2;
#else
  (void)kernels;
#endif
  return &tvk_blocks_c;
}
