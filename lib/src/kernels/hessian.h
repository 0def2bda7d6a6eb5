/* The kernel hessian_determinants. All values fit 16 bits but for the determinants themselves,
   which fit 32: smoothed pixels are at most 4080, second derivatives at most 32640. The rows of
   pixels are read once, in order: what later rows need of earlier ones is kept in registers. */

typedef int16_t eight_words __attribute__((vector_size(16)));
typedef uint16_t eight_unsigned __attribute__((vector_size(16)));

/* EIGHT_AFTER(a, b, n): the words n .. n + 7 of the sixteen of a and b, 0 < n < 8. */
#if defined(__SSSE3__)
#define EIGHT_AFTER(a, b, n) ((eight_unsigned)_mm_alignr_epi8((__m128i)(b), (__m128i)(a), 2 * (n)))
#elif defined(__SSE2__)
#define EIGHT_AFTER(a, b, n)                                           \
  ((eight_unsigned)_mm_or_si128(_mm_srli_si128((__m128i)(a), 2 * (n)), \
                                _mm_slli_si128((__m128i)(b), 16 - 2 * (n))))
#elif defined(__ARM_NEON)
#define EIGHT_AFTER(a, b, n) ((eight_unsigned)vextq_u16((uint16x8_t)(a), (uint16x8_t)(b), n))
#else
static inline eight_unsigned eight_after(eight_unsigned a, eight_unsigned b, int n) {
  eight_unsigned after;
  int k;
  for (k = 0; k < 8; ++k) after[k] = k + n < 8 ? a[k + n] : b[k + n - 8];
  return after;
}
#define EIGHT_AFTER(a, b, n) eight_after((eight_unsigned)(a), (eight_unsigned)(b), n)
#endif

/* Eight bytes from p on, without the first `skip` of them. */
static inline eight_unsigned load_eight(const uint8_t *p, int skip) {
#if defined(__SSE2__)
  const __m128i bytes = _mm_srli_epi64(_mm_loadl_epi64((const __m128i *)p), 8 * skip);
  return (eight_unsigned)_mm_unpacklo_epi8(bytes, _mm_setzero_si128());
#else
  typedef uint8_t eight_bytes __attribute__((vector_size(8)));
  uint64_t bytes;
  eight_bytes narrow;
  memcpy(&bytes, p, sizeof bytes);
  bytes >>= 8 * skip;
  memcpy(&narrow, &bytes, sizeof narrow);
  return __builtin_convertvector(narrow, eight_unsigned);
#endif
}

/* The sum by (1 4 6 4 1) of the last five rows, the newest of which is `row`. sums[k] is the sum of
   the last k + 1 rows by (1 1)^k. */
static inline eight_unsigned sum_rows(eight_unsigned row, eight_unsigned sums[4]) {
  int k;
  for (k = 0; k < 4; ++k) {
    const eight_unsigned sum = row + sums[k];
    sums[k] = row;
    row = sum;
  }
  return row;
}

static inline eight_words sum_columns(eight_unsigned a, eight_unsigned b, eight_unsigned c,
                                      eight_unsigned d, eight_unsigned e) {
  return (eight_words)((a + e + (b + d) * 4 + c * 6 + 8) >> 4);
}

static void hessian_determinants(const uint8_t *centre, int64_t stride, int32_t *determinants) {
  enum { PIXELS = 2 * TVK_HESSIAN_REACH + 1 };
  const uint8_t *row = centre - TVK_HESSIAN_REACH * (stride + 1);
  eight_unsigned left_sums[4] = {{0}}, right_sums[4] = {{0}};
  /* Along the rows: the sums by (1 2 1), (1 -2 1) and (-1 0 1), of the row before and the one
     before that. */
  eight_words along1 = {0}, along2 = {0}, second1 = {0}, second2 = {0}, first1 = {0}, first2 = {0};
  int y, k;
  TVK_ROLLED
  for (y = 0; y < PIXELS; ++y, row += stride) {
    /* The first eight pixels of the row, and the other five. */
    const eight_unsigned l = sum_rows(load_eight(row, 0), left_sums);
    const eight_unsigned r = sum_rows(load_eight(row + PIXELS - 8, 16 - PIXELS), right_sums);
    if (y < 4) continue; /* fewer than five rows are summed */
    const eight_unsigned l1 = EIGHT_AFTER(l, r, 1), l2 = EIGHT_AFTER(l, r, 2);
    const eight_unsigned l3 = EIGHT_AFTER(l, r, 3), l4 = EIGHT_AFTER(l, r, 4);
    const eight_words left = sum_columns(l, l1, l2, l3, l4);
    const eight_words middle = sum_columns(l1, l2, l3, l4, EIGHT_AFTER(l, r, 5));
    const eight_words right = (eight_words)EIGHT_AFTER(middle, middle, 1);
    const eight_words along = left + right + middle * 2, second = left + right - middle * 2;
    const eight_words first = right - left;
    if (y >= 6) {
      const eight_words xx = second + second1 * 2 + second2, yy = along - along1 * 2 + along2;
      const eight_words xy = first - first2;
      for (k = 0; k < 8; ++k) determinants[8 * (y - 6) + k] = xx[k] * yy[k] - xy[k] * xy[k];
    }
    second2 = second1, second1 = second;
    along2 = along1, along1 = along;
    first2 = first1, first1 = first;
  }
}
