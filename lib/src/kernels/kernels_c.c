/* The C set, which is portable and the definition of every kernel on pixels, patches and
   descriptors. */
#define TVK_TABLE(part) tvk_##part##_c
#include "kernels/kernels_impl.h"

#if defined(__x86_64__)
TVK_LEND(average_columns, c);
TVK_LEND(squeeze_row, c);
TVK_LEND(sample_patch, c);
TVK_LEND(quantize_descriptors, c);
TVK_LEND(nearest_groups, c);
TVK_LEND(squared_distances, c);
TVK_LEND(window_template, c);
TVK_LEND(window_sums, c);
#endif
#include "kernels/kernels_table.h"
