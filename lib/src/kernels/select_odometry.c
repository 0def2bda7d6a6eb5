/* Selects the odometry's kernels that belong to a set. */
#include "kernels/odometry.h"
#include "twoview/context.h"

extern const tvk_odometry_table tvk_odometry_c, tvk_odometry_avx2;

const tvk_odometry_table *tvk_odometry_of(const tvk_set *set) {
#if defined(__x86_64__)
  if (set->id >= TV_KERNELS_AVX2) return &tvk_odometry_avx2;
#else
  (void)set;
#endif
  return &tvk_odometry_c;
}
