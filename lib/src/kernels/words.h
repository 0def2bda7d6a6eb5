/* Vectors of TVK_WORDS 16-bit lanes for the kernels on patches: as many as fit a register of the
   set, and at most one row of a patch (16). */
#ifndef TWOVIEW_KERNELS_WORDS_H
#define TWOVIEW_KERNELS_WORDS_H

#include <stdint.h>
#include <string.h>

#if defined(__SSE2__)
#include <immintrin.h>
#elif defined(__ARM_NEON)
#include <arm_neon.h>
#endif

#if defined(TVK_AVX2) || defined(TVK_AVX512)
#define TVK_WORDS 16
#else
#define TVK_WORDS 8
#endif

#define TVK_ALIGNED __attribute__((aligned(32)))

typedef int16_t words __attribute__((vector_size(2 * TVK_WORDS))); /* arithmetic must wrap around */
typedef uint16_t unsigned_words __attribute__((vector_size(2 * TVK_WORDS)));
typedef int16_t unaligned_words __attribute__((vector_size(2 * TVK_WORDS), aligned(2), may_alias));

#if defined(TVK_AVX2) || defined(TVK_AVX512)
/* In each half of the result: the sums of the four 32-bit numbers of that half of each of
   vectors[0..3]. Horizontal additions (hadd) take twice as long. */
static inline __m256i sums_of_halves(const __m256i vectors[4]) {
  const __m256i low = _mm256_add_epi32(_mm256_unpacklo_epi32(vectors[0], vectors[1]),
                                       _mm256_unpackhi_epi32(vectors[0], vectors[1]));
  const __m256i high = _mm256_add_epi32(_mm256_unpacklo_epi32(vectors[2], vectors[3]),
                                        _mm256_unpackhi_epi32(vectors[2], vectors[3]));
  return _mm256_add_epi32(_mm256_unpacklo_epi64(low, high), _mm256_unpackhi_epi64(low, high));
}
#endif

static inline words words_of(int16_t a) { return (words){0} + a; }
static inline words words_load(const void *p) { return *(const unaligned_words *)p; }
static inline void words_store(void *p, words a) { *(unaligned_words *)p = a; }

/* words_zip: out[k] = low[k] + 65536 high[k], both read as unsigned. words_scale: a b / 65536,
   rounded down, both read as unsigned. words_excess: a - b, or 0 where b is larger, both read as
   unsigned. */
#if defined(TVK_AVX2) || defined(TVK_AVX512)
static inline words words_min(words a, words b) {
  return (words)_mm256_min_epi16((__m256i)a, (__m256i)b);
}
static inline words words_max(words a, words b) {
  return (words)_mm256_max_epi16((__m256i)a, (__m256i)b);
}
static inline words words_scale(words a, words b) {
  return (words)_mm256_mulhi_epu16((__m256i)a, (__m256i)b);
}
static inline words words_excess(words a, words b) {
  return (words)_mm256_subs_epu16((__m256i)a, (__m256i)b);
}
static inline void words_zip(words low, words high, uint32_t *out) {
  const __m256i a = _mm256_unpacklo_epi16((__m256i)low, (__m256i)high);
  const __m256i b = _mm256_unpackhi_epi16((__m256i)low, (__m256i)high);
  _mm256_storeu_si256((__m256i *)out, _mm256_permute2x128_si256(a, b, 0x20));
  _mm256_storeu_si256((__m256i *)(out + 8), _mm256_permute2x128_si256(a, b, 0x31));
}
#elif defined(__SSE2__)
static inline void words_zip(words low, words high, uint32_t *out) {
  _mm_storeu_si128((__m128i *)out, _mm_unpacklo_epi16((__m128i)low, (__m128i)high));
  _mm_storeu_si128((__m128i *)(out + 4), _mm_unpackhi_epi16((__m128i)low, (__m128i)high));
}
static inline words words_min(words a, words b) {
  return (words)_mm_min_epi16((__m128i)a, (__m128i)b);
}
static inline words words_max(words a, words b) {
  return (words)_mm_max_epi16((__m128i)a, (__m128i)b);
}
static inline words words_scale(words a, words b) {
  return (words)_mm_mulhi_epu16((__m128i)a, (__m128i)b);
}
static inline words words_excess(words a, words b) {
  return (words)_mm_subs_epu16((__m128i)a, (__m128i)b);
}
#elif defined(__ARM_NEON)
static inline void words_zip(words low, words high, uint32_t *out) {
  const uint16x8x2_t both = vzipq_u16((uint16x8_t)low, (uint16x8_t)high);
  vst1q_u32(out, vreinterpretq_u32_u16(both.val[0]));
  vst1q_u32(out + 4, vreinterpretq_u32_u16(both.val[1]));
}
static inline words words_min(words a, words b) {
  return (words)vminq_s16((int16x8_t)a, (int16x8_t)b);
}
static inline words words_max(words a, words b) {
  return (words)vmaxq_s16((int16x8_t)a, (int16x8_t)b);
}
static inline words words_scale(words a, words b) {
  const uint16x8_t ua = (uint16x8_t)a, ub = (uint16x8_t)b;
  return (words)vcombine_u16(vshrn_n_u32(vmull_u16(vget_low_u16(ua), vget_low_u16(ub)), 16),
                             vshrn_n_u32(vmull_u16(vget_high_u16(ua), vget_high_u16(ub)), 16));
}
static inline words words_excess(words a, words b) {
  return (words)vqsubq_u16((uint16x8_t)a, (uint16x8_t)b);
}
#else
static inline void words_zip(words low, words high, uint32_t *out) {
  int k;
  for (k = 0; k < TVK_WORDS; ++k) out[k] = (uint16_t)low[k] | (uint32_t)(uint16_t)high[k] << 16;
}
static inline words words_min(words a, words b) {
  int k;
  for (k = 0; k < TVK_WORDS; ++k) a[k] = a[k] < b[k] ? a[k] : b[k];
  return a;
}
static inline words words_max(words a, words b) {
  int k;
  for (k = 0; k < TVK_WORDS; ++k) a[k] = a[k] > b[k] ? a[k] : b[k];
  return a;
}
static inline words words_scale(words a, words b) {
  int k;
  for (k = 0; k < TVK_WORDS; ++k)
    a[k] = (int16_t)(((uint32_t)(uint16_t)a[k] * (uint16_t)b[k]) >> 16);
  return a;
}
static inline words words_excess(words a, words b) {
  int k;
  for (k = 0; k < TVK_WORDS; ++k) {
    a[k] = (uint16_t)a[k] > (uint16_t)b[k] ? (int16_t)(a[k] - b[k]) : 0;
  }
  return a;
}
#endif

static inline words words_positive(words a) { return words_max(a, words_of(0)); }

#endif
