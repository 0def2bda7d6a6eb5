/* A block of TVK_DENSE_BLOCK bytes and what is done with it: the plain form is the definition, the
   others are the same in vectors. gcc does not keep arrays of a loop's own in vectors: it stores
   and loads them, for half of the time of the paths. */

#define EACH(value)                                                       \
  block out;                                                              \
  for (int i = 0; i < TVK_DENSE_BLOCK; ++i) out.at[i] = (uint8_t)(value); \
  return out

/* 128 over the number of views less one, by the number of views; at most 127, as a signed byte. */
static const uint8_t mean_share[16] = {0, 127, 127, 64, 43, 32, 26, 21};

#if defined(TVK_AVX2)
#include <immintrin.h>
typedef __m256i block;
static inline block block_load(const uint8_t *p) { return _mm256_loadu_si256((const block *)p); }
static inline void block_store(uint8_t *p, block v) { _mm256_storeu_si256((block *)p, v); }
static inline block block_of(uint8_t value) { return _mm256_set1_epi8((char)value); }
static inline block block_least(block a, block b) { return _mm256_min_epu8(a, b); }
static inline block block_most(block a, block b) { return _mm256_max_epu8(a, b); }
static inline block block_add(block a, block b) { return _mm256_add_epi8(a, b); }
static inline block block_sum(block a, block b) { return _mm256_adds_epu8(a, b); }
static inline block block_less(block a, block b) { return _mm256_sub_epi8(a, b); }
static inline block block_or(block a, block b) { return _mm256_or_si256(a, b); }
static inline block block_xor(block a, block b) { return _mm256_xor_si256(a, b); }
static inline block block_equal(block a, block b) { return _mm256_cmpeq_epi8(a, b); }
static inline block block_without(block a, block b) { return _mm256_andnot_si256(b, a); }
static inline block block_bits(block v) {
  const block counts = _mm256_setr_epi8(0, 1, 1, 2, 1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4, 0, 1, 1, 2,
                                        1, 2, 2, 3, 1, 2, 2, 3, 2, 3, 3, 4);
  const block low = _mm256_set1_epi8(15);
  return _mm256_add_epi8(
      _mm256_shuffle_epi8(counts, _mm256_and_si256(v, low)),
      _mm256_shuffle_epi8(counts, _mm256_and_si256(_mm256_srli_epi16(v, 4), low)));
}
static inline block block_word_bits(const uint32_t *words, uint32_t other, block *is_absent) {
  const block own = _mm256_set1_epi32((int)other), one = _mm256_set1_epi8(1);
  /* The order in which the packing of halves leaves four words each. */
  const block order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
  block word[4], part[2], pair[4];
  for (int i = 0; i < 4; ++i) {
    word[i] = block_xor(block_load((const uint8_t *)(words + 8 * i)), own);
    pair[i] = _mm256_maddubs_epi16(block_bits(word[i]), one);
  }
  for (int i = 0; i < 2; ++i) {
    part[i] = _mm256_maddubs_epi16(_mm256_packus_epi16(pair[2 * i], pair[2 * i + 1]), one);
  }
  const block bits = _mm256_packus_epi16(part[0], part[1]);
  const block signs = _mm256_packs_epi16(_mm256_packs_epi32(word[0], word[1]),
                                         _mm256_packs_epi32(word[2], word[3]));
  const block absent = _mm256_cmpgt_epi8(_mm256_setzero_si256(), signs);
  *is_absent = _mm256_permutevar8x32_epi32(absent, order);
  return _mm256_permutevar8x32_epi32(_mm256_andnot_si256(absent, bits), order);
}
static inline block block_mean(block sum, block num) {
  const block share = _mm256_shuffle_epi8(
      _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)mean_share)), num);
  const block one = _mm256_set1_epi8(1), half = _mm256_set1_epi8(64);
  const block low =
      _mm256_maddubs_epi16(_mm256_unpacklo_epi8(sum, one), _mm256_unpacklo_epi8(share, half));
  const block high =
      _mm256_maddubs_epi16(_mm256_unpackhi_epi8(sum, one), _mm256_unpackhi_epi8(share, half));
  const block mean = _mm256_packus_epi16(_mm256_srli_epi16(low, 7), _mm256_srli_epi16(high, 7));
  return block_or(
      mean, _mm256_and_si256(block_equal(num, _mm256_setzero_si256()), block_of(TVK_SWEEP_CHANCE)));
}
static inline void block_store_words(uint32_t *p, const block v[4]) {
  const block low = _mm256_unpacklo_epi8(v[0], v[1]), high = _mm256_unpackhi_epi8(v[0], v[1]);
  const block low2 = _mm256_unpacklo_epi8(v[2], v[3]), high2 = _mm256_unpackhi_epi8(v[2], v[3]);
  const block a = _mm256_unpacklo_epi16(low, low2), b = _mm256_unpackhi_epi16(low, low2);
  const block c = _mm256_unpacklo_epi16(high, high2), d = _mm256_unpackhi_epi16(high, high2);
  block_store((uint8_t *)p, _mm256_permute2x128_si256(a, b, 0x20));
  block_store((uint8_t *)(p + 8), _mm256_permute2x128_si256(c, d, 0x20));
  block_store((uint8_t *)(p + 16), _mm256_permute2x128_si256(a, b, 0x31));
  block_store((uint8_t *)(p + 24), _mm256_permute2x128_si256(c, d, 0x31));
}
static inline block block_lowest(block v) {
  __m128i m = _mm_min_epu8(_mm256_castsi256_si128(v), _mm256_extracti128_si256(v, 1));
  m = _mm_min_epu8(m, _mm_srli_epi16(m, 8)); /* the upper byte of each word is then 0 */
  return _mm256_broadcastb_epi8(_mm_minpos_epu16(m));
}
static inline uint8_t block_value(block v) {
  return (uint8_t)_mm_cvtsi128_si32(_mm256_castsi256_si128(v));
}
static inline block block_one_up(block v, block behind) {
  return _mm256_alignr_epi8(v, _mm256_permute2x128_si256(behind, v, 0x21), 15);
}
static inline block block_one_down(block v, block ahead) {
  return _mm256_alignr_epi8(_mm256_permute2x128_si256(v, ahead, 0x21), v, 1);
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
HALF(most, vmaxq_u8)
HALF(add, vaddq_u8)
HALF(sum, vqaddq_u8)
HALF(less, vsubq_u8)
HALF(or, vorrq_u8)
HALF(xor, veorq_u8)
HALF(equal, vceqq_u8)
HALF(without, vbicq_u8)
static inline half half_bits(half v) { return vcntq_u8(v); }
static inline block block_lowest(block v) {
  const half both = vminq_u8(v.a, v.b);
  uint8x8_t m = vpmin_u8(vget_low_u8(both), vget_high_u8(both));
  m = vpmin_u8(m, m);
  m = vpmin_u8(m, m);
  m = vpmin_u8(m, m);
  const half all = vdupq_lane_u8(m, 0);
  return (block){all, all};
}
static inline uint8_t block_value(block v) { return vgetq_lane_u8(v.a, 0); }
static inline block block_one_up(block v, block behind) {
  return (block){vextq_u8(behind.b, v.a, 15), vextq_u8(v.a, v.b, 15)};
}
static inline block block_one_down(block v, block ahead) {
  return (block){vextq_u8(v.a, v.b, 1), vextq_u8(v.b, ahead.a, 1)};
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
/* Eight words: how many bits differ, and whether the highest does. */
static inline uint8x8_t eight_bits(const uint32_t *words, uint32x4_t own, uint8x8_t *is_absent) {
  const uint32x4_t a = veorq_u32(vld1q_u32(words), own), b = veorq_u32(vld1q_u32(words + 4), own);
  const uint32x4_t na = vpaddlq_u16(vpaddlq_u8(vcntq_u8(vreinterpretq_u8_u32(a))));
  const uint32x4_t nb = vpaddlq_u16(vpaddlq_u8(vcntq_u8(vreinterpretq_u8_u32(b))));
  const uint16x8_t high = vcombine_u16(vshrn_n_u32(a, 16), vshrn_n_u32(b, 16));
  const int8x8_t signs = vreinterpret_s8_u8(vshrn_n_u16(high, 8));
  *is_absent = vreinterpret_u8_s8(vshr_n_s8(signs, 7));
  return vbic_u8(vmovn_u16(vcombine_u16(vmovn_u32(na), vmovn_u32(nb))), *is_absent);
}
static inline block block_word_bits(const uint32_t *words, uint32_t other, block *is_absent) {
  const uint32x4_t own = vdupq_n_u32(other);
  uint8x8_t bits[4], absent[4];
  for (int i = 0; i < 4; ++i) bits[i] = eight_bits(words + 8 * i, own, absent + i);
  *is_absent = (block){vcombine_u8(absent[0], absent[1]), vcombine_u8(absent[2], absent[3])};
  return (block){vcombine_u8(bits[0], bits[1]), vcombine_u8(bits[2], bits[3])};
}
static inline uint8x8_t eight_means(uint8x8_t sum, uint8x8_t num) {
  const uint8x8_t mean = vrshrn_n_u16(vmull_u8(sum, vtbl1_u8(vld1_u8(mean_share), num)), 7);
  return vbsl_u8(vceq_u8(num, vdup_n_u8(0)), vdup_n_u8(TVK_SWEEP_CHANCE), mean);
}
static inline half half_means(half sum, half num) {
  return vcombine_u8(eight_means(vget_low_u8(sum), vget_low_u8(num)),
                     eight_means(vget_high_u8(sum), vget_high_u8(num)));
}
static inline block block_mean(block sum, block num) {
  return (block){half_means(sum.a, num.a), half_means(sum.b, num.b)};
}
static inline void block_store_words(uint32_t *p, const block v[4]) {
  vst4q_u8((uint8_t *)p, ((uint8x16x4_t){{v[0].a, v[1].a, v[2].a, v[3].a}}));
  vst4q_u8((uint8_t *)(p + 16), ((uint8x16x4_t){{v[0].b, v[1].b, v[2].b, v[3].b}}));
}
#else
typedef struct block {
  uint8_t at[TVK_DENSE_BLOCK];
} block;
static inline block block_load(const uint8_t *p) { EACH(p[i]); }
static inline void block_store(uint8_t *p, block v) { memcpy(p, v.at, sizeof v.at); }
static inline block block_of(uint8_t value) { EACH(value); }
static inline block block_least(block a, block b) { EACH(a.at[i] < b.at[i] ? a.at[i] : b.at[i]); }
static inline block block_most(block a, block b) { EACH(a.at[i] > b.at[i] ? a.at[i] : b.at[i]); }
static inline block block_add(block a, block b) { EACH(a.at[i] + b.at[i]); }
static inline block block_sum(block a, block b) {
  EACH(a.at[i] + b.at[i] < 255 ? a.at[i] + b.at[i] : 255);
}
static inline block block_less(block a, block b) { EACH(a.at[i] - b.at[i]); }
static inline block block_or(block a, block b) { EACH(a.at[i] | b.at[i]); }
static inline block block_xor(block a, block b) { EACH(a.at[i] ^ b.at[i]); }
static inline block block_equal(block a, block b) { EACH(a.at[i] == b.at[i] ? 255 : 0); }
static inline block block_without(block a, block b) { EACH(a.at[i] & ~b.at[i]); }
static inline block block_bits(block v) { EACH(__builtin_popcount(v.at[i])); }
/* How many bits of each word differ from `other`; where the highest does, 0, and is_absent 255. */
static inline block block_word_bits(const uint32_t *words, uint32_t other, block *is_absent) {
  for (int i = 0; i < TVK_DENSE_BLOCK; ++i) {
    is_absent->at[i] = (words[i] ^ other) >> 31 != 0 ? 255 : 0;
  }
  EACH(is_absent->at[i] != 0 ? 0 : __builtin_popcount(words[i] ^ other));
}
/* The sum over num - 1, or over 1, rounded; without any, TVK_SWEEP_CHANCE. */
static inline block block_mean(block sum, block num) {
  EACH(num.at[i] == 0 ? TVK_SWEEP_CHANCE : (sum.at[i] * mean_share[num.at[i]] + 64) >> 7);
}
/* The i-th bytes of the four as a word, the first one lowest. */
static inline void block_store_words(uint32_t *p, const block v[4]) {
  for (int i = 0; i < TVK_DENSE_BLOCK; ++i) {
    p[i] = (uint32_t)v[0].at[i] | (uint32_t)v[1].at[i] << 8 | (uint32_t)v[2].at[i] << 16 |
           (uint32_t)v[3].at[i] << 24;
  }
}
/* The least entry, in each entry. */
static inline block block_lowest(block v) {
  uint8_t least = v.at[0];
  for (int i = 1; i < TVK_DENSE_BLOCK; ++i) least = v.at[i] < least ? v.at[i] : least;
  return block_of(least);
}
static inline uint8_t block_value(block v) { return v.at[0]; }
/* Each entry one place farther up or down; the free one is taken from the block there. */
static inline block block_one_up(block v, block behind) {
  EACH(i > 0 ? v.at[i - 1] : behind.at[TVK_DENSE_BLOCK - 1]);
}
static inline block block_one_down(block v, block ahead) {
  EACH(i < TVK_DENSE_BLOCK - 1 ? v.at[i + 1] : ahead.at[0]);
}
static inline int block_first(block v) {
  for (int i = 0; i < TVK_DENSE_BLOCK; ++i)
    if (v.at[i] != 0) return i;
  return -1;
}
#endif
#undef EACH
