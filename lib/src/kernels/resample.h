/* The kernels that make the rows of the pyramid: area averages, halving, blur. */

#include "kernels/words.h"

#if defined(TVK_AVX2) || defined(TVK_AVX512) || defined(TVK_NEON)

/* The pixels that are picked for TVK_WORDS columns. first[0] is that of the first eight. */
static inline unsigned_words pick_pixels(const uint8_t *row, const int32_t *first, words picks) {
#if defined(TVK_NEON) && defined(__aarch64__)
  return (unsigned_words)vqtbl1q_u8(vld1q_u8(row + first[0]), (uint8x16_t)picks);
#elif defined(TVK_NEON)
  const uint8x16_t pixels = vld1q_u8(row + first[0]), bytes = (uint8x16_t)picks;
  const uint8x8x2_t both = {{vget_low_u8(pixels), vget_high_u8(pixels)}};
  return (unsigned_words)vcombine_u8(vtbl2_u8(both, vget_low_u8(bytes)),
                                     vtbl2_u8(both, vget_high_u8(bytes)));
#else
  const __m128i near_pixels = _mm_loadu_si128((const __m128i *)(row + first[0]));
  const __m128i far_pixels = _mm_loadu_si128((const __m128i *)(row + first[1]));
  return (unsigned_words)_mm256_shuffle_epi8(_mm256_set_m128i(far_pixels, near_pixels),
                                             (__m256i)picks);
#endif
}

static void average_columns(const uint8_t *row, const tvk_columns *columns, int32_t out_width,
                            uint16_t *sums) {
  int32_t x, k;
  for (x = 0; x < out_width; x += TVK_WORDS) {
    unsigned_words sum = {0};
    for (k = 0; k < 3; ++k) {
      sum += pick_pixels(row + k, columns->first + x / 8, words_load(columns->picks + x)) *
             (unsigned_words)words_load(columns->weights[k] + x);
    }
    words_store(sums + x, (words)sum);
  }
}

#else

static void average_columns(const uint8_t *row, const tvk_columns *columns, int32_t out_width,
                            uint16_t *sums) {
  int32_t x;
  for (x = 0; x < out_width; ++x) {
    const uint8_t *at = row + columns->first[x / 8] + (columns->picks[x] & 15);
    sums[x] = (uint16_t)(columns->weights[0][x] * at[0] + columns->weights[1][x] * at[1] +
                         columns->weights[2][x] * at[2]);
  }
}

#endif

/* The high and the low bytes of the rows are summed apart, so that 16 bits suffice: each sum is
   at most 255 * 256. */
static void average_rows(const uint16_t *const rows[3], const int32_t row_weights[3], int32_t width,
                         uint8_t *out) {
  typedef uint8_t narrow __attribute__((vector_size(TVK_WORDS)));
  const int32_t last = width - TVK_WORDS;
  int32_t x, k;
  for (x = 0; x < width; x += TVK_WORDS) { /* the last block may overlap its predecessor */
    const int32_t at = x < last ? x : last;
    unsigned_words high = {0}, low = {0};
    narrow bytes;
    for (k = 0; k < 3; ++k) {
      const unsigned_words row = (unsigned_words)words_load(rows[k] + at);
      high += (row >> 8) * (uint16_t)row_weights[k];
      low += (row & 255) * (uint16_t)row_weights[k];
    }
    bytes = __builtin_convertvector((high + (low >> 8) + 128) >> 8, narrow);
    memcpy(out + at, &bytes, sizeof bytes);
  }
}

/* The integral of a row from its left edge to x, in 1 / 65536 of a grey level and modulo 2^32,
   since only differences are used, which are below that. */
static inline uint32_t integral_to(const uint8_t *row, const uint32_t *sums, int32_t last,
                                   int64_t x) {
  const int64_t pixel = x >> 16;
  const int64_t at = pixel < 0 ? 0 : pixel > last ? last : pixel;
  return (sums[at] << 16) + (uint32_t)(x - at * 65536) * row[at];
}

static void squeeze_row(const uint8_t *row, int32_t width, int64_t begin, int32_t step,
                        int32_t out_width, uint32_t *sums, uint16_t *out) {
  const uint64_t scale = (((uint64_t)1 << 40) + (uint64_t)step / 2) / (uint64_t)step;
  uint32_t sum = 0, before;
  int32_t x;
  for (x = 0; x < width; ++x) {
    sums[x] = sum;
    sum += row[x];
  }
  before = integral_to(row, sums, width - 1, begin);
  for (x = 0; x < out_width; ++x) {
    const uint32_t after = integral_to(row, sums, width - 1, begin += step);
    out[x] = (uint16_t)(((uint32_t)(after - before) * scale + ((uint64_t)1 << 31)) >> 32);
    before = after;
  }
}

static void mix_rows(const uint16_t *const rows[TVK_MIX_ROWS], const int32_t weights[TVK_MIX_ROWS],
                     int32_t width, uint8_t *out) {
  const uint16_t *const a = rows[0], *const b = rows[1], *const c = rows[2], *const d = rows[3];
  const uint32_t wa = (uint32_t)weights[0], wb = (uint32_t)weights[1], wc = (uint32_t)weights[2],
                 wd = (uint32_t)weights[3];
  int32_t x;
  for (x = 0; x < width; ++x) {
    out[x] = (uint8_t)((a[x] * wa + b[x] * wb + c[x] * wc + d[x] * wd + 32768) >> 16);
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
