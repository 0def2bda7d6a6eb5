/* One set's kernels on doubles: include with TVK_MATCH(name), their names, defined. Compiled at
   -O2, with the loops that gain from it unrolled by TVK_UNROLL: at -O3 they are twice as large. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "kernels/kernels.h"

#define TVK_DECLARE(name, result, parameters) result TVK_MATCH(name) parameters;
TVK_MATCH_LIST(TVK_DECLARE)
#undef TVK_DECLARE
#if defined(TVK_AVX512)
#define TVK_DECLARE(name, result, parameters) result tvk_##name##_avx2 parameters;
TVK_MATCH_LIST(TVK_DECLARE)
#undef TVK_DECLARE
#endif

/* clang-format off */
#include "kernels/relpose_5pt.h"
#include "kernels/sampson.h"
#if !defined(TVK_AVX512) /* it takes AVX2's */
#include "kernels/transfer.h"
#endif
#include "kernels/triangulate.h"
/* clang-format on */
