/* The AVX-512 set: the common source compiled for AVX-512 with VNNI, with intrinsics where they
   were measured to be faster. */
#define TVK_TABLE(part) tvk_##part##_avx512
#define TVK_AVX512
#include "kernels/kernels_impl.h"

/* These kernels are other sets', which are as fast, or whose difference does not show in the time
   of a pair. */
#define hessian_determinants tvk_hessian_determinants_avx2
#define average_columns tvk_average_columns_avx2
#define average_rows tvk_average_rows_avx2
#define squeeze_row tvk_squeeze_row_c
#define mix_rows tvk_mix_rows_avx2
#define halve_row tvk_halve_row_avx2
#define blur_row tvk_blur_row_avx2
#define pair_rows tvk_pair_rows_avx2
#define orientation_histogram tvk_orientation_histogram_avx2
#define gradient_histogram tvk_gradient_histogram_avx2
#define quantize_descriptors tvk_quantize_descriptors_avx2
#define window_template tvk_window_template_avx2
#define window_sums tvk_window_sums_avx2
#include "kernels/kernels_table.h"
