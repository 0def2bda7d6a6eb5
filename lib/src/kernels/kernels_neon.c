/* The NEON set: the common source compiled for NEON, with intrinsics where they were measured to be
   faster. On 32-bit ARM, NEON flushes denormals to zero and has no IEEE division. It is therefore
   used for integers only, and compilers leave floating point to the scalar VFP. */
#define TVK_TABLE(part) tvk_##part##_neon
#define TVK_NEON
#include "kernels/kernels_impl.h"
#include "kernels/kernels_table.h"

#if defined(__aarch64__)
/* The kernels that match with the dot product of ARMv8.2, for the CPUs that have it; the tables of
   the other parts are those above. */
#include "kernels/neon_dot.h"
extern const tvk_match_table tvk_match_neon_dot;
const tvk_match_table tvk_match_neon_dot = {tvk_nearest_groups_neon_dot, squared_distances};
#endif
