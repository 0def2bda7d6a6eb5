/* The kernels of the dense cloud for NEON. */
#define TVK_DENSE(name) tvk_##name##_neon
#define TVK_DENSE_TABLE tvk_dense_neon
#define TVK_NEON
#if defined(__arm__)
/* Compilers for 32-bit ARM leave floating point to the scalar VFP, since NEON's is not IEEE's:
   there the kernels over floating point are those of the C set. */
#define TVK_NO_FLOATS
#define tvk_fit_cells_neon tvk_fit_cells_c
#define tvk_place_row_neon tvk_place_row_c
#endif
#include "kernels/dense_impl.h"
