/* The kernels that make the rows of the pyramid: area averages, halving, blur. */

static void average_rows(const uint8_t *const rows[3], const int32_t row_weights[3], int32_t width,
                         uint16_t *sums) {
  const uint8_t *a = rows[0], *b = rows[1], *c = rows[2];
  const int32_t wa = row_weights[0], wb = row_weights[1], wc = row_weights[2];
  int32_t x;
  for (x = 0; x < width; ++x) sums[x] = (uint16_t)(wa * a[x] + wb * b[x] + wc * c[x]);
}

static void average_columns(const uint16_t *sums, const int32_t *first,
                            const int32_t *column_weights, int32_t out_width, uint8_t *out) {
  int32_t x;
  for (x = 0; x < out_width; ++x) {
    const uint16_t *s = sums + first[x];
    const int32_t *w = column_weights + 3 * x;
    int32_t sum = 1 << 15;
    sum += w[0] * s[0];
    if (w[1]) sum += w[1] * s[1];
    if (w[2]) sum += w[2] * s[2];
    out[x] = (uint8_t)(sum >> 16);
  }
}

static void halve_row(const uint8_t *a, const uint8_t *b, int32_t out_width, uint8_t *out) {
  int32_t x;
  for (x = 0; x < out_width; ++x) {
    out[x] = (uint8_t)((a[2 * x] + a[2 * x + 1] + b[2 * x] + b[2 * x + 1] + 2) >> 2);
  }
}

static inline int32_t blur_column(const uint8_t *above, const uint8_t *row, const uint8_t *below,
                                  int32_t x) {
  return above[x] + 2 * row[x] + below[x];
}

enum { BLUR_SPAN = 320 };

/* Sums each column first, in 16 bits: every pixel is then read once, and vectors hold twice as many
   numbers as with 32 bits. */
static inline void blur_span(const uint8_t *above, const uint8_t *row, const uint8_t *below,
                             int32_t begin, int32_t count, uint8_t *out) {
  uint16_t columns[BLUR_SPAN + 2];
  int32_t k;
  for (k = 0; k < count + 2; ++k) {
    columns[k] = (uint16_t)blur_column(above, row, below, begin - 1 + k);
  }
  for (k = 0; k < count; ++k) {
    const uint16_t sum = (uint16_t)(columns[k] + 2 * columns[k + 1] + columns[k + 2] + 8);
    out[begin + k] = (uint8_t)(sum >> 4);
  }
}

static void blur_row(const uint8_t *above, const uint8_t *row, const uint8_t *below, int32_t width,
                     uint8_t *out) {
  const int32_t last = width - 1;
  int32_t x;
  if (last <= BLUR_SPAN) {
    if (last > 1) blur_span(above, row, below, 1, last - 1, out);
  } else {
    for (x = 1; x < last; x += BLUR_SPAN) { /* the last span may overlap the one before it */
      const int32_t begin = x < last - BLUR_SPAN ? x : last - BLUR_SPAN;
      blur_span(above, row, below, begin, BLUR_SPAN, out);
    }
  }
  out[0] = (uint8_t)((3 * blur_column(above, row, below, 0) +
                      blur_column(above, row, below, last > 0 ? 1 : 0) + 8) >>
                     4);
  if (last > 0) {
    out[last] = (uint8_t)((3 * blur_column(above, row, below, last) +
                           blur_column(above, row, below, last - 1) + 8) >>
                          4);
  }
}
