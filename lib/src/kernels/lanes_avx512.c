/* The same source compiled for AVX-512: no fused multiply-add, whose rounding differs. */
#define TVK_MATCH(name) tvk_##name##_avx512
#define TVK_AVX512
#include "kernels/lanes_impl.h"
