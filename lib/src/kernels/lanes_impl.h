/* The body of a set's file of kernels on matches. Define TVK_GEOMETRY(name), which gives their
   names, and TVK_GEOMETRY_TABLE, then include this file. It is compiled at -O2, where TVK_UNROLL
   unrolls the loops that gain from it; at -O3 these kernels would be twice as large. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kernels/kernels.h"

#define TVK_DECLARE(name, result, parameters) result TVK_GEOMETRY(name) parameters;
TVK_GEOMETRY_LIST(TVK_DECLARE)
#undef TVK_DECLARE
#if defined(TVK_AVX512)
#define TVK_DECLARE(name, result, parameters) result tvk_##name##_avx2 parameters;
TVK_GEOMETRY_LIST(TVK_DECLARE)
#undef TVK_DECLARE
#endif

/* clang-format off */
#include "kernels/relpose_5pt.h"
#include "kernels/sampson.h"
#if !defined(TVK_AVX512) /* the AVX-512 set uses these kernels of the AVX2 set */
#include "kernels/transfer.h"
#endif
#include "kernels/triangulate.h"
/* clang-format on */

#if defined(TVK_AVX512)
/* The transfer kernels are AVX2's. Only homographies and rotations, the rivals of the epipolar
   model, use them: a hundredth of the time of an estimate. */
#define tvk_transfer_squares_avx512 tvk_transfer_squares_avx2
#define tvk_transfer_sums_avx512 tvk_transfer_sums_avx2
#endif
extern const tvk_geometry_table TVK_GEOMETRY_TABLE;
const tvk_geometry_table TVK_GEOMETRY_TABLE = {
#define TVK_ENTRY(name, result, parameters) TVK_GEOMETRY(name),
    TVK_GEOMETRY_LIST(TVK_ENTRY)
#undef TVK_ENTRY
};
