/* The kernel hessian_determinants. All values fit 16 bits but for the determinants themselves,
   which fit 32: smoothed pixels are at most 4080, second derivatives at most 32640. */

#if !defined(__SSE2__) && !defined(__ARM_NEON)
/* Without vectors: the definition as it is written in kernels.h. */
static void hessian_determinants(const uint8_t *const centres[2], int64_t stride,
                                 int32_t *determinants) {
  enum { SIDE = 9, PIXELS = 2 * TVK_HESSIAN_REACH + 1 };
  int32_t k, x, y;
  for (k = 0; k < 2; ++k, determinants += TVK_HESSIAN_PLACES) {
    const uint8_t *row = centres[k] - TVK_HESSIAN_REACH * (stride + 1);
    int32_t along[PIXELS][SIDE], smooth[SIDE][SIDE]; /* smoothed along x, and along y as well */
    for (y = 0; y < PIXELS; ++y, row += stride) {
      for (x = 0; x < SIDE; ++x) {
        const uint8_t *p = row + x;
        along[y][x] = p[0] + p[4] + 4 * (p[1] + p[3]) + 6 * p[2];
      }
    }
    for (y = 0; y < SIDE; ++y) {
      for (x = 0; x < SIDE; ++x) {
        smooth[y][x] = (along[y][x] + along[y + 4][x] + 4 * (along[y + 1][x] + along[y + 3][x]) +
                        6 * along[y + 2][x] + 8) >>
                       4;
      }
    }
    for (y = 1; y < SIDE - 1; ++y) {
      for (x = 1; x < SIDE - 1; ++x) {
        const int32_t *above = &smooth[y - 1][x], *at = &smooth[y][x], *below = &smooth[y + 1][x];
        const int32_t corners = above[-1] + above[1] + below[-1] + below[1];
        const int32_t beside = at[-1] + at[1], upright = above[0] + below[0];
        const int32_t xx = corners + 2 * (beside - upright) - 4 * at[0];
        const int32_t yy = corners + 2 * (upright - beside) - 4 * at[0];
        const int32_t xy = below[1] - below[-1] - above[1] + above[-1];
        determinants[8 * (y - 1) + x - 1] = xx * yy - xy * xy;
      }
    }
  }
}
#else
/* The rows of pixels are read once, in order: what later rows need of earlier ones is kept in
   registers. A group of eight lanes holds pixels of one centre; AVX2 has two groups and does both
   centres at once. */
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
  return (unsigned_eights)vmovl_u8(vld1_u8(places[0] + offset));
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
#elif defined(__ARM_NEON)
  const int16x8_t a = (int16x8_t)xx, b = (int16x8_t)yy, c = (int16x8_t)xy;
  const int16x4_t low = vget_low_s16(c), high = vget_high_s16(c);
  vst1q_s32(out, vmlsl_s16(vmull_s16(vget_low_s16(a), vget_low_s16(b)), low, low));
  vst1q_s32(out + 4, vmlsl_s16(vmull_s16(vget_high_s16(a), vget_high_s16(b)), high, high));
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
#endif
