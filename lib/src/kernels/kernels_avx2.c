/* The AVX2 set: the common source compiled for AVX2, with intrinsics where they were measured to be
   faster. FMA is not used, because it rounds differently. */
#define TVK_TABLE(part) tvk_##part##_avx2
#define TVK_AVX2
#include "kernels/kernels_impl.h"

TVK_LEND(hessian_determinants, avx2);
TVK_LEND(average_columns, avx2);
TVK_LEND(average_rows, avx2);
TVK_LEND(mix_rows, avx2);
TVK_LEND(halve_row, avx2);
TVK_LEND(blur_row, avx2);
TVK_LEND(pair_rows, avx2);
TVK_LEND(sample_patch, avx2);
TVK_LEND(orientation_histogram, avx2);
TVK_LEND(gradient_histogram, avx2);
TVK_LEND(quantize_descriptors, avx2);
TVK_LEND(window_template, avx2);
TVK_LEND(window_sums, avx2);
/* A gather does not pay: the C set's is as fast. */
#define squeeze_row tvk_squeeze_row_c
#include "kernels/kernels_table.h"
