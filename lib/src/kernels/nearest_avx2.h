/* squared_distances of nearest.h by AVX2: four rows at a time share the query's registers and one
   reduction. */
#include <immintrin.h>

static inline __m256i dot_avx2(const __m256i query[8], const int16_t *row) {
  __m256i sum = _mm256_madd_epi16(query[0], _mm256_loadu_si256((const __m256i *)row));
  int k;
  for (k = 1; k < 8; ++k) {
    const __m256i part = _mm256_loadu_si256((const __m256i *)(row + 16 * k));
    sum = _mm256_add_epi32(sum, _mm256_madd_epi16(query[k], part));
  }
  return sum;
}

static void squared_distances(const int16_t *query, int32_t query_norm, const int16_t *rows,
                              const int32_t *norms, int32_t num_rows, int32_t *out) {
  __m256i q[8];
  int32_t j, k;
  for (k = 0; k < 8; ++k) q[k] = _mm256_loadu_si256((const __m256i *)(query + 16 * k));
  for (j = 0; j + 4 <= num_rows; j += 4) {
    const int16_t *row = rows + (int64_t)j * TVK_DESCRIPTOR_SIZE;
    const __m256i ab =
        _mm256_hadd_epi32(dot_avx2(q, row), dot_avx2(q, row + TVK_DESCRIPTOR_SIZE));
    const __m256i cd = _mm256_hadd_epi32(dot_avx2(q, row + 2 * TVK_DESCRIPTOR_SIZE),
                                         dot_avx2(q, row + 3 * TVK_DESCRIPTOR_SIZE));
    const __m256i halves = _mm256_hadd_epi32(ab, cd);
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
