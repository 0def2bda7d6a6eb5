/* The kernel hessian_determinants. All values fit 16 bits but for the determinants themselves,
   which fit 32: smoothed pixels are at most 4080, second derivatives at most 32640. The rows of
   pixels are read once, in order: what later rows need of earlier ones is kept in registers. A
   group of eight lanes holds pixels of one centre; AVX2 has two groups and does both centres at
   once. */

#if defined(TVK_AVX2) || defined(TVK_AVX512)
enum { HESSIAN_CENTRES = 2 };
#else
enum { HESSIAN_CENTRES = 1 };
#endif

typedef int16_t eights __attribute__((vector_size(16 * HESSIAN_CENTRES)));
typedef uint16_t unsigned_eights __attribute__((vector_size(16 * HESSIAN_CENTRES)));

/* EIGHTS_AFTER(a, b, n): of each group the words n .. n + 7 of the sixteen of a and b, 0 < n < 8.
 */
#if defined(TVK_AVX2) || defined(TVK_AVX512)
#define EIGHTS_AFTER(a, b, n) \
  ((unsigned_eights)_mm256_alignr_epi8((__m256i)(b), (__m256i)(a), 2 * (n)))
#elif defined(__SSSE3__)
#define EIGHTS_AFTER(a, b, n) \
  ((unsigned_eights)_mm_alignr_epi8((__m128i)(b), (__m128i)(a), 2 * (n)))
#elif defined(__SSE2__)
#define EIGHTS_AFTER(a, b, n)                                           \
  ((unsigned_eights)_mm_or_si128(_mm_srli_si128((__m128i)(a), 2 * (n)), \
                                 _mm_slli_si128((__m128i)(b), 16 - 2 * (n))))
#elif defined(__ARM_NEON)
#define EIGHTS_AFTER(a, b, n) ((unsigned_eights)vextq_u16((uint16x8_t)(a), (uint16x8_t)(b), n))
#else
static inline unsigned_eights eights_after(unsigned_eights a, unsigned_eights b, int n) {
  unsigned_eights after;
  int k;
  for (k = 0; k < 8; ++k) after[k] = k + n < 8 ? a[k + n] : b[k + n - 8];
  return after;
}
#define EIGHTS_AFTER(a, b, n) eights_after((unsigned_eights)(a), (unsigned_eights)(b), n)
#endif

/* The eight bytes `offset` after each of the places. */
static inline unsigned_eights load_eights(const uint8_t *const *places, int64_t offset) {
#if defined(TVK_AVX2) || defined(TVK_AVX512)
  const __m128i first = _mm_loadl_epi64((const __m128i *)(places[0] + offset));
  const __m128i second = _mm_loadl_epi64((const __m128i *)(places[1] + offset));
  return (unsigned_eights)_mm256_cvtepu8_epi16(_mm_unpacklo_epi64(first, second));
#elif defined(__SSE2__)
  const __m128i bytes = _mm_loadl_epi64((const __m128i *)(places[0] + offset));
  return (unsigned_eights)_mm_unpacklo_epi8(bytes, _mm_setzero_si128());
#else
  typedef uint8_t eight_bytes __attribute__((vector_size(8)));
  eight_bytes bytes;
  memcpy(&bytes, places[0] + offset, sizeof bytes);
  return __builtin_convertvector(bytes, unsigned_eights);
#endif
}

/* The sum by (1 4 6 4 1) of the last five rows, the newest of which is `row`. sums[k] is the sum of
   the last k + 1 rows by (1 1)^k. */
static inline unsigned_eights sum_rows(unsigned_eights row, unsigned_eights sums[4]) {
  int k;
  for (k = 0; k < 4; ++k) {
    const unsigned_eights sum = row + sums[k];
    sums[k] = row;
    row = sum;
  }
  return row;
}

static inline eights sum_columns(unsigned_eights a, unsigned_eights b, unsigned_eights c,
                                 unsigned_eights d, unsigned_eights e) {
  return (eights)((a + e + (b + d) * 4 + c * 6 + 8) >> 4);
}

/* Writes xx yy - xy^2 of the first centre to out, and of the second one TVK_HESSIAN_PLACES after
   it. */
static inline void store_determinants(eights xx, eights yy, eights xy, int32_t *out) {
#if defined(TVK_AVX2) || defined(TVK_AVX512)
  const __m256i a = (__m256i)xx, b = (__m256i)xy, c = (__m256i)yy, d = (__m256i)-xy;
  const __m256i low = _mm256_madd_epi16(_mm256_unpacklo_epi16(a, b), _mm256_unpacklo_epi16(c, d));
  const __m256i high = _mm256_madd_epi16(_mm256_unpackhi_epi16(a, b), _mm256_unpackhi_epi16(c, d));
  _mm256_storeu_si256((__m256i *)out, _mm256_permute2x128_si256(low, high, 0x20));
  _mm256_storeu_si256((__m256i *)(out + TVK_HESSIAN_PLACES),
                      _mm256_permute2x128_si256(low, high, 0x31));
#else
  int k;
  for (k = 0; k < 8; ++k) out[k] = xx[k] * yy[k] - xy[k] * xy[k];
#endif
}

/* The determinants around HESSIAN_CENTRES centres. */
static void determinants_around(const uint8_t *const *centres, int64_t stride,
                                int32_t *determinants) {
  enum { PIXELS = 2 * TVK_HESSIAN_REACH + 1 };
  int64_t row = -TVK_HESSIAN_REACH * (stride + 1);
  unsigned_eights left_sums[4] = {{0}}, right_sums[4] = {{0}};
  /* Along the rows: the sums by (1 2 1), (1 -2 1) and (-1 0 1), of the row before and the one
     before that. */
  eights along1 = {0}, along2 = {0}, second1 = {0}, second2 = {0}, first1 = {0}, first2 = {0};
  int y;
  TVK_ROLLED
  for (y = 0; y < PIXELS; ++y, row += stride) {
    /* The first eight pixels of the row, and the last eight, three of which are the same. */
    const unsigned_eights l = sum_rows(load_eights(centres, row), left_sums);
    const unsigned_eights end = sum_rows(load_eights(centres, row + PIXELS - 8), right_sums);
    if (y < 4) continue; /* fewer than five rows are summed */
    const unsigned_eights r = EIGHTS_AFTER(end, end, 16 - PIXELS);
    const unsigned_eights l1 = EIGHTS_AFTER(l, r, 1), l2 = EIGHTS_AFTER(l, r, 2);
    const unsigned_eights l3 = EIGHTS_AFTER(l, r, 3), l4 = EIGHTS_AFTER(l, r, 4);
    const eights left = sum_columns(l, l1, l2, l3, l4);
    const eights middle = sum_columns(l1, l2, l3, l4, EIGHTS_AFTER(l, r, 5));
    const eights right = (eights)EIGHTS_AFTER(middle, middle, 1);
    const eights along = left + right + middle * 2, second = left + right - middle * 2;
    const eights first = right - left;
    if (y >= 6) {
      store_determinants(second + second1 * 2 + second2, along - along1 * 2 + along2,
                         first - first2, determinants + 8 * (y - 6));
    }
    second2 = second1, second1 = second;
    along2 = along1, along1 = along;
    first2 = first1, first1 = first;
  }
}

static void hessian_determinants(const uint8_t *const centres[2], int64_t stride,
                                 int32_t *determinants) {
  int32_t k;
  TVK_ROLLED
  for (k = 0; k < 2; k += HESSIAN_CENTRES) {
    determinants_around(centres + k, stride, determinants + k * TVK_HESSIAN_PLACES);
  }
}
