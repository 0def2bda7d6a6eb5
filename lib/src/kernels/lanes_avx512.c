/* The kernels on matches compiled for AVX-512. FMA is not used, because it rounds differently. */
#define TVK_GEOMETRY(name) tvk_##name##_avx512
#define TVK_GEOMETRY_TABLE tvk_geometry_avx512
#define TVK_AVX512
#include "kernels/lanes_impl.h"
