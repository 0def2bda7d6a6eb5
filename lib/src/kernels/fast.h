/* FAST's segment test and its score, and non-maximum suppression.
   E. Rosten, T. Drummond, "Machine learning for high-speed corner detection", ECCV 2006. */

static inline uint8_t fast_min(uint8_t a, uint8_t b) { return a < b ? a : b; }
static inline uint8_t fast_max(uint8_t a, uint8_t b) { return a > b ? a : b; }

/* The circle of radius 3, clockwise from below the centre: row of rows[], column offset. */
static const int8_t fast_circle_row[16] = {6, 6, 5, 4, 3, 2, 1, 0, 0, 0, 1, 2, 3, 4, 5, 6};
static const int8_t fast_circle_column[16] = {0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1};

enum { FAST_CHUNK = 64 };

/* The score of a pixel c is the larger of
     max over arcs of min over the arc of p_i - c   (brighter) and
     c - min over arcs of max over the arc of p_i   (darker), less 1.
   The minimum over n = 9..12 contiguous pixels is that of three runs of 4, which start at i, i + 4 and
   i + n - 4; a run of 4 is two runs of 2. Nothing here depends on the data, so neither does the time. */
static void fast_score_chunk(const uint8_t *const circle[16], const uint8_t *centre, int32_t arc,
                             int32_t threshold, uint8_t *scores) {
  uint8_t low[16][FAST_CHUNK], high[16][FAST_CHUNK];
  uint8_t low4[16][FAST_CHUNK], high4[16][FAST_CHUNK];
  uint8_t brighter[FAST_CHUNK], darker[FAST_CHUNK];
  int32_t i, x;
  for (i = 0; i < 16; ++i) {
    const uint8_t *a = circle[i], *b = circle[(i + 1) & 15];
    for (x = 0; x < FAST_CHUNK; ++x) {
      low[i][x] = fast_min(a[x], b[x]);
      high[i][x] = fast_max(a[x], b[x]);
    }
  }
  for (i = 0; i < 16; ++i) {
    const int32_t j = (i + 2) & 15;
    for (x = 0; x < FAST_CHUNK; ++x) {
      low4[i][x] = fast_min(low[i][x], low[j][x]);
      high4[i][x] = fast_max(high[i][x], high[j][x]);
    }
  }
  for (x = 0; x < FAST_CHUNK; ++x) {
    brighter[x] = 0;
    darker[x] = 255;
  }
  for (i = 0; i < 16; ++i) {
    const int32_t j = (i + 4) & 15, k = (i + arc - 4) & 15;
    for (x = 0; x < FAST_CHUNK; ++x) {
      const uint8_t l = fast_min(fast_min(low4[i][x], low4[j][x]), low4[k][x]);
      const uint8_t h = fast_max(fast_max(high4[i][x], high4[j][x]), high4[k][x]);
      brighter[x] = fast_max(brighter[x], l);
      darker[x] = fast_min(darker[x], h);
    }
  }
  for (x = 0; x < FAST_CHUNK; ++x) {
    const uint8_t c = centre[x];
    const uint8_t above = (uint8_t)(fast_max(brighter[x], c) - c);
    const uint8_t below = (uint8_t)(c - fast_min(darker[x], c));
    const uint8_t contrast = fast_max(above, below);
    scores[x] = contrast > threshold ? (uint8_t)(contrast - 1) : 0;
  }
}

static void fast_score_row(const uint8_t *const rows[7], int32_t width, int32_t arc,
                           int32_t threshold, uint8_t *scores) {
  const int32_t end = width - TVK_CIRCLE_RADIUS;
  const uint8_t *circle[16];
  uint8_t copy[7][FAST_CHUNK + 2 * TVK_CIRCLE_RADIUS];
  uint8_t chunk_scores[FAST_CHUNK];
  int32_t x = TVK_CIRCLE_RADIUS, i;
  memset(scores, 0, (size_t)width);
  for (; x + FAST_CHUNK <= end; x += FAST_CHUNK) {
    for (i = 0; i < 16; ++i) circle[i] = rows[fast_circle_row[i]] + x + fast_circle_column[i];
    fast_score_chunk(circle, rows[3] + x, arc, threshold, scores + x);
  }
  if (x >= end) return;
  /* The last chunk is cut short: it works on a copy, so that nothing beyond the rows is read. */
  memset(copy, 0, sizeof copy);
  for (i = 0; i < 7; ++i) {
    memcpy(copy[i], rows[i] + x - TVK_CIRCLE_RADIUS, (size_t)(width - x + TVK_CIRCLE_RADIUS));
  }
  for (i = 0; i < 16; ++i) {
    circle[i] = copy[fast_circle_row[i]] + TVK_CIRCLE_RADIUS + fast_circle_column[i];
  }
  fast_score_chunk(circle, copy[3] + TVK_CIRCLE_RADIUS, arc, threshold, chunk_scores);
  memcpy(scores + x, chunk_scores, (size_t)(end - x));
}

/* By how much the best arc around one pixel is brighter or darker than it; below 0 where none is. The
   circle is laid out twice, so that runs need not wrap. */
static int32_t fast_contrast(const uint8_t *centre, int64_t stride, int32_t arc) {
  int16_t circle[32], low[32], high[32], low4[28], high4[28];
  int32_t brighter = -255, darker = 255, i;
  for (i = 0; i < 16; ++i) {
    circle[i] = centre[(fast_circle_row[i] - 3) * stride + fast_circle_column[i]];
  }
  for (i = 0; i < 16; ++i) circle[i + 16] = circle[i];
  for (i = 0; i < 31; ++i) {
    low[i] = circle[i] < circle[i + 1] ? circle[i] : circle[i + 1];
    high[i] = circle[i] > circle[i + 1] ? circle[i] : circle[i + 1];
  }
  for (i = 0; i < 28; ++i) {
    low4[i] = low[i] < low[i + 2] ? low[i] : low[i + 2];
    high4[i] = high[i] > high[i + 2] ? high[i] : high[i + 2];
  }
  for (i = 0; i < 16; ++i) {
    const int16_t *l = low4 + i, *h = high4 + i;
    int32_t lowest = l[0] < l[4] ? l[0] : l[4], highest = h[0] > h[4] ? h[0] : h[4];
    lowest = lowest < l[arc - 4] ? lowest : l[arc - 4];
    highest = highest > h[arc - 4] ? highest : h[arc - 4];
    brighter = brighter > lowest ? brighter : lowest;
    darker = darker < highest ? darker : highest;
  }
  brighter -= *centre;
  darker = *centre - darker;
  return brighter > darker ? brighter : darker;
}

static void fast_contrasts(const uint8_t *centre, int64_t stride, int32_t arc,
                           int32_t *contrasts) {
  int32_t i;
  for (i = 0; i < 9; ++i) {
    contrasts[i] = fast_contrast(centre + (i / 3 - 1) * stride + i % 3 - 1, stride, arc);
  }
}

static int32_t suppress_row(const uint8_t *prev, const uint8_t *cur, const uint8_t *next,
                            int32_t width, uint16_t *xs) {
  int32_t count = 0, x;
  for (x = 1; x + 1 < width; ++x) {
    const uint8_t s = cur[x];
    if (s == 0) continue;
    if (s > cur[x - 1] && s > cur[x + 1] && s > prev[x - 1] && s > prev[x] && s > prev[x + 1] &&
        s > next[x - 1] && s > next[x] && s > next[x + 1]) {
      xs[count++] = (uint16_t)x;
    }
  }
  return count;
}
