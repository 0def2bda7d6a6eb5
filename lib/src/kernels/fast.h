/* FAST's segment test with its score, and non-maximum suppression. E. Rosten, T. Drummond, "Machine
   learning for high-speed corner detection", ECCV 2006. */
#include "kernels/bytes.h"

/* The 16 pixels of the circle of radius 3, counter-clockwise as seen in the image, from the one
   below the centre: the index into rows[] (3 is the centre's row) and the column offset of each. */
static const int8_t fast_circle_row[16] = {6, 6, 5, 4, 3, 2, 1, 0, 0, 0, 1, 2, 3, 4, 5, 6};
static const int8_t fast_circle_column[16] = {0, 1,  2,  3,  3,  3,  2,  1,
                                              0, -1, -2, -3, -3, -3, -2, -1};

/* For each lane, the largest over all arcs of the circle p of the arc's smallest pixel
   (brightest_arc), or the smallest over all arcs of the arc's largest pixel (darkest_arc). The arcs
   that start at 2i and at 2i + 1 share the pixels 2i + 1 .. 2i + arc - 1, and each has one more
   pixel at one end. This is a macro because compilers do not vectorise a run-time choice between
   the two cases. It is not inlined because it is long and called from two places. */
#define BEST_ARC(name, lesser, greater)                                                            \
  static TVK_NOINLINE byte_lanes name(const byte_lanes p[16], int32_t arc) {                       \
    byte_lanes run2[8], run4[8], least[8], best; /* [i]: of the run from pixel 2i + 1 on */        \
    int32_t i;                                                                                     \
    for (i = 0; i < 8; ++i) run2[i] = lesser(p[2 * i + 1], p[(2 * i + 2) & 15]);                   \
    for (i = 0; i < 8; ++i) run4[i] = lesser(run2[i], run2[(i + 1) & 7]);                          \
    for (i = 0; i < 8; ++i) least[i] = lesser(run4[i], run4[(i + 2) & 7]);                         \
    if (arc > 10) {                                                                                \
      for (i = 0; i < 8; ++i) least[i] = lesser(least[i], run2[(i + 4) & 7]);                      \
    }                                                                                              \
    if (arc % 2 == 0) {                                                                            \
      for (i = 0; i < 8; ++i) least[i] = lesser(least[i], p[(2 * i + arc - 1) & 15]);              \
    }                                                                                              \
    for (i = 0; i < 8; ++i) least[i] = lesser(least[i], greater(p[2 * i], p[(2 * i + arc) & 15])); \
    best = least[0];                                                                               \
    for (i = 1; i < 8; ++i) best = greater(best, least[i]);                                        \
    return best;                                                                                   \
  }
BEST_ARC(brightest_arc, bytes_min, bytes_max)
BEST_ARC(darkest_arc, bytes_max, bytes_min)
#undef BEST_ARC

/* Bounds on brightest_arc and darkest_arc from four pixels a quarter of the circle apart: an arc of
   9 pixels contains two neighbouring ones of the four, an arc of 12 contains three. */
typedef struct arc_bounds {
  byte_lanes brightest, darkest;
} arc_bounds;

static inline arc_bounds bounds_of_arcs(const byte_lanes p[16], int32_t first, int32_t arc) {
  const byte_lanes a = p[first], b = p[first + 4], c = p[first + 8], d = p[first + 12];
  arc_bounds bounds;
  bounds.brightest = bytes_min(bytes_max(a, c), bytes_max(b, d));
  bounds.darkest = bytes_max(bytes_min(a, c), bytes_min(b, d));
  if (arc == 12) { /* the bounds are the second smallest and second largest of the four pixels */
    const byte_lanes brightest = bounds.brightest;
    bounds.brightest = bytes_min(brightest, bounds.darkest);
    bounds.darkest = bytes_max(brightest, bounds.darkest);
  }
  return bounds;
}

static inline byte_lanes circle_pixel(const uint8_t *const rows[7], int32_t x, int32_t i) {
  return bytes_load(rows[fast_circle_row[i]] + x + fast_circle_column[i]);
}

/* Scores of the TVK_BYTES pixels from x on. Returns zeros early when four or eight pixels of the
   circle show that none of them is a corner. */
static inline byte_lanes fast_scores(const uint8_t *const rows[7], int32_t x, int32_t arc,
                                     int32_t threshold) {
  const byte_lanes t = bytes_of((uint8_t)threshold), c = bytes_load(rows[3] + x);
  const byte_lanes high = bytes_add(c, t), low = bytes_sub(c, t);
  byte_lanes p[16], contrast = bytes_of(0);
  arc_bounds bounds, more;
  int has_brighter, has_darker;
  int32_t i;
  for (i = 0; i < 16; i += 4) p[i] = circle_pixel(rows, x, i);
  bounds = bounds_of_arcs(p, 0, arc);
  if (!bytes_any(bytes_max(bytes_sub(bounds.brightest, high), bytes_sub(low, bounds.darkest)))) {
    return contrast;
  }
  for (i = 2; i < 16; i += 4) p[i] = circle_pixel(rows, x, i);
  more = bounds_of_arcs(p, 2, arc);
  has_brighter = bytes_any(bytes_sub(bytes_min(bounds.brightest, more.brightest), high));
  has_darker = bytes_any(bytes_sub(low, bytes_max(bounds.darkest, more.darkest)));
  if (!has_brighter && !has_darker) return contrast;
  for (i = 1; i < 16; i += 2) p[i] = circle_pixel(rows, x, i);
  if (has_brighter) contrast = bytes_sub(brightest_arc(p, arc), c);
  if (has_darker) contrast = bytes_max(contrast, bytes_sub(c, darkest_arc(p, arc)));
  return bytes_where_above(contrast, t, bytes_sub(contrast, bytes_of(1)));
}

static void fast_score_row(const uint8_t *const rows[7], int32_t width, int32_t arc,
                           int32_t threshold, uint8_t *scores) {
  enum { RIM = TVK_CIRCLE_RADIUS, NARROW = TVK_BYTES + 2 * RIM };
  const int32_t end = width - RIM, last = end > NARROW - RIM ? end - TVK_BYTES : RIM;
  uint8_t copy[7][NARROW], narrow_scores[NARROW], *out = scores;
  const uint8_t *copies[7];
  int32_t x, i;
  if (width < NARROW) { /* uses a copy, so that nothing is read or written beyond the rows */
    memset(copy, 0, sizeof copy);
    for (i = 0; i < 7; ++i) copies[i] = (uint8_t *)memcpy(copy[i], rows[i], (size_t)width);
    memset(scores, 0, (size_t)width);
    rows = copies;
    out = narrow_scores;
  }
  for (x = RIM; x < end; x += TVK_BYTES) { /* the last block may overlap its predecessor */
    const int32_t at = x < last ? x : last;
    bytes_store(out + at, fast_scores(rows, at, arc, threshold));
  }
  if (end <= RIM) return;
  if (out != scores) {
    memcpy(scores + RIM, out + RIM, (size_t)(end - RIM));
  } else {
    memset(scores, 0, RIM);
    memset(scores + end, 0, RIM);
  }
}

/* A bit mask, as bytes_above returns it, of the TVK_BYTES pixels from x on whose score is above the
   scores of all eight neighbours. */
static inline uint64_t suppress(const uint8_t *prev, const uint8_t *cur, const uint8_t *next,
                                int32_t x) {
  byte_lanes most = bytes_max(bytes_load(cur + x - 1), bytes_load(cur + x + 1));
  int32_t k;
  for (k = -1; k <= 1; ++k) {
    most = bytes_max(most, bytes_max(bytes_load(prev + x + k), bytes_load(next + x + k)));
  }
  return bytes_above(bytes_load(cur + x), most);
}

static int32_t suppress_row(const uint8_t *prev, const uint8_t *cur, const uint8_t *next,
                            int32_t width, uint16_t *xs) {
  const int32_t end = width - 1, last = end - TVK_BYTES;
  int32_t count = 0, x;
  if (last < 1) {
    for (x = 1; x < end; ++x) {
      const uint8_t s = cur[x];
      if (s > cur[x - 1] && s > cur[x + 1] && s > prev[x - 1] && s > prev[x] && s > prev[x + 1] &&
          s > next[x - 1] && s > next[x] && s > next[x + 1]) {
        xs[count++] = (uint16_t)x;
      }
    }
    return count;
  }
  for (x = 1; x < end; x += TVK_BYTES) { /* the last block may overlap its predecessor */
    const int32_t at = x < last ? x : last;
    uint64_t kept = suppress(prev, cur, next, at) & ~(uint64_t)0 << (x - at) * TVK_BYTES_BITS;
    for (; kept != 0; kept &= kept - 1) {
      xs[count++] = (uint16_t)(at + __builtin_ctzll(kept) / TVK_BYTES_BITS);
    }
  }
  return count;
}
