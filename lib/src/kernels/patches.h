/* Windows of the images around the chosen steps, and the images themselves along rows of the grid.
 */

void TVK_DENSE(support_row)(const int16_t *const *rows, int32_t width, uint8_t *support,
                            uint8_t *alike, int8_t *slant) {
  enum { REACH = TVK_DENSE_REACH, BLOCK = TVK_DENSE_SPAN };
  for (int32_t x = 0; x < width; x += BLOCK) {
    const int16_t *const own = rows[REACH] + REACH + x;
    int16_t near_count[BLOCK] = {0}, far_count[BLOCK] = {0}, sum[BLOCK] = {0};
    for (int v = 0; v <= 2 * REACH; ++v) {
      for (int u = 0; u <= 2 * REACH; ++u) {
        const int is_near = v > 0 && u > 0 && v < 2 * REACH && u < 2 * REACH;
        const int16_t *const other = rows[v] + x + u;
        int16_t *const count = is_near ? near_count : far_count;
        for (int i = 0; i < BLOCK; ++i) {
          const uint16_t change = (uint16_t)(other[i] - own[i] + 1);
          const int16_t like = change <= 2 ? -1 : 0;
          count[i] = (int16_t)(count[i] - like);
          sum[i] = (int16_t)(sum[i] + (like & change));
        }
      }
    }
    for (int i = 0; i < BLOCK; ++i) {
      support[x + i] = (uint8_t)near_count[i];
      alike[x + i] = (uint8_t)(near_count[i] + far_count[i]);
      slant[x + i] = (int8_t)(sum[i] - near_count[i] - far_count[i]);
    }
  }
}

/* Adds the products of the cells of row n to the sums over columns, and takes those of row `old`
   off them unless it is negative. */
static void add_products(const tvk_dense_rows *rows, int n, int old, int32_t pitch,
                         int32_t *restrict columns) {
  static const uint8_t no_bytes[TVK_DENSE_SPAN];
  static const int16_t no_words[TVK_DENSE_SPAN];
  const int32_t next = pitch + TVK_DENSE_SPAN;
  for (int32_t x = 0; x < pitch; x += TVK_DENSE_SPAN) {
    const uint8_t *const a = rows->a[n] + x, *const b = rows->b[n] + x;
    const uint8_t *const is_cell = rows->is_cell[n] + x;
    const int16_t *const g = rows->g[n] + x;
    const uint8_t *const c = old < 0 ? no_bytes : rows->a[old] + x;
    const uint8_t *const d = old < 0 ? no_bytes : rows->b[old] + x;
    const uint8_t *const was_cell = old < 0 ? no_bytes : rows->is_cell[old] + x;
    const int16_t *const h = old < 0 ? no_words : rows->g[old] + x;
    int32_t *const to = columns + x;
#if defined(TVK_AVX2)
    /* Pairs of words, the new one and the old one, so that one instruction makes both products. */
    const __m256i low = _mm256_set1_epi32(0xffff), zero = _mm256_setzero_si256();
#define BYTES(p) _mm256_cvtepu8_epi32(_mm_loadl_epi64((const __m128i *)((p) + i)))
#define WORDS(p) _mm256_cvtepi16_epi32(_mm_loadu_si128((const __m128i *)((p) + i)))
#define ADD(k, value)                 \
  _mm256_storeu_si256(                \
      (__m256i *)(to + (k)*next + i), \
      _mm256_add_epi32((value), _mm256_loadu_si256((const __m256i *)(to + (k)*next + i))))
    for (int i = 0; i < TVK_DENSE_SPAN; i += 8) {
      const __m256i a1 = BYTES(a), b1 = BYTES(b), g1 = WORDS(g);
      const __m256i a0 = BYTES(c), b0 = BYTES(d), g0 = WORDS(h);
      const __m256i ga = _mm256_slli_epi32(a0, 16), gb = _mm256_slli_epi32(b0, 16);
      const __m256i gg = _mm256_slli_epi32(g0, 16), gl = _mm256_and_si256(g1, low);
      const __m256i pa = _mm256_or_si256(a1, ga), pb = _mm256_or_si256(b1, gb);
      const __m256i pg = _mm256_or_si256(gl, gg);
      const __m256i na = _mm256_or_si256(a1, _mm256_sub_epi32(zero, ga));
      const __m256i nb = _mm256_or_si256(b1, _mm256_sub_epi32(zero, gb));
      const __m256i ng = _mm256_or_si256(gl, _mm256_sub_epi32(zero, gg));
      ADD(0, _mm256_sub_epi32(a1, a0));
      ADD(1, _mm256_sub_epi32(b1, b0));
      ADD(2, _mm256_sub_epi32(g1, g0));
      ADD(3, _mm256_madd_epi16(pa, na));
      ADD(4, _mm256_madd_epi16(pb, nb));
      ADD(5, _mm256_madd_epi16(pg, ng));
      ADD(6, _mm256_madd_epi16(pa, nb));
      ADD(7, _mm256_madd_epi16(pa, ng));
      ADD(8, _mm256_madd_epi16(pb, ng));
      ADD(9, _mm256_sub_epi32(BYTES(is_cell), BYTES(was_cell)));
    }
#undef BYTES
#undef WORDS
#else
#define ADD(k, value) \
  for (int i = 0; i < TVK_DENSE_SPAN; ++i) to[(k)*next + i] += (value)
    ADD(0, a[i] - c[i]);
    ADD(1, b[i] - d[i]);
    ADD(2, g[i] - h[i]);
    ADD(3, a[i] * a[i] - c[i] * c[i]);
    ADD(4, b[i] * b[i] - d[i] * d[i]);
    ADD(5, g[i] * g[i] - h[i] * h[i]);
    ADD(6, a[i] * b[i] - c[i] * d[i]);
    ADD(7, a[i] * g[i] - c[i] * h[i]);
    ADD(8, b[i] * g[i] - d[i] * h[i]);
    ADD(9, is_cell[i] - was_cell[i]);
#endif
#undef ADD
  }
}

void TVK_DENSE(cell_columns)(const tvk_dense_rows *rows, int32_t pitch, int32_t first,
                             int32_t *columns) {
  enum { REACH = TVK_DENSE_REACH };
  if (first) {
    memset(columns, 0, (size_t)(TVK_DENSE_SUMS * (pitch + TVK_DENSE_SPAN)) * sizeof *columns);
    for (int n = 0; n < 2 * REACH; ++n) add_products(rows, n, -1, pitch, columns);
  }
  add_products(rows, 2 * REACH, first ? -1 : 2 * REACH + 1, pitch, columns);
}

void TVK_DENSE(cell_sums)(const int32_t *columns, int32_t pitch, int32_t *restrict sums) {
  for (int k = 0; k < TVK_DENSE_SUMS; ++k, columns += pitch + TVK_DENSE_SPAN) {
    for (int32_t x = 0; x < TVK_DENSE_STRETCH; x += TVK_DENSE_SPAN, sums += TVK_DENSE_SPAN) {
      const int32_t *const from = columns + x;
      for (int i = 0; i < TVK_DENSE_SPAN; ++i) {
        sums[i] = from[i] + from[i + 1] + from[i + 2] + from[i + 3] + from[i + 4] + from[i + 5] +
                  from[i + 6];
      }
    }
  }
}

void TVK_DENSE(smooth_row)(const uint8_t *const *rows, int32_t width, uint8_t *restrict out) {
  for (int32_t x = 0; x < width; x += TVK_DENSE_SPAN) {
    const uint8_t *const a = rows[0] + x, *const b = rows[1] + x, *const c = rows[2] + x;
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) {
      const uint16_t corners = (uint16_t)(a[i - 1] + c[i - 1] + a[i + 1] + c[i + 1]);
      const uint16_t sides = (uint16_t)(a[i] + c[i] + b[i - 1] + b[i + 1]);
      const uint16_t mean = (uint16_t)((uint16_t)(corners + 2 * sides + 4 * b[i] + 8) >> 4);
      out[x + i] = (uint8_t)(b[i] == 0 ? 0 : mean > 1 ? mean : 1);
    }
  }
  out[0] = rows[1][0];
  out[width - 1] = rows[1][width - 1];
}

#if defined(TVK_AVX2)
/* Eight places at once: a word holds a pixel and the three behind it. They are all in the image
   where a row follows that of the lower pixels. Returns whether this is so, and samples then. */
static inline int sample_eight(const uint8_t *image, int32_t width, int32_t height, int64_t stride,
                               const int32_t *u, const int32_t *v, uint8_t *out) {
  const __m256i column = _mm256_loadu_si256((const __m256i *)u);
  const __m256i row = _mm256_loadu_si256((const __m256i *)v);
  const __m256i line = _mm256_srai_epi32(row, 16);
  const __m256i is_last = _mm256_cmpgt_epi32(line, _mm256_set1_epi32(height - 3));
  if (width < 4 || stride < width || stride * height > INT32_MAX ||
      !_mm256_testz_si256(is_last, is_last) ||
      _mm256_movemask_ps(_mm256_castsi256_ps(column)) != 0) {
    return 0;
  }
  const __m256i at = _mm256_add_epi32(_mm256_mullo_epi32(line, _mm256_set1_epi32((int)stride)),
                                      _mm256_srai_epi32(column, 16));
  const __m256i above = _mm256_i32gather_epi32((const int *)image, at, 1);
  const __m256i below = _mm256_i32gather_epi32((const int *)(image + stride), at, 1);
  const __m256i two = _mm256_setr_epi8(0, -1, 1, -1, 4, -1, 5, -1, 8, -1, 9, -1, 12, -1, 13, -1, 0,
                                       -1, 1, -1, 4, -1, 5, -1, 8, -1, 9, -1, 12, -1, 13, -1);
  const __m256i byte = _mm256_set1_epi32(255);
  const __m256i du = _mm256_and_si256(_mm256_srli_epi32(column, 8), byte);
  const __m256i dv = _mm256_and_si256(_mm256_srli_epi32(row, 8), byte);
  const __m256i shares =
      _mm256_or_si256(_mm256_sub_epi32(_mm256_set1_epi32(256), du), _mm256_slli_epi32(du, 16));
  const __m256i upper = _mm256_madd_epi16(_mm256_shuffle_epi8(above, two), shares);
  const __m256i lower = _mm256_madd_epi16(_mm256_shuffle_epi8(below, two), shares);
  __m256i grey = _mm256_mullo_epi32(dv, _mm256_sub_epi32(lower, upper));
  grey = _mm256_add_epi32(_mm256_add_epi32(grey, _mm256_slli_epi32(upper, 8)),
                          _mm256_set1_epi32(32768));
  grey = _mm256_max_epi32(_mm256_srli_epi32(grey, 16), _mm256_set1_epi32(1));
  const __m128i words =
      _mm_packus_epi32(_mm256_castsi256_si128(grey), _mm256_extracti128_si256(grey, 1));
  _mm_storel_epi64((__m128i *)out, _mm_packus_epi16(words, words));
  return 1;
}
#endif

void TVK_DENSE(sample_row)(const uint8_t *image, int32_t width, int32_t height, int64_t stride,
                           const int32_t *u, const int32_t *v, int32_t count, uint8_t *out) {
  for (int32_t x = 0; x < count; ++x) {
#if defined(TVK_AVX2)
    if (x + 8 <= count && sample_eight(image, width, height, stride, u + x, v + x, out + x)) {
      x += 7;
      continue;
    }
#endif
    if (u[x] < 0) {
      out[x] = 0;
      continue;
    }
    const int32_t column = u[x] >> 16, line = v[x] >> 16;
    const uint8_t *p = image + line * stride + column;
    const ptrdiff_t right = column + 1 < width ? 1 : 0;
    const uint8_t *q = line + 1 < height ? p + stride : p;
    const int32_t du = u[x] >> 8 & 255, dv = v[x] >> 8 & 255;
    const int32_t upper = 256 * p[0] + du * (p[right] - p[0]);
    const int32_t lower = 256 * q[0] + du * (q[right] - q[0]);
    const int32_t grey = (256 * upper + dv * (lower - upper) + 32768) >> 16;
    out[x] = (uint8_t)(grey > 1 ? grey : 1);
  }
}

#if !defined(TVK_NO_FLOATS)
/* Comparisons of floats keep gcc from making vectors: they might trap. */
static inline float at_least_0(float value) { return 0.5f * (value + fabsf(value)); }

static inline float within(float value, float low, float high) {
  return 0.5f * (fabsf(value - low) - fabsf(value - high)) + 0.5f * (low + high);
}

void TVK_DENSE(fit_cells)(const int32_t *sums, const int16_t *steps, const uint8_t *alike,
                          const int8_t *slant, const tvk_dense_model *model,
                          float *restrict parallax, float *restrict sigma,
                          uint8_t *restrict similarity) {
  enum { PITCH = TVK_DENSE_STRETCH };
  const float gain_prior = model->gain_prior, excess_sq = model->excess_sq;
  const float noise_sq = model->noise_sq, step_info = model->step_info, floor_sq = model->floor_sq;
  for (int32_t x = 0; x < PITCH; x += TVK_DENSE_SPAN) {
    /* Bytes and words apart: with them in the loop a vector of floats would be half as wide. */
    float step[TVK_DENSE_SPAN], same[TVK_DENSE_SPAN], lean[TVK_DENSE_SPAN], likes[TVK_DENSE_SPAN];
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) step[i] = (float)steps[x + i];
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) same[i] = (float)alike[x + i];
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) lean[i] = (float)slant[x + i];
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) {
      const int32_t *const s = sums + x + i;
      const int32_t a = s[0], b = s[PITCH], g = s[2 * PITCH], n = s[9 * PITCH];
      /* Integers hold n times a sum of products less the product of the sums: at most 49^2 510^2.
       */
      const float scale = 1.0f / (at_least_0((float)n - 1.0f) + 1.0f);
      const float caa = (float)(n * s[3 * PITCH] - a * a) * scale;
      const float cbb = (float)(n * s[4 * PITCH] - b * b) * scale;
      const float cgg = (float)(n * s[5 * PITCH] - g * g) * (scale * 0.0625f);
      const float cab = (float)(n * s[6 * PITCH] - a * b) * scale;
      const float cag = (float)(n * s[7 * PITCH] - a * g) * (scale * 0.25f);
      const float cbg = (float)(n * s[8 * PITCH] - b * g) * (scale * 0.25f);
      const float prior = gain_prior * (float)n, inverse = 1.0f / (caa + prior + 1e-3f);
      const float freedom = 1.0f / (at_least_0((float)n - 4.0f) + 1.0f);
      /* The gain without a change, what remains of b, and how much that outweighs the mean step. */
      const float gain0 = (cab + prior) * inverse;
      const float rest0 = cbb + gain0 * (gain0 * caa - 2.0f * cab);
      const float noise0 = at_least_0(rest0) * freedom + noise_sq;
      const float pivot = at_least_0(cgg - cag * cag * inverse);
      const float wanted = (gain0 * cag - cbg) / (pivot + excess_sq * step_info * noise0 + 1e-3f);
      const float change = within(wanted, -1.0f, 1.0f);
      const float moved = at_least_0(cbb + change * (2.0f * cbg + change * cgg));
      const float both = cab + change * cag, gain = (both + prior) * inverse;
      const float rest = moved + gain * (gain * caa - 2.0f * both);
      const float noise = at_least_0(rest) * freedom + noise_sq;
      const float info = pivot / (excess_sq * noise) + step_info;
      const float mean = lean[i] / (at_least_0(same[i] - 1.0f) + 1.0f);
      /* Windows that would have to move by more than a step are not alike. */
      const float like = 255.0f * at_least_0(both + prior) /
                             sqrtf((at_least_0(caa) + prior) * (moved + prior) + 1e-3f) -
                         1000.0f * at_least_0(fabsf(wanted) - 1.0f);
      parallax[x + i] = step[i] + mean + change;
      sigma[x + i] = sqrtf(1.0f / info + floor_sq);
      likes[i] = within(like, 1.0f, 255.0f);
    }
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) {
      const int32_t like = (int32_t)likes[i]; /* 0 by rounding, where they would move very far */
      similarity[x + i] = (uint8_t)(like > 1 ? like : 1);
    }
  }
}

void TVK_DENSE(place_row)(const tvk_dense_span *spans, int32_t num_spans, double scale,
                          int32_t width, int32_t height, int32_t *restrict u, int32_t *restrict v) {
  enum { SPAN = TVK_DENSE_NODES };
  for (int32_t n = 0; n < num_spans; ++n, u += SPAN, v += SPAN) {
    const double(*const p)[2] = spans[n].at;
    const int is_smooth = spans[n].is_smooth;
    for (int i = 0; i < SPAN; ++i) {
      const double s = i;
      const double x =
          ((((p[3][0] * s + p[2][0]) * s + p[1][0]) * s + p[0][0]) + 0.5) * scale - 0.5;
      const double y =
          ((((p[3][1] * s + p[2][1]) * s + p[1][1]) * s + p[0][1]) + 0.5) * scale - 0.5;
      /* The rim of images that are rectified already is kept in spite of rounding. */
      u[i] = (int32_t)(x * 65536 + 1);
      v[i] = (int32_t)(y * 65536 + 1);
    }
    for (int i = 0; i < SPAN; ++i) {
      const int inside = is_smooth & (u[i] >= 0) & (v[i] >= 0) & (u[i] <= ((width - 1) << 16) + 2) &
                         (v[i] <= ((height - 1) << 16) + 2);
      u[i] = inside ? u[i] : -1;
    }
  }
}
#endif /* TVK_NO_FLOATS */
