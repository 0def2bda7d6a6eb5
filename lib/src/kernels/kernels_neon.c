/* The NEON set: the common source compiled for NEON, with intrinsics where they were measured to be
   faster. On 32-bit ARM, NEON flushes denormals to zero and has no IEEE division. It is therefore
   used for integers only, and compilers leave floating point to the scalar VFP. */
#define TVK_SET TV_KERNELS_NEON
#define TVK_TABLE tvk_table_neon
#define TVK_NEON
#include "kernels/kernels_impl.h"
#include "kernels/kernels_table.h"

#if defined(__aarch64__)
/* A second table of the set, for CPUs with the dot product of ARMv8.2. */
#include "kernels/neon_dot.h"
#undef TVK_TABLE
#define TVK_TABLE tvk_table_neon_dot
#define nearest_groups tvk_nearest_groups_neon_dot
#include "kernels/kernels_table.h"
#endif
