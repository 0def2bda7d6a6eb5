/* The same source compiled for AVX2: no fused multiply-add, whose rounding differs. */
#define TVK_MATCH(name) tvk_##name##_avx2
#define TVK_AVX2
#include "kernels/lanes_impl.h"
