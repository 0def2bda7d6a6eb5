/* The SSE2 set: the common source compiled for speed, where the C set is compiled for size, with
   intrinsics where they were measured to be faster. */
#define TVK_TABLE(part) tvk_##part##_sse2
#define TVK_SSE2
#include "kernels/kernels_impl.h"

/* These kernels are the C set's, which are as fast. */
#define average_columns tvk_average_columns_c
#define squeeze_row tvk_squeeze_row_c
#define sample_patch tvk_sample_patch_c
#define quantize_descriptors tvk_quantize_descriptors_c
#define nearest_groups tvk_nearest_groups_c
#define squared_distances tvk_squared_distances_c
#define window_template tvk_window_template_c
#define window_sums tvk_window_sums_c
#include "kernels/kernels_table.h"
