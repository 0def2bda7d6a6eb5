/* The same source compiled for AVX2 (without FMA, whose rounding differs), and by hand what pays.
 */
#define TVK_SET TV_KERNELS_AVX2
#define TVK_TABLE tvk_table_avx2
#define TVK_AVX2
#define TVK_MATCH(name) tvk_##name##_avx2
#include "kernels/kernels_impl.h"

TVK_LEND(fast_contrasts, avx2);
TVK_LEND(average_rows, avx2);
TVK_LEND(halve_row, avx2);
TVK_LEND(blur_row, avx2);
TVK_LEND(pair_rows, avx2);
TVK_LEND(orientation_histogram, avx2);
TVK_LEND(gradient_histogram, avx2);
TVK_LEND(quantize_descriptor, avx2);

/* The C set's is as fast. */
#define average_columns tvk_average_columns_c
#include "kernels/kernels_table.h"
