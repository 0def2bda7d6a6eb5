/* The kernels on matches compiled for AVX2. FMA is not used, because it rounds differently. */
#define TVK_GEOMETRY(name) tvk_##name##_avx2
#define TVK_GEOMETRY_TABLE tvk_geometry_avx2
#define TVK_AVX2
#include "kernels/lanes_impl.h"
