/* The kernel hessian_determinants. All values fit 16 bits but for the determinants themselves,
   which fit 32: smoothed pixels are at most 4080, second derivatives at most 32640. Each pass is
   over all rows, so that a row is not read, at another offset, just after it was stored. */

/* p[0] + 4 p[step] + 6 p[2 step] + 4 p[3 step] + p[4 step]: of pixels at most 4080, of such sums at
   most 65280, which only unsigned numbers hold. */
static inline unsigned_words binomial(const int16_t *p, int step) {
  const unsigned_words outer =
      (unsigned_words)words_load(p) + (unsigned_words)words_load(p + 4 * step);
  const unsigned_words inner =
      (unsigned_words)words_load(p + step) + (unsigned_words)words_load(p + 3 * step);
  const unsigned_words middle = (unsigned_words)words_load(p + 2 * step);
  return outer + inner * 4 + middle * 6;
}

static void hessian_determinants(const uint8_t *centre, int64_t stride, int32_t *determinants) {
  enum { PIXELS = 2 * TVK_HESSIAN_REACH + 1, SMOOTHED = PIXELS - 4, FOUND = SMOOTHED - 2 };
  enum { PITCH = 16 + 8 };
  typedef uint8_t eight_bytes __attribute__((vector_size(8)));
  typedef int16_t eight_words __attribute__((vector_size(16)));
  int16_t pixels[PIXELS][PITCH] TVK_ALIGNED = {{0}}, sums[SMOOTHED][PITCH] TVK_ALIGNED = {{0}};
  int16_t smoothed[SMOOTHED][PITCH] TVK_ALIGNED = {{0}}, xx[TVK_WORDS], yy[TVK_WORDS],
                                    xy[TVK_WORDS];
  words along[SMOOTHED], second[SMOOTHED], first[SMOOTHED];
  int k, x, y;
  for (y = 0; y < PIXELS; ++y) {
    for (x = 0; x <= PIXELS - 8; x += PIXELS - 8) { /* the first eight pixels, and the last */
      eight_bytes bytes;
      eight_words wide;
      memcpy(&bytes, centre + (y - TVK_HESSIAN_REACH) * stride - TVK_HESSIAN_REACH + x, 8);
      wide = __builtin_convertvector(bytes, eight_words);
      memcpy(pixels[y] + x, &wide, sizeof wide);
    }
  }
  for (y = 0; y < SMOOTHED; ++y) {
    for (x = 0; x < 16; x += TVK_WORDS) {
      words_store(sums[y] + x, (words)binomial(pixels[y] + x, PITCH));
    }
  }
  for (y = 0; y < SMOOTHED; ++y) {
    for (x = 0; x < 16; x += TVK_WORDS) {
      words_store(smoothed[y] + x, (words)((binomial(sums[y] + x, 1) + 8) >> 4));
    }
  }
  for (y = 0; y < SMOOTHED; ++y) {
    const words left = words_load(smoothed[y]), right = words_load(smoothed[y] + 2);
    const words middle = words_load(smoothed[y] + 1) * words_of(2);
    along[y] = left + middle + right;
    second[y] = left - middle + right;
    first[y] = right - left;
  }
  for (y = 0; y < FOUND; ++y) {
    words_store(xx, second[y] + second[y + 1] * words_of(2) + second[y + 2]);
    words_store(yy, along[y] - along[y + 1] * words_of(2) + along[y + 2]);
    words_store(xy, first[y + 2] - first[y]);
    for (k = 0; k < 8; ++k) determinants[8 * y + k] = xx[k] * yy[k] - xy[k] * xy[k];
  }
}
