/* The kernels of the dense cloud for NEON. On 32-bit ARM compilers leave floating point to the
   scalar VFP, since NEON's is not IEEE's. */
#define TVK_DENSE(name) tvk_##name##_neon
#define TVK_DENSE_TABLE tvk_dense_neon
#define TVK_NEON
#include "kernels/dense_impl.h"
