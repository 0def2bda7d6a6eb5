/* The same source compiled for AVX-512 with VNNI, and by hand what pays. */
#define TVK_SET TV_KERNELS_AVX512
#define TVK_TABLE tvk_table_avx512
#define TVK_AVX512
#define TVK_MATCH(name) tvk_##name##_avx512
#include "kernels/kernels_impl.h"
