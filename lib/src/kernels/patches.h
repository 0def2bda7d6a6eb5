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
          const int16_t change = (int16_t)(other[i] - own[i]);
          const int16_t like = change >= -1 && change <= 1 ? -1 : 0;
          count[i] = (int16_t)(count[i] - like);
          sum[i] = (int16_t)(sum[i] + (like & change));
        }
      }
    }
    for (int i = 0; i < BLOCK; ++i) {
      support[x + i] = (uint8_t)near_count[i];
      alike[x + i] = (uint8_t)(near_count[i] + far_count[i]);
      slant[x + i] = (int8_t)sum[i];
    }
  }
}

/* Adds the products of a row to the sums over columns, or subtracts them. */
static void add_products(const tvk_dense_rows *rows, int n, int32_t pitch, int32_t sign,
                         int32_t *restrict columns) {
  for (int32_t x = 0; x < pitch; x += TVK_DENSE_SPAN) {
    const uint8_t *const a = rows->a[n] + x, *const b = rows->b[n] + x;
    const uint8_t *const is_cell = rows->is_cell[n] + x;
    const int16_t *const g = rows->g[n] + x;
    int32_t *const to = columns + x;
    const int32_t next = pitch + TVK_DENSE_SPAN;
#define ADD(k, value) \
  for (int i = 0; i < TVK_DENSE_SPAN; ++i) to[(k)*next + i] += sign * (value)
    ADD(0, a[i]);
    ADD(1, b[i]);
    ADD(2, g[i]);
    ADD(3, a[i] * a[i]);
    ADD(4, b[i] * b[i]);
    ADD(5, g[i] * g[i]);
    ADD(6, a[i] * b[i]);
    ADD(7, a[i] * g[i]);
    ADD(8, b[i] * g[i]);
    ADD(9, is_cell[i]);
#undef ADD
  }
}

void TVK_DENSE(cell_sums)(const tvk_dense_rows *rows, int32_t pitch, int32_t first,
                          int32_t *columns, int32_t *sums) {
  enum { REACH = TVK_DENSE_REACH };
  if (first) {
    memset(columns, 0, (size_t)(TVK_DENSE_SUMS * (pitch + TVK_DENSE_SPAN)) * sizeof *columns);
    for (int n = 0; n < 2 * REACH; ++n) add_products(rows, n, pitch, 1, columns);
  } else {
    add_products(rows, 2 * REACH + 1, pitch, -1, columns);
  }
  add_products(rows, 2 * REACH, pitch, 1, columns);
  for (int k = 0; k < TVK_DENSE_SUMS; ++k) {
    for (int32_t x = 0; x < pitch; x += TVK_DENSE_SPAN) {
      const int32_t *const from = columns + k * (pitch + TVK_DENSE_SPAN) + x;
      int32_t *const to = sums + k * pitch + x;
      for (int i = 0; i < TVK_DENSE_SPAN; ++i) {
        to[i] = from[i] + from[i + 1] + from[i + 2] + from[i + 3] + from[i + 4] + from[i + 5] +
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

void TVK_DENSE(sample_span)(const uint8_t *image, int32_t width, int32_t height, int64_t stride,
                            const int32_t *u, const int32_t *v, int32_t count, uint8_t *out) {
  for (int32_t x = 0; x < count; ++x) {
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

void TVK_DENSE(fit_row)(const int32_t *sums, const int16_t *steps, const uint8_t *alike,
                        const int8_t *slant, int32_t pitch, const tvk_dense_model *model,
                        float *restrict parallax, float *restrict sigma,
                        uint8_t *restrict similarity) {
  const float gain_prior = model->gain_prior, excess_sq = model->excess_sq;
  const float noise_sq = model->noise_sq, step_info = model->step_info, floor_sq = model->floor_sq;
  for (int32_t x = 0; x < pitch; x += TVK_DENSE_SPAN) {
    /* Bytes and words apart: with them in the loop a vector of floats would be half as wide. */
    float step[TVK_DENSE_SPAN], same[TVK_DENSE_SPAN], lean[TVK_DENSE_SPAN], likes[TVK_DENSE_SPAN];
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) step[i] = (float)steps[x + i];
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) same[i] = (float)alike[x + i];
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) lean[i] = (float)slant[x + i];
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) {
      const int32_t *const s = sums + x + i;
      const int32_t a = s[0], b = s[pitch], g = s[2 * pitch], n = s[9 * pitch];
      /* Integers hold n times a sum of products less the product of the sums: at most 49^2 510^2.
       */
      const float scale = 1.0f / (at_least_0((float)n - 1.0f) + 1.0f);
      const float caa = (float)(n * s[3 * pitch] - a * a) * scale;
      const float cbb = (float)(n * s[4 * pitch] - b * b) * scale;
      const float cgg = (float)(n * s[5 * pitch] - g * g) * (scale * 0.0625f);
      const float cab = (float)(n * s[6 * pitch] - a * b) * scale;
      const float cag = (float)(n * s[7 * pitch] - a * g) * (scale * 0.25f);
      const float cbg = (float)(n * s[8 * pitch] - b * g) * (scale * 0.25f);
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
    for (int i = 0; i < TVK_DENSE_SPAN; ++i) similarity[x + i] = (uint8_t)(int32_t)likes[i];
  }
}

void TVK_DENSE(place_span)(const tvk_dense_span *span, double scale, int32_t width, int32_t height,
                           int32_t *u, int32_t *v) {
  const double *p = span->u, *q = span->v;
  for (int i = 0; i < TVK_DENSE_NODES; ++i) {
    const double s = i;
    const double x = ((((p[3] * s + p[2]) * s + p[1]) * s + p[0]) + 0.5) * scale - 0.5;
    const double y = ((((q[3] * s + q[2]) * s + q[1]) * s + q[0]) + 0.5) * scale - 0.5;
    /* The rim of images that are rectified already is kept in spite of rounding. */
    const int32_t column = (int32_t)(x * 65536 + 1), row = (int32_t)(y * 65536 + 1);
    const int inside = (column >= 0) & (row >= 0) & (column <= ((width - 1) << 16) + 2) &
                       (row <= ((height - 1) << 16) + 2);
    u[i] = inside ? column : -1;
    v[i] = row;
  }
}
#endif /* TVK_NO_FLOATS */
