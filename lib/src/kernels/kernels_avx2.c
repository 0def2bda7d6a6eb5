/* The same source compiled for AVX2 (without FMA, whose rounding differs), and by hand what pays. */
#define TVK_SET TV_KERNELS_AVX2
#define TVK_TABLE tvk_table_avx2
#define TVK_AVX2
#define TVK_MATCH(name) tvk_##name##_avx2
#include "kernels/kernels_impl.h"
