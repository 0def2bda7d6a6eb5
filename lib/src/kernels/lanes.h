/* Vectors of TVK_LANES doubles for the kernels on matches: each operation is the same IEEE
   operation on every lane. Arrays are laid out for TVK_WIDTH lanes in every set, so that sums over
   matches are added in one written order. */
#ifndef TWOVIEW_KERNELS_LANES_H
#define TWOVIEW_KERNELS_LANES_H

#include <math.h>
#include <stdint.h>

#include "kernels/kernels.h"

#if defined(TVK_AVX512)
#define TVK_LANES 8
#elif defined(TVK_AVX2)
#define TVK_LANES 4
#else
#define TVK_LANES 2
#endif

#if defined(__SSE2__)
#include <immintrin.h>
#endif

/* Put before a loop that should be unrolled: its number of turns is a constant of at most 10. */
#if defined(__OPTIMIZE_SIZE__)
#define TVK_UNROLL
#elif defined(__clang__)
#define TVK_UNROLL _Pragma("unroll")
#else
#define TVK_UNROLL _Pragma("GCC unroll 10")
#endif

/* Names the variant of a kernel for rays that are not on the image plane, those of wide lenses.
   AVX-512 uses AVX2's, to save code size. */
#if defined(TVK_AVX512)
#define TVK_ON_SPHERE(kernel, own) tvk_##kernel##_avx2
#else
#define TVK_ON_SPHERE(kernel, own) own
#endif

/* For functions that are compiled twice: for rays on the image plane and for rays on the sphere. */
#define TVK_INLINE inline __attribute__((always_inline))

typedef double lanes __attribute__((vector_size(8 * TVK_LANES)));
typedef int64_t lane_mask __attribute__((vector_size(8 * TVK_LANES))); /* lanes are -1 or 0 */
typedef double unaligned_lanes __attribute__((vector_size(8 * TVK_LANES), aligned(8), may_alias));

static inline lanes lanes_of(double x) { return (lanes){0} + x; }
static inline lanes lanes_load(const double *p) { return *(const unaligned_lanes *)p; }
static inline void lanes_store(double *p, lanes x) { *(unaligned_lanes *)p = x; }
static inline lanes lanes_select(lane_mask mask, lanes a, lanes b) {
  return (lanes)((mask & (lane_mask)a) | (~mask & (lane_mask)b));
}
/* a in the lanes where the mask is set, 0 in the others. */
static inline lanes lanes_keep(lane_mask mask, lanes a) { return (lanes)(mask & (lane_mask)a); }
/* The lanes with the given numbers: 0 .. TVK_LANES - 1 are those of a, TVK_LANES .. those of b. */
#if defined(__clang__)
#define lanes_shuffle(a, b, ...) __builtin_shufflevector(a, b, __VA_ARGS__)
#else
#define lanes_shuffle(a, b, ...) __builtin_shuffle(a, b, (lane_mask){__VA_ARGS__})
#endif
#if TVK_LANES == 8
#define LANES_EVEN 0, 2, 4, 6, 8, 10, 12, 14
#define LANES_ODD 1, 3, 5, 7, 9, 11, 13, 15
#define LANES_EVEN_PAIRS 0, 8, 2, 10, 4, 12, 6, 14
#define LANES_ODD_PAIRS 1, 9, 3, 11, 5, 13, 7, 15
#elif TVK_LANES == 4
#define LANES_EVEN 0, 2, 4, 6
#define LANES_ODD 1, 3, 5, 7
#define LANES_EVEN_PAIRS 0, 4, 2, 6
#define LANES_ODD_PAIRS 1, 5, 3, 7
#else
#define LANES_EVEN 0, 2
#define LANES_ODD 1, 3
#define LANES_EVEN_PAIRS 0, 2
#define LANES_ODD_PAIRS 1, 3
#endif
static inline lanes lanes_abs(lanes a) { return (lanes)((lane_mask)a & INT64_MAX); }
static inline lanes lanes_sqrt(lanes a) {
#if defined(TVK_AVX512)
  return (lanes)_mm512_sqrt_pd((__m512d)a);
#elif defined(TVK_AVX2)
  return (lanes)_mm256_sqrt_pd((__m256d)a);
#elif defined(__SSE2__)
  return (lanes)_mm_sqrt_pd((__m128d)a);
#else
  int k;
  for (k = 0; k < TVK_LANES; ++k) a[k] = sqrt(a[k]);
  return a;
#endif
}
static inline int lanes_any(lane_mask mask) {
#if defined(TVK_AVX512)
  return _mm512_test_epi64_mask((__m512i)mask, (__m512i)mask) != 0;
#elif defined(TVK_AVX2)
  return !_mm256_testz_si256((__m256i)mask, (__m256i)mask);
#else
  int64_t any = 0;
  int k;
  for (k = 0; k < TVK_LANES; ++k) any |= mask[k];
  return any != 0;
#endif
}

#endif
