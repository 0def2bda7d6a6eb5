/* squared_distances of nearest.h by AVX-512 VNNI: a dot product of 128 is four instructions. */
#include <immintrin.h>

static inline __m512i dot_avx512(const __m512i query[4], const int16_t *row) {
  __m512i sum = _mm512_setzero_si512();
  int k;
  for (k = 0; k < 4; ++k) {
    sum = _mm512_dpwssd_epi32(sum, query[k], _mm512_loadu_si512(row + 32 * k));
  }
  return sum;
}

/* Neighbours added, interleaved: (a0+a1', b0+b1', ..) within each 128-bit lane. */
static inline __m512i add_pairs_avx512(__m512i a, __m512i b) {
  return _mm512_add_epi32(_mm512_unpacklo_epi32(a, b), _mm512_unpackhi_epi32(a, b));
}

static void squared_distances(const int16_t *query, int32_t query_norm, const int16_t *rows,
                              const int32_t *norms, int32_t num_rows, int32_t *out) {
  __m512i q[4];
  int32_t j, k;
  for (k = 0; k < 4; ++k) q[k] = _mm512_loadu_si512(query + 32 * k);
  for (j = 0; j + 4 <= num_rows; j += 4) {
    const int16_t *row = rows + (int64_t)j * TVK_DESCRIPTOR_SIZE;
    const __m512i ab =
        add_pairs_avx512(dot_avx512(q, row), dot_avx512(q, row + TVK_DESCRIPTOR_SIZE));
    const __m512i cd = add_pairs_avx512(dot_avx512(q, row + 2 * TVK_DESCRIPTOR_SIZE),
                                        dot_avx512(q, row + 3 * TVK_DESCRIPTOR_SIZE));
    const __m512i lanes =
        _mm512_add_epi32(_mm512_unpacklo_epi64(ab, cd), _mm512_unpackhi_epi64(ab, cd));
    const __m256i halves = _mm256_add_epi32(_mm512_castsi512_si256(lanes),
                                            _mm512_extracti64x4_epi64(lanes, 1));
    const __m128i dots = _mm_add_epi32(_mm256_castsi256_si128(halves),
                                       _mm256_extracti128_si256(halves, 1));
    const __m128i sums = _mm_add_epi32(_mm_set1_epi32(query_norm),
                                       _mm_loadu_si128((const __m128i *)(norms + j)));
    _mm_storeu_si128((__m128i *)(out + j), _mm_sub_epi32(sums, _mm_slli_epi32(dots, 1)));
  }
  for (; j < num_rows; ++j) {
    out[j] = query_norm + norms[j] - 2 * dot_128(query, rows + (int64_t)j * TVK_DESCRIPTOR_SIZE);
  }
}
