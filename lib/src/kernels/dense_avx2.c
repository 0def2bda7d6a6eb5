/* The kernels of the dense cloud compiled for AVX2. */
#define TVK_DENSE(name) tvk_##name##_avx2
#define TVK_DENSE_TABLE tvk_dense_avx2
#define TVK_AVX2
#include "kernels/dense_impl.h"
