/* The portable kernels of a window's reduced system: the definition. */
#define TVK_BLOCKS(name) tvk_##name##_c
#define TVK_BLOCKS_TABLE tvk_blocks_c
#include "kernels/blocks_impl.h"
