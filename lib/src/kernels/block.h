/* A block of TVK_DENSE_BLOCK bytes and what is done with it: the plain form is the definition, the
   others are the same in vectors. gcc does not keep arrays of a loop's own in vectors: it stores
   and loads them, for half of the time of the paths. */

#define EACH(value)                                                       \
  block out;                                                              \
  for (int i = 0; i < TVK_DENSE_BLOCK; ++i) out.at[i] = (uint8_t)(value); \
  return out

#if defined(TVK_AVX2)
#include <immintrin.h>
typedef __m256i block;
static inline block block_load(const uint8_t *p) { return _mm256_loadu_si256((const block *)p); }
static inline void block_store(uint8_t *p, block v) { _mm256_storeu_si256((block *)p, v); }
static inline block block_of(uint8_t value) { return _mm256_set1_epi8((char)value); }
static inline block block_least(block a, block b) { return _mm256_min_epu8(a, b); }
static inline block block_add(block a, block b) { return _mm256_add_epi8(a, b); }
static inline block block_less(block a, block b) { return _mm256_sub_epi8(a, b); }
static inline block block_or(block a, block b) { return _mm256_or_si256(a, b); }
static inline block block_xor(block a, block b) { return _mm256_xor_si256(a, b); }
static inline block block_equal(block a, block b) { return _mm256_cmpeq_epi8(a, b); }
static inline block block_bits(block v) {
  const block counts = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2,
                                        1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
  const block low = _mm256_set1_epi8(15);
  return _mm256_add_epi8(
      _mm256_shuffle_epi8(counts, _mm256_and_si256(v, low)),
      _mm256_shuffle_epi8(counts, _mm256_and_si256(_mm256_srli_epi16(v, 4), low)));
}
static inline uint8_t block_lowest(block v) {
  __m128i m = _mm_min_epu8(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
  m = _mm_min_epu8(m, _mm_srli_epi16(m, 8));
  return (uint8_t)_mm_cvtsi128_si32(_mm_minpos_epu16(_mm_and_si128(m, _mm_set1_epi16(255))));
}
/* The first byte that is not 0, or -1. */
static inline int block_first(block v) {
  const unsigned bits =
      (unsigned)_mm256_movemask_epi8(_mm256_cmpeq_epi8(v, _mm256_setzero_si256()));
  return bits == 0xffffffffu ? -1 : __builtin_ctz(~bits);
}
#elif defined(TVK_NEON)
#include <arm_neon.h>
typedef uint8x16_t half;
#define HALF(name, simd)                               \
  static inline block block_##name(block p, block q) { \
    return (block){simd(p.a, q.a), simd(p.b, q.b)};    \
  }
typedef struct block {
  half a, b;
} block;
static inline half half_load(const uint8_t *p) { return vld1q_u8(p); }
static inline void half_store(uint8_t *p, half v) { vst1q_u8(p, v); }
static inline half half_of(uint8_t value) { return vdupq_n_u8(value); }
HALF(least, vminq_u8)
HALF(add, vaddq_u8)
HALF(less, vsubq_u8)
HALF(or, vorrq_u8)
HALF(xor, veorq_u8)
HALF(equal, vceqq_u8)
static inline half half_bits(half v) { return vcntq_u8(v); }
static inline uint8_t block_lowest(block v) {
  const half both = vminq_u8(v.a, v.b);
  uint8x8_t m = vpmin_u8(vget_low_u8(both), vget_high_u8(both));
  m = vpmin_u8(m, m);
  m = vpmin_u8(m, m);
  m = vpmin_u8(m, m);
  return vget_lane_u8(m, 0);
}
static inline int block_first(block v) {
  uint8_t bytes[TVK_DENSE_BLOCK];
  const uint64x2_t any = vreinterpretq_u64_u8(vorrq_u8(v.a, v.b));
  if ((vgetq_lane_u64(any, 0) | vgetq_lane_u64(any, 1)) == 0) return -1;
  vst1q_u8(bytes, v.a);
  vst1q_u8(bytes + 16, v.b);
  int at = 0;
  while (bytes[at] == 0) ++at;
  return at;
}
static inline block block_load(const uint8_t *p) {
  return (block){half_load(p), half_load(p + TVK_DENSE_BLOCK / 2)};
}
static inline void block_store(uint8_t *p, block v) {
  half_store(p, v.a);
  half_store(p + TVK_DENSE_BLOCK / 2, v.b);
}
static inline block block_of(uint8_t value) { return (block){half_of(value), half_of(value)}; }
static inline block block_bits(block v) { return (block){half_bits(v.a), half_bits(v.b)}; }
#undef HALF
#else
typedef struct block {
  uint8_t at[TVK_DENSE_BLOCK];
} block;
static inline block block_load(const uint8_t *p) { EACH(p[i]); }
static inline void block_store(uint8_t *p, block v) { memcpy(p, v.at, sizeof v.at); }
static inline block block_of(uint8_t value) { EACH(value); }
static inline block block_least(block a, block b) { EACH(a.at[i] < b.at[i] ? a.at[i] : b.at[i]); }
static inline block block_add(block a, block b) { EACH(a.at[i] + b.at[i]); }
static inline block block_less(block a, block b) { EACH(a.at[i] - b.at[i]); }
static inline block block_or(block a, block b) { EACH(a.at[i] | b.at[i]); }
static inline block block_xor(block a, block b) { EACH(a.at[i] ^ b.at[i]); }
static inline block block_equal(block a, block b) { EACH(a.at[i] == b.at[i] ? 255 : 0); }
static inline block block_bits(block v) { EACH(__builtin_popcount(v.at[i])); }
static inline uint8_t block_lowest(block v) {
  uint8_t least = v.at[0];
  for (int i = 1; i < TVK_DENSE_BLOCK; ++i) least = v.at[i] < least ? v.at[i] : least;
  return least;
}
static inline int block_first(block v) {
  for (int i = 0; i < TVK_DENSE_BLOCK; ++i)
    if (v.at[i] != 0) return i;
  return -1;
}
#endif
#undef EACH
