/* The body of a set's file of kernels on matches. Define TVK_MATCH(name), which gives their names,
   then include this file. It is compiled at -O2, where TVK_UNROLL unrolls the loops that gain from
   it; at -O3 these kernels would be twice as large. */
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
#if !defined(TVK_AVX512) /* the AVX-512 set uses these kernels of the AVX2 set */
#include "kernels/transfer.h"
#endif
#include "kernels/triangulate.h"
/* clang-format on */
