/* The kernel hessian_determinants. All values fit 16 bits but for the determinants themselves,
   which fit 32: smoothed pixels are at most 4080, second derivatives at most 32640. */

static inline words words_binomial(words a, words b, words c, words d, words e) {
  return a + e + (b + d) * words_of(4) + c * words_of(6);
}

static void hessian_determinants(const uint8_t *centre, int64_t stride, int32_t *determinants) {
  enum { PIXELS = 2 * TVK_HESSIAN_REACH + 1, SMOOTHED = PIXELS - 4, FOUND = SMOOTHED - 2 };
  typedef uint16_t unsigned_words __attribute__((vector_size(2 * TVK_WORDS)));
  int16_t rows[PIXELS][16] TVK_ALIGNED, column_sums[16 + 8] TVK_ALIGNED;
  int16_t smoothed[16 + 8] TVK_ALIGNED, xx[TVK_WORDS], yy[TVK_WORDS], xy[TVK_WORDS];
  words along[SMOOTHED], second[SMOOTHED], first[SMOOTHED];
  int k, x, y;
  for (y = 0; y < PIXELS; ++y) {
    uint8_t bytes[16] = {0};
    memcpy(bytes, centre + (y - TVK_HESSIAN_REACH) * stride - TVK_HESSIAN_REACH, PIXELS);
    for (k = 0; k < 16; ++k) rows[y][k] = bytes[k];
  }
  memset(column_sums + 16, 0, 8 * sizeof column_sums[0]);
  memset(smoothed + 16, 0, 8 * sizeof smoothed[0]);
  for (y = 0; y < SMOOTHED; ++y) {
    const int16_t *s = column_sums;
    for (x = 0; x < 16; x += TVK_WORDS) {
      words_store(column_sums + x,
                  words_binomial(words_load(rows[y] + x), words_load(rows[y + 1] + x),
                                 words_load(rows[y + 2] + x), words_load(rows[y + 3] + x),
                                 words_load(rows[y + 4] + x)));
    }
    for (x = 0; x < 16; x += TVK_WORDS) {
      const words sum = words_binomial(words_load(s + x), words_load(s + x + 1),
                                       words_load(s + x + 2), words_load(s + x + 3),
                                       words_load(s + x + 4));
      words_store(smoothed + x, (words)((unsigned_words)(sum + words_of(8)) >> 4));
    }
    {
      const words left = words_load(smoothed), middle = words_load(smoothed + 1) * words_of(2),
                  right = words_load(smoothed + 2);
      along[y] = left + middle + right;
      second[y] = left - middle + right;
      first[y] = right - left;
    }
  }
  for (y = 0; y < FOUND; ++y) {
    words_store(xx, second[y] + second[y + 1] * words_of(2) + second[y + 2]);
    words_store(yy, along[y] - along[y + 1] * words_of(2) + along[y + 2]);
    words_store(xy, first[y + 2] - first[y]);
    for (k = 0; k < 8; ++k) determinants[8 * y + k] = xx[k] * yy[k] - xy[k] * xy[k];
  }
}
