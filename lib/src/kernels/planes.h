/* The plane sweep of a depth map: the census of a view, the costs of the planes, their paths and
   the choice of a plane. A cost is at most TVK_SWEEP_BITS, so that the sum of four paths,
   TVK_SWEEP_PATHS * (TVK_SWEEP_BITS + TVK_DENSE_LARGE), is a byte. */

void TVK_DENSE(census_words)(const uint8_t *const *rows, int32_t width, uint32_t *census) {
  enum { DOWN = TVK_SWEEP_DOWN, ACROSS = 2 * TVK_SWEEP_ACROSS };
  const block none = block_of(0);
  for (int32_t x = 0; x < width; x += TVK_DENSE_BLOCK) {
    block bits[4] = {none, none, none, none};
    int n = 0;
    for (int v = 0; v <= DOWN; ++v) {
      const uint8_t *const before = rows[v] + x, *const after = rows[2 * DOWN - v] + x;
      for (int u = -ACROSS; u <= (v < DOWN ? ACROSS : -2); u += 2, ++n) {
        bits[n / 8] = append(bits[n / 8], block_load(after - u), block_load(before + u), none);
      }
    }
    /* The corners of the window are outside before anything else of it is. */
    const uint8_t *const above = rows[0] + x, *const below = rows[2 * DOWN] + x;
    block low = block_least(block_load(above - ACROSS), block_load(above + ACROSS));
    low = block_least(low, block_least(block_load(below - ACROSS), block_load(below + ACROSS)));
    const block is_outside = block_equal(block_least(low, block_load(rows[DOWN] + x)), none);
    for (int i = 0; i < 4; ++i) bits[i] = block_or(bits[i], is_outside);
    block_store_words(census + x, bits);
  }
  for (int32_t x = 0; x < width; ++x) {
    if (x == ACROSS && width > 2 * ACROSS) x = width - ACROSS;
    census[x] = TVK_SWEEP_NONE;
  }
}

/* The census of a view where a block of planes puts the column x. */
static inline void gather_census(const tvk_swept_view *view, int32_t k, float x,
                                 uint32_t *restrict out) {
  const float *const scale = view->scale + k, *const shift = view->shift + k;
  const int32_t *const row = view->row + k;
#if defined(TVK_AVX2)
  const __m256 column = _mm256_set1_ps(x), last = _mm256_set1_ps((float)view->last);
  for (int i = 0; i < TVK_DENSE_BLOCK; i += 8) {
    __m256 u = _mm256_add_ps(_mm256_mul_ps(_mm256_loadu_ps(scale + i), column),
                             _mm256_loadu_ps(shift + i));
    u = _mm256_min_ps(_mm256_max_ps(u, _mm256_setzero_ps()), last);
    const __m256i at =
        _mm256_add_epi32(_mm256_cvttps_epi32(u), _mm256_loadu_si256((const __m256i *)(row + i)));
    _mm256_storeu_si256((__m256i *)(out + i),
                        _mm256_i32gather_epi32((const int *)view->census, at, 4));
  }
#else
  const float last = (float)view->last;
  int32_t at[TVK_DENSE_BLOCK];
  for (int i = 0; i < TVK_DENSE_BLOCK; ++i) {
    float u = scale[i] * x + shift[i];
    u = u > 0 ? u : 0;
    u = u < last ? u : last;
    at[i] = row[i] + (int32_t)u;
  }
  for (int i = 0; i < TVK_DENSE_BLOCK; ++i) out[i] = view->census[at[i]];
#endif
}

void TVK_DENSE(plane_costs)(const tvk_swept_view *views, int32_t num_views, const uint32_t *census,
                            int32_t width, int32_t count, uint8_t *costs) {
  const block none = block_of(0), one = block_of(1);
  for (int32_t x = 0; x < width; ++x) {
    uint8_t *const cost = costs + (ptrdiff_t)x * count;
    const uint32_t own = census[2 * x];
    if (own == TVK_SWEEP_NONE) {
      memset(cost, 0, (size_t)count);
      continue;
    }
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      block sum = none, most = none, num = none;
      for (int32_t v = 0; v < num_views; ++v) {
        uint32_t other[TVK_DENSE_BLOCK];
        gather_census(views + v, k, (float)x, other);
        block is_absent;
        const block bits = block_word_bits(other, own, &is_absent);
        sum = block_add(sum, bits);
        most = block_most(most, bits);
        num = block_add(num, block_add(is_absent, one));
      }
      /* The worst of several views is left out. */
      const block is_alone = block_equal(block_least(num, one), num);
      const block worst = block_less(block_or(most, is_alone), is_alone);
      block_store(cost + k, block_mean(block_less(sum, worst), num));
    }
  }
}

void TVK_DENSE(sum_planes)(const tvk_swept_row *row) {
  const int32_t count = row->count, last = row->width - 1;
  uint8_t *const line = row->scratch, *const sums = row->scratch + count;
  block least = block_of(0);
  memset(line, 0, (size_t)count);
  for (int32_t i = 0; i <= last; ++i) {
    const int32_t x = row->step > 0 ? i : last - i;
    const uint8_t *const cost = row->costs + (ptrdiff_t)x * count;
    uint8_t *const kept = row->kept + (ptrdiff_t)x * count;
    /* Where the path begins, all of its costs are equal, and a change costs nothing. */
    path across = path_from(line, least, row->across[row->step > 0 ? x : x + 1]), down[3];
    const uint8_t *before[3];
    uint8_t *after[3];
    for (int p = 0; p < 3; ++p) {
      const int32_t from = x + p < 1 ? 0 : x + p - 1 < last ? x + p - 1 : last;
      before[p] = row->before[p] + (ptrdiff_t)from * count;
      after[p] = row->after[p] + (ptrdiff_t)x * count;
      down[p] = path_from(before[p], block_of(row->least_before[p][from]), row->large[p][x]);
    }
    block low = block_of(255);
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      const block bits = block_load(cost + k);
      block sum = follow(&across, bits, line, k, count);
      block_store(line + k, sum);
      for (int p = 0; p < 3; ++p) {
        const block way = follow(&down[p], bits, before[p], k, count);
        block_store(after[p] + k, way);
        sum = block_add(sum, way);
      }
      block_store(sums + k, sum);
      low = block_least(low, sum);
    }
    least = block_lowest(across.least);
    low = block_lowest(low);
    for (int p = 0; p < 3; ++p) row->least_after[p][x] = block_value(block_lowest(down[p].least));
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      const block more = block_less(block_load(sums + k), low);
      block_store(kept + k, block_sum(block_load(kept + k), more));
    }
  }
}

void TVK_DENSE(choose_planes)(const uint8_t *sums, int32_t width, int32_t count, int16_t *planes,
                              uint8_t *margin) {
  for (int32_t x = 0; x < width; ++x) {
    const uint8_t *const sum = sums + (ptrdiff_t)x * count;
    block low = block_of(255), next = low;
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      low = block_least(low, block_load(sum + k));
    }
    low = block_lowest(low);
    const int32_t at = first_of(sum, count, low);
    for (int32_t k = 0; k < count; k += TVK_DENSE_BLOCK) {
      next = block_least(next, block_or(block_load(sum + k), block_near(at, k, 2)));
    }
    planes[x] = (int16_t)at;
    margin[x] = (uint8_t)(block_value(block_lowest(next)) - block_value(low));
  }
}
