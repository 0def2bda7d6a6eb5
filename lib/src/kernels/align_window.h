/* The kernels window_template and window_sums of least-squares matching (match/align.cc): bilinear
   samples of a window, and sums of products of them. All is in integers, so that no sum depends on
   its order; the units are those of kernels.h. The two weights of an interpolation are [127 - f, f]
   with f = the first 7 bits of a position's fraction, as in kernels/patch.h. */

enum {
  WINDOW_SIDE = TVK_WINDOW_SIDE,
  WINDOW_OUTER = WINDOW_SIDE + 2, /* with one sample on each side for the slopes */
  WINDOW_PITCH = 16,
  WINDOW_GREY = 2008, /* is subtracted from a sample: 127.5 grey levels */
  WINDOW_ONE = 4096,  /* the constant among the channels */
  ONE_TIMES_WINDOW = 36
};

/* 2^15 exp(-r^2 / (2 2.6^2)) at r = 3.5, 2.5, 1.5 and 0.5 samples, and mirrored. */
static const int16_t window_weights[WINDOW_SIDE] = {13242, 20639, 27744, 32168,
                                                    32168, 27744, 20639, 13242};

#if defined(TVK_AVX2)

/* f, 127 - f as 16-bit numbers of each 32-bit position. */
static inline __m256i window_fractions(__m256i position) {
  return _mm256_and_si256(_mm256_srli_epi32(position, 9), _mm256_set1_epi32(127));
}
static inline __m256i window_word_shares(__m256i fraction) {
  const __m256i both = _mm256_or_si256(fraction, _mm256_slli_epi32(fraction, 16));
  return _mm256_xor_si256(both, _mm256_set1_epi32(127));
}

/* The sums of the eight numbers of each of sums[0..7]. */
static inline __m256i window_totals(const __m256i sums[8]) {
  const __m256i low = sums_of_halves(sums), high = sums_of_halves(sums + 4);
  return _mm256_add_epi32(_mm256_permute2x128_si256(low, high, 0x20),
                          _mm256_permute2x128_si256(low, high, 0x31));
}

static inline __m256i window_load(const int16_t *p) {
  return _mm256_loadu_si256((const __m256i *)p);
}

static inline __m256i window_dot(const __m256i a[4], const int16_t *b) {
  const __m256i ab0 = _mm256_madd_epi16(a[0], window_load(b));
  const __m256i ab1 = _mm256_madd_epi16(a[1], window_load(b + 16));
  const __m256i ab2 = _mm256_madd_epi16(a[2], window_load(b + 32));
  const __m256i ab3 = _mm256_madd_epi16(a[3], window_load(b + 48));
  return _mm256_add_epi32(_mm256_add_epi32(ab0, ab1), _mm256_add_epi32(ab2, ab3));
}

/* The samples of the template: rows of WINDOW_PITCH, of which WINDOW_OUTER count. The pixels of a
   row are picked out of 16 in a register. */
static inline void sample_template(const uint8_t *pixels, int64_t stride, int32_t width, int32_t x,
                                   int32_t y, int32_t step, int16_t *outer) {
  const int32_t first = x >> 16, base = first + 16 <= width ? first : width - 16;
  const __m256i i = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256i near = _mm256_add_epi32(_mm256_set1_epi32(x - (base << 16)),
                                        _mm256_mullo_epi32(i, _mm256_set1_epi32(step)));
  const __m256i far = _mm256_add_epi32(near, _mm256_set1_epi32(8 * step));
  const __m256i left = _mm256_permute4x64_epi64(
      _mm256_packus_epi32(_mm256_srli_epi32(near, 16), _mm256_srli_epi32(far, 16)), 0xd8);
  const __m256i both =
      _mm256_add_epi8(_mm256_or_si256(left, _mm256_slli_epi16(left, 8)), _mm256_set1_epi16(0x100));
  const __m256i f = _mm256_permute4x64_epi64(
      _mm256_packus_epi32(window_fractions(near), window_fractions(far)), 0xd8);
  const __m256i shares =
      _mm256_xor_si256(_mm256_or_si256(f, _mm256_slli_epi16(f, 8)), _mm256_set1_epi16(127));
  int32_t j;
  for (j = 0; j < WINDOW_OUTER; ++j, y += step) {
    const __m128i *const at = (const __m128i *)(pixels + (y >> 16) * stride + base);
    const __m128i *const below = (const __m128i *)((const uint8_t *)at + stride);
    const __m256i a = _mm256_shuffle_epi8(_mm256_broadcastsi128_si256(_mm_loadu_si128(at)), both);
    const __m256i b =
        _mm256_shuffle_epi8(_mm256_broadcastsi128_si256(_mm_loadu_si128(below)), both);
    const __m256i upper = _mm256_maddubs_epi16(a, shares), lower = _mm256_maddubs_epi16(b, shares);
    const __m256i down = window_word_shares(window_fractions(_mm256_set1_epi32(y)));
    const __m256i sums0 = _mm256_madd_epi16(_mm256_unpacklo_epi16(upper, lower), down);
    const __m256i sums1 = _mm256_madd_epi16(_mm256_unpackhi_epi16(upper, lower), down);
    const __m256i row =
        _mm256_packs_epi32(_mm256_srai_epi32(sums0, 10), _mm256_srai_epi32(sums1, 10));
    _mm256_storeu_si256((__m256i *)(outer + WINDOW_PITCH * j),
                        _mm256_sub_epi16(row, _mm256_set1_epi16(WINDOW_GREY)));
  }
}

/* Two rows of the template's samples side by side. */
static inline __m256i window_two(const int16_t *p) {
  return _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128((const __m128i *)p)),
                                 _mm_loadu_si128((const __m128i *)(p + WINDOW_PITCH)), 1);
}

static void window_template(const uint8_t *pixels, int64_t stride, int32_t width, int32_t x,
                            int32_t y, int32_t step, int16_t *channels, int32_t *products) {
  int16_t outer[WINDOW_OUTER * WINDOW_PITCH], plain[TVK_WINDOW_CHANNELS * TVK_WINDOW_SAMPLES];
  const __m256i u = _mm256_broadcastsi128_si256(_mm_setr_epi16(-7, -5, -3, -1, 1, 3, 5, 7));
  const __m256i across =
      _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)window_weights));
  const __m256i four = _mm256_set1_epi16(4);
  __m256i v = _mm256_setr_epi16(-7, -7, -7, -7, -7, -7, -7, -7, -5, -5, -5, -5, -5, -5, -5, -5);
  __m256i sums[TVK_WINDOW_PRODUCTS];
  int32_t j, p, q, n = 0;
  sample_template(pixels, stride, width, x, y, step, outer);
  for (j = 0; j < WINDOW_SIDE; j += 2, v = _mm256_add_epi16(v, four)) {
    const int16_t *const at = outer + WINDOW_PITCH * j;
    const __m256i down =
        _mm256_setr_m128i(_mm_set1_epi16(window_weights[j]), _mm_set1_epi16(window_weights[j + 1]));
    const __m256i weights = _mm256_mulhrs_epi16(down, across);
    const __m256i gx =
        _mm256_sub_epi16(window_two(at + WINDOW_PITCH + 2), window_two(at + WINDOW_PITCH));
    const __m256i gy = _mm256_sub_epi16(window_two(at + 2 * WINDOW_PITCH + 1), window_two(at + 1));
    __m256i values[TVK_WINDOW_CHANNELS] = {_mm256_set1_epi16(WINDOW_ONE),
                                           window_two(at + WINDOW_PITCH + 1),
                                           gx,
                                           gy,
                                           _mm256_mullo_epi16(gx, u),
                                           _mm256_mullo_epi16(gx, v),
                                           _mm256_mullo_epi16(gy, u),
                                           _mm256_mullo_epi16(gy, v)};
    for (p = 0; p < TVK_WINDOW_CHANNELS; ++p) {
      const int32_t k = TVK_WINDOW_SAMPLES * p + WINDOW_SIDE * j;
      if (p >= 4) values[p] = _mm256_srai_epi16(_mm256_add_epi16(values[p], four), 3);
      _mm256_storeu_si256((__m256i *)(plain + k), values[p]);
      _mm256_storeu_si256((__m256i *)(channels + k), _mm256_mulhrs_epi16(values[p], weights));
    }
  }
  TVK_ROLLED
  for (p = 0; p < TVK_WINDOW_CHANNELS; ++p) {
    const int16_t *const at = channels + TVK_WINDOW_SAMPLES * p;
    const __m256i weighted[4] = {window_load(at), window_load(at + 16), window_load(at + 32),
                                 window_load(at + 48)};
    if (p == 0) sums[ONE_TIMES_WINDOW] = window_dot(weighted, plain + TVK_WINDOW_SAMPLES);
    TVK_ROLLED
    for (q = 0; q <= p; ++q) {
      sums[n++] = window_dot(weighted, plain + TVK_WINDOW_SAMPLES * q);
    }
  }
  while (++n < TVK_WINDOW_PRODUCTS) sums[n] = _mm256_setzero_si256();
  for (n = 0; n < TVK_WINDOW_PRODUCTS; n += 8) {
    _mm256_storeu_si256((__m256i *)(products + n), window_totals(sums + n));
  }
}

static void window_sums(const uint8_t *pixels, int64_t stride, int32_t x, int32_t y,
                        const int32_t map[4], const int16_t *channels, int32_t *sums) {
  const __m256i i = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256i spread = _mm256_setr_epi32(0x01010101, 0x05050505, 0x09090909, 0x0d0d0d0d,
                                           0x01010101, 0x05050505, 0x09090909, 0x0d0d0d0d);
  const uint8_t *const base = pixels + (y >> 16) * stride + (x >> 16) - 1;
  const __m256i pitch = _mm256_set1_epi32((int32_t)stride);
  __m256i at_x = _mm256_add_epi32(_mm256_set1_epi32(x & 65535),
                                  _mm256_mullo_epi32(i, _mm256_set1_epi32(map[0])));
  __m256i at_y = _mm256_add_epi32(_mm256_set1_epi32(y & 65535),
                                  _mm256_mullo_epi32(i, _mm256_set1_epi32(map[2])));
  __m256i samples[WINDOW_SIDE], totals[8], squares = _mm256_setzero_si256();
  int32_t lanes[8], j, p;
  for (j = 0; j < WINDOW_SIDE; ++j) {
    const __m256i offset = _mm256_add_epi32(_mm256_mullo_epi32(_mm256_srai_epi32(at_y, 16), pitch),
                                            _mm256_srai_epi32(at_x, 16));
    const __m256i upper = _mm256_i32gather_epi32((const int *)base, offset, 1);
    const __m256i lower = _mm256_i32gather_epi32((const int *)(base + stride), offset, 1);
    const __m256i quads =
        _mm256_blend_epi16(_mm256_srli_epi32(upper, 8), _mm256_slli_epi32(lower, 8), 0xaa);
    const __m256i f = _mm256_and_si256(_mm256_shuffle_epi8(_mm256_srli_epi32(at_x, 1), spread),
                                       _mm256_set1_epi8(127));
    const __m256i rows = _mm256_maddubs_epi16(quads, _mm256_xor_si256(f, _mm256_set1_epi16(127)));
    samples[j] =
        _mm256_srai_epi32(_mm256_madd_epi16(rows, window_word_shares(window_fractions(at_y))), 10);
    at_x = _mm256_add_epi32(at_x, _mm256_set1_epi32(map[1]));
    at_y = _mm256_add_epi32(at_y, _mm256_set1_epi32(map[3]));
  }
  for (p = 0; p < TVK_WINDOW_CHANNELS; ++p) totals[p] = _mm256_setzero_si256();
  for (j = 0; j < WINDOW_SIDE; j += 2) {
    const __m256i two = _mm256_sub_epi16(
        _mm256_permute4x64_epi64(_mm256_packs_epi32(samples[j], samples[j + 1]), 0xd8),
        _mm256_set1_epi16(WINDOW_GREY));
    const int16_t *const at = channels + WINDOW_SIDE * j;
    const __m256i weights = _mm256_slli_epi16(window_load(at), 3);
    squares = _mm256_add_epi32(squares, _mm256_madd_epi16(_mm256_mulhrs_epi16(two, weights), two));
    for (p = 0; p < TVK_WINDOW_CHANNELS; ++p) {
      totals[p] = _mm256_add_epi32(
          totals[p], _mm256_madd_epi16(two, window_load(at + TVK_WINDOW_SAMPLES * p)));
    }
  }
  _mm256_storeu_si256((__m256i *)sums, window_totals(totals));
  _mm256_storeu_si256((__m256i *)lanes, squares);
  sums[8] = 0;
  for (p = 0; p < 8; ++p) sums[8] += lanes[p];
}

#else

static int16_t window_sample(const uint8_t *p, int64_t stride, int32_t x, int32_t y) {
  const uint8_t *const q = p + stride;
  const int32_t right = x >> 9 & 127, below = y >> 9 & 127;
  const int32_t upper = (127 - right) * p[0] + right * p[1];
  const int32_t lower = (127 - right) * q[0] + right * q[1];
  return (int16_t)((((127 - below) * upper + below * lower) >> 10) - WINDOW_GREY);
}

/* a b / 2^15, rounded. */
static inline int16_t window_share(int16_t a, int16_t b) {
  return (int16_t)((a * b + 16384) >> 15);
}

static int32_t window_dot(const int16_t *a, const int16_t *b) {
  int32_t k, sum = 0;
  for (k = 0; k < TVK_WINDOW_SAMPLES; ++k) sum += a[k] * b[k];
  return sum;
}

static void window_template(const uint8_t *pixels, int64_t stride, int32_t width, int32_t x,
                            int32_t y, int32_t step, int16_t *channels, int32_t *products) {
  int16_t outer[WINDOW_OUTER * WINDOW_PITCH], plain[TVK_WINDOW_CHANNELS][TVK_WINDOW_SAMPLES];
  int32_t i, j, p, q, n = 0;
  (void)width;
  for (j = 0; j < WINDOW_OUTER; ++j) {
    const int32_t at_y = y + j * step;
    for (i = 0; i < WINDOW_OUTER; ++i) {
      const int32_t at_x = x + i * step;
      outer[WINDOW_PITCH * j + i] =
          window_sample(pixels + (at_y >> 16) * stride + (at_x >> 16), stride, at_x, at_y);
    }
  }
  for (j = 0; j < WINDOW_SIDE; ++j) {
    const int16_t v = (int16_t)(2 * j - WINDOW_SIDE + 1);
    for (i = 0; i < WINDOW_SIDE; ++i) {
      const int16_t u = (int16_t)(2 * i - WINDOW_SIDE + 1);
      const int16_t *const at = outer + WINDOW_PITCH * (j + 1) + i + 1;
      const int16_t gx = (int16_t)(at[1] - at[-1]);
      const int16_t gy = (int16_t)(at[WINDOW_PITCH] - at[-WINDOW_PITCH]);
      const int32_t k = WINDOW_SIDE * j + i;
      plain[0][k] = WINDOW_ONE;
      plain[1][k] = at[0];
      plain[2][k] = gx;
      plain[3][k] = gy;
      plain[4][k] = (int16_t)((gx * u + 4) >> 3);
      plain[5][k] = (int16_t)((gx * v + 4) >> 3);
      plain[6][k] = (int16_t)((gy * u + 4) >> 3);
      plain[7][k] = (int16_t)((gy * v + 4) >> 3);
      for (p = 0; p < TVK_WINDOW_CHANNELS; ++p) {
        channels[TVK_WINDOW_SAMPLES * p + k] =
            window_share(plain[p][k], window_share(window_weights[i], window_weights[j]));
      }
    }
  }
  for (p = 0; p < TVK_WINDOW_CHANNELS; ++p) {
    for (q = 0; q <= p; ++q) {
      products[n++] = window_dot(channels + TVK_WINDOW_SAMPLES * p, plain[q]);
    }
  }
  products[n++] = window_dot(channels, plain[1]);
  while (n < TVK_WINDOW_PRODUCTS) products[n++] = 0;
}

static void window_sums(const uint8_t *pixels, int64_t stride, int32_t x, int32_t y,
                        const int32_t map[4], const int16_t *channels, int32_t *sums) {
  int16_t samples[TVK_WINDOW_SAMPLES], weighted[TVK_WINDOW_SAMPLES];
  int32_t i, j, p;
  for (j = 0; j < WINDOW_SIDE; ++j) {
    for (i = 0; i < WINDOW_SIDE; ++i) {
      const int32_t k = WINDOW_SIDE * j + i;
      const int32_t at_x = x + i * map[0] + j * map[1], at_y = y + i * map[2] + j * map[3];
      samples[k] = window_sample(pixels + (at_y >> 16) * stride + (at_x >> 16), stride, at_x, at_y);
      weighted[k] = window_share(samples[k], (int16_t)(8 * channels[k]));
    }
  }
  for (p = 0; p < TVK_WINDOW_CHANNELS; ++p) {
    sums[p] = window_dot(channels + TVK_WINDOW_SAMPLES * p, samples);
  }
  sums[8] = window_dot(weighted, samples);
}

#endif
