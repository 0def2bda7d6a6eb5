/* The kernels on matches compiled for AVX2. FMA is not used, because it rounds differently. */
#define TVK_MATCH(name) tvk_##name##_avx2
#define TVK_AVX2
#include "kernels/lanes_impl.h"
