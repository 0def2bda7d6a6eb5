/* The kernels of a window's reduced system compiled for AVX2. AVX-512's vectors of eight are too
   long for rows of six numbers. */
#define TVK_BLOCKS(name) tvk_##name##_avx2
#define TVK_BLOCKS_TABLE tvk_blocks_avx2
#define TVK_AVX2
#include "kernels/blocks_impl.h"
