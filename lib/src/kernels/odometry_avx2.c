/* The kernels of the odometry compiled for AVX2. AVX-512's vectors are too long for rows of six
   numbers. */
#define TVK_ODOMETRY(name) tvk_##name##_avx2
#define TVK_ODOMETRY_TABLE tvk_odometry_avx2
#define TVK_AVX2
#include "kernels/odometry_impl.h"
