/* The same source compiled for speed where the C set is compiled small, and by hand what pays. */
#define TVK_SET TV_KERNELS_SSE2
#define TVK_TABLE tvk_table_sse2
#define TVK_SSE2
#include "kernels/kernels_impl.h"
