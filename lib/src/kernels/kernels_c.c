/* The portable set: the definition. */
#define TVK_SET TV_KERNELS_C
#define TVK_TABLE tvk_table_c
#include "kernels/kernels_impl.h"
