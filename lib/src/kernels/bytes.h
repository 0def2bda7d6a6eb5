/* Vectors of TVK_BYTES unsigned 8-bit lanes for the pixel kernels: one implementation per
   instruction set, all with the same results. */
#ifndef TWOVIEW_KERNELS_BYTES_H
#define TWOVIEW_KERNELS_BYTES_H

#include <stdint.h>
#include <string.h>

/* bytes_add and bytes_sub saturate at 255 and at 0.
   bytes_any(a): true when some lane is not 0.
   bytes_above(a, b): a bit mask; the bit lane * TVK_BYTES_BITS is set where a > b.
   bytes_where_above(a, b, x): x in the lanes where a > b, 0 in the others. */
#if defined(TVK_AVX512) || defined(TVK_AVX2) || defined(TVK_SSE2)
#include <immintrin.h>
#endif

#if defined(TVK_AVX512)

#define TVK_BYTES 64
#define TVK_BYTES_BITS 1
typedef __m512i byte_lanes;
static inline byte_lanes bytes_load(const uint8_t *p) { return _mm512_loadu_si512(p); }
static inline void bytes_store(uint8_t *p, byte_lanes a) { _mm512_storeu_si512(p, a); }
static inline byte_lanes bytes_of(uint8_t x) { return _mm512_set1_epi8((char)x); }
static inline byte_lanes bytes_min(byte_lanes a, byte_lanes b) { return _mm512_min_epu8(a, b); }
static inline byte_lanes bytes_max(byte_lanes a, byte_lanes b) { return _mm512_max_epu8(a, b); }
static inline byte_lanes bytes_add(byte_lanes a, byte_lanes b) { return _mm512_adds_epu8(a, b); }
static inline byte_lanes bytes_sub(byte_lanes a, byte_lanes b) { return _mm512_subs_epu8(a, b); }
static inline int bytes_any(byte_lanes a) { return _mm512_test_epi8_mask(a, a) != 0; }
static inline uint64_t bytes_above(byte_lanes a, byte_lanes b) {
  return _mm512_cmpgt_epu8_mask(a, b);
}
static inline byte_lanes bytes_where_above(byte_lanes a, byte_lanes b, byte_lanes x) {
  return _mm512_maskz_mov_epi8(_mm512_cmpgt_epu8_mask(a, b), x);
}

#elif defined(TVK_AVX2)

#define TVK_BYTES 32
#define TVK_BYTES_BITS 1
typedef __m256i byte_lanes;
static inline byte_lanes bytes_load(const uint8_t *p) {
  return _mm256_loadu_si256((const __m256i *)p);
}
static inline void bytes_store(uint8_t *p, byte_lanes a) { _mm256_storeu_si256((__m256i *)p, a); }
static inline byte_lanes bytes_of(uint8_t x) { return _mm256_set1_epi8((char)x); }
static inline byte_lanes bytes_min(byte_lanes a, byte_lanes b) { return _mm256_min_epu8(a, b); }
static inline byte_lanes bytes_max(byte_lanes a, byte_lanes b) { return _mm256_max_epu8(a, b); }
static inline byte_lanes bytes_add(byte_lanes a, byte_lanes b) { return _mm256_adds_epu8(a, b); }
static inline byte_lanes bytes_sub(byte_lanes a, byte_lanes b) { return _mm256_subs_epu8(a, b); }
static inline int bytes_any(byte_lanes a) { return !_mm256_testz_si256(a, a); }
static inline byte_lanes bytes_not_above(byte_lanes a, byte_lanes b) {
  return _mm256_cmpeq_epi8(_mm256_min_epu8(a, b), a);
}
static inline uint64_t bytes_above(byte_lanes a, byte_lanes b) {
  return (uint32_t)~_mm256_movemask_epi8(bytes_not_above(a, b));
}
static inline byte_lanes bytes_where_above(byte_lanes a, byte_lanes b, byte_lanes x) {
  return _mm256_andnot_si256(bytes_not_above(a, b), x);
}

#elif defined(TVK_SSE2)

#define TVK_BYTES 16
#define TVK_BYTES_BITS 1
typedef __m128i byte_lanes;
static inline byte_lanes bytes_load(const uint8_t *p) {
  return _mm_loadu_si128((const __m128i *)p);
}
static inline void bytes_store(uint8_t *p, byte_lanes a) { _mm_storeu_si128((__m128i *)p, a); }
static inline byte_lanes bytes_of(uint8_t x) { return _mm_set1_epi8((char)x); }
static inline byte_lanes bytes_min(byte_lanes a, byte_lanes b) { return _mm_min_epu8(a, b); }
static inline byte_lanes bytes_max(byte_lanes a, byte_lanes b) { return _mm_max_epu8(a, b); }
static inline byte_lanes bytes_add(byte_lanes a, byte_lanes b) { return _mm_adds_epu8(a, b); }
static inline byte_lanes bytes_sub(byte_lanes a, byte_lanes b) { return _mm_subs_epu8(a, b); }
static inline int bytes_any(byte_lanes a) {
  return _mm_movemask_epi8(_mm_cmpeq_epi8(a, _mm_setzero_si128())) != 0xffff;
}
static inline byte_lanes bytes_not_above(byte_lanes a, byte_lanes b) {
  return _mm_cmpeq_epi8(_mm_min_epu8(a, b), a);
}
static inline uint64_t bytes_above(byte_lanes a, byte_lanes b) {
  return 0xffff & (uint32_t)~_mm_movemask_epi8(bytes_not_above(a, b));
}
static inline byte_lanes bytes_where_above(byte_lanes a, byte_lanes b, byte_lanes x) {
  return _mm_andnot_si128(bytes_not_above(a, b), x);
}

#elif defined(TVK_NEON)

#include <arm_neon.h>
#define TVK_BYTES 16
#define TVK_BYTES_BITS 4
typedef uint8x16_t byte_lanes;
static inline byte_lanes bytes_load(const uint8_t *p) { return vld1q_u8(p); }
static inline void bytes_store(uint8_t *p, byte_lanes a) { vst1q_u8(p, a); }
static inline byte_lanes bytes_of(uint8_t x) { return vdupq_n_u8(x); }
static inline byte_lanes bytes_min(byte_lanes a, byte_lanes b) { return vminq_u8(a, b); }
static inline byte_lanes bytes_max(byte_lanes a, byte_lanes b) { return vmaxq_u8(a, b); }
static inline byte_lanes bytes_add(byte_lanes a, byte_lanes b) { return vqaddq_u8(a, b); }
static inline byte_lanes bytes_sub(byte_lanes a, byte_lanes b) { return vqsubq_u8(a, b); }
static inline int bytes_any(byte_lanes a) {
  const uint8x8_t halves = vorr_u8(vget_low_u8(a), vget_high_u8(a));
  return vget_lane_u64(vreinterpret_u64_u8(halves), 0) != 0;
}
static inline uint64_t bytes_above(byte_lanes a, byte_lanes b) {
  const uint8x8_t nibbles = vshrn_n_u16(vreinterpretq_u16_u8(vcgtq_u8(a, b)), 4);
  return vget_lane_u64(vreinterpret_u64_u8(nibbles), 0) & 0x1111111111111111u;
}
static inline byte_lanes bytes_where_above(byte_lanes a, byte_lanes b, byte_lanes x) {
  return vandq_u8(vcgtq_u8(a, b), x);
}

#else /* the definition; compilers turn each loop into one vector instruction where they can */

#define TVK_BYTES 16
#define TVK_BYTES_BITS 1
typedef struct byte_lanes {
  uint8_t lane[16];
} byte_lanes;
#define TVK_BYTES_EACH(expression)                               \
  do {                                                           \
    byte_lanes r_;                                               \
    int k;                                                       \
    for (k = 0; k < 16; ++k) r_.lane[k] = (uint8_t)(expression); \
    return r_;                                                   \
  } while (0)
static inline byte_lanes bytes_load(const uint8_t *p) {
  byte_lanes r;
  memcpy(r.lane, p, 16);
  return r;
}
static inline void bytes_store(uint8_t *p, byte_lanes a) { memcpy(p, a.lane, 16); }
static inline byte_lanes bytes_of(uint8_t x) { TVK_BYTES_EACH(x); }
static inline byte_lanes bytes_min(byte_lanes a, byte_lanes b) {
  TVK_BYTES_EACH(a.lane[k] < b.lane[k] ? a.lane[k] : b.lane[k]);
}
static inline byte_lanes bytes_max(byte_lanes a, byte_lanes b) {
  TVK_BYTES_EACH(a.lane[k] > b.lane[k] ? a.lane[k] : b.lane[k]);
}
static inline byte_lanes bytes_sub(byte_lanes a, byte_lanes b) {
  const byte_lanes larger = bytes_max(a, b);
  TVK_BYTES_EACH(larger.lane[k] - b.lane[k]);
}
static inline byte_lanes bytes_add(byte_lanes a, byte_lanes b) {
  byte_lanes room;
  int i;
  for (i = 0; i < 16; ++i) room.lane[i] = (uint8_t)~b.lane[i];
  room = bytes_min(a, room);
  TVK_BYTES_EACH(room.lane[k] + b.lane[k]);
}
static inline int bytes_any(byte_lanes a) {
  uint64_t halves[2];
  memcpy(halves, a.lane, 16);
  return (halves[0] | halves[1]) != 0;
}
static inline uint64_t bytes_above(byte_lanes a, byte_lanes b) {
  byte_lanes is_above;
  uint64_t bits = 0;
  int k;
  for (k = 0; k < 16; ++k) is_above.lane[k] = a.lane[k] > b.lane[k];
  if (!bytes_any(is_above)) return 0;
  for (k = 0; k < 16; ++k) bits |= (uint64_t)is_above.lane[k] << k;
  return bits;
}
static inline byte_lanes bytes_where_above(byte_lanes a, byte_lanes b, byte_lanes x) {
  TVK_BYTES_EACH(a.lane[k] > b.lane[k] ? x.lane[k] : 0);
}

#endif

#endif
