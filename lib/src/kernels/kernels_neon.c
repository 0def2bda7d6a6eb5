/* The same source compiled for NEON, and by hand what pays. On 32-bit ARM, NEON flushes denormals
   and has no IEEE division: integers there, and the compilers leave the rest to scalar VFP. */
#define TVK_SET TV_KERNELS_NEON
#define TVK_TABLE tvk_table_neon
#define TVK_NEON
#include "kernels/kernels_impl.h"
#include "kernels/kernels_table.h"

#if defined(__aarch64__)
/* The same with what gains by the dot product of ARMv8.2. */
#include "kernels/neon_dot.h"
#undef TVK_TABLE
#define TVK_TABLE tvk_table_neon_dot
#define mutual_nearest tvk_mutual_nearest_neon_dot
#include "kernels/kernels_table.h"
#endif
