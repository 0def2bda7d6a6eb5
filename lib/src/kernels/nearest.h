/* The kernel mutual_nearest: pairs of strictly nearest neighbours among 128-byte descriptors, found
   by comparing all pairs.

   Rows (descriptors of image 0) and columns (of image 1) are compared in tiles of NEAREST_QUERIES x
   NEAREST_COLUMNS. For each pair a, b a tile makes two keys: one from |a|^2 - 2 a . b for b's list
   and one from |b|^2 - 2 a . b for a's list. The term that is missing for the squared distance is
   the same for the whole list. A key is that number (24 bits with its sign) << 8, plus the place of
   its tile in the low 8 bits: among 256 tiles of rows, or of columns.

   A group is the set of descriptors of a tile that share a list entry: all rows of the tile for a
   column; the columns of the tile in one lane for a row. A tile computes the smallest key of each
   group. The two smallest keys of groups are kept for each column, and for each row and lane.

   At the end the two nearest groups are known, each by the distance of its nearest member. The
   second nearest neighbour may be in the same group as the nearest one. The distances within that
   group are therefore computed again, but only for descriptors that can be mutual nearest
   neighbours. Ties need no order, because descriptors at equal distances are not strictly nearest.

   Each kernel set provides the tile in a file of its own (nearest_*.h): the constants
   NEAREST_LANES, _VECTORS, _QUERIES, _ROWS (rows of a chunk) and _PANEL; the structs nearest_rows
   and nearest_block; make_rows and make_block, which fill them; largest_byte where these need it
   (AVX2); and tile_products, which writes -a . b of all pairs of a tile, row by row. */

#define NEAREST_FAR INT32_MAX
#define NEAREST_COLUMNS (NEAREST_LANES * NEAREST_VECTORS)
#define NEAREST_PLACES 256

/* The part of a key that does not depend on the product: the squared norm and the place. make_rows
   and make_block write NEAREST_FAR instead for rows and columns after the last descriptor; no key
   is larger. */
static inline int32_t nearest_term(int32_t norm, int32_t place) { return norm * 256 + place; }

/* Not inlined, like the other functions that run once per descriptor or tile instead of once per
   pair: -O3 would copy them to each call. */
static TVK_NOINLINE int32_t squared_norm(const uint8_t *a) {
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += a[k] * a[k];
  return sum;
}

static TVK_NOINLINE int32_t squared_distance(const uint8_t *a, const uint8_t *b) {
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
    const int16_t difference = (int16_t)(a[k] - b[k]);
    sum += difference * difference;
  }
  return sum;
}

#if defined(TVK_AVX512)
#include "kernels/nearest_avx512.h"
#elif defined(TVK_AVX2)
#include "kernels/nearest_avx2.h"
#elif defined(TVK_NEON_DOT)
#include "kernels/nearest_neon_dot.h"
#else
#include "kernels/nearest_c.h"
#endif

#if !defined(TVK_AVX2) /* only the tiles of AVX2 use the largest byte */
static inline int32_t largest_byte(const uint8_t *bytes, int64_t count) {
  (void)bytes;
  (void)count;
  return 0;
}
#endif

#define NEAREST_ASSERT(name, condition) typedef char name[(condition) ? 1 : -1]
NEAREST_ASSERT(nearest_chunk_fits, sizeof(nearest_rows) * (NEAREST_ROWS / NEAREST_QUERIES) <=
                                       TVK_NEAREST_CHUNK_BYTES(NEAREST_ROWS));
NEAREST_ASSERT(nearest_few_rows_fit,
               sizeof(nearest_rows) <= 2 * TVK_NEAREST_ROW_BYTES &&
                   sizeof(nearest_rows) <= NEAREST_QUERIES * TVK_NEAREST_ROW_BYTES);
NEAREST_ASSERT(nearest_panel_fits,
               sizeof(nearest_block) <= NEAREST_COLUMNS * (NEAREST_PANEL == TVK_NEAREST_PANEL
                                                               ? TVK_NEAREST_COLUMN_BYTES
                                                               : TVK_NEAREST_COLUMN_16_BYTES));
NEAREST_ASSERT(nearest_chunks_are_whole, NEAREST_ROWS % NEAREST_QUERIES == 0 &&
                                             NEAREST_PLACES * NEAREST_QUERIES % NEAREST_ROWS == 0);
NEAREST_ASSERT(nearest_panels_are_whole, 64 % NEAREST_COLUMNS == 0 &&
                                             NEAREST_PANEL % NEAREST_COLUMNS == 0 &&
                                             NEAREST_PANEL / NEAREST_COLUMNS <= NEAREST_PLACES);
#undef NEAREST_ASSERT

static inline int32_t nearest_min(int32_t a, int32_t b) { return a < b ? a : b; }

/* Merges the two smallest keys of groups into `nearest`, which holds the smallest and the second
   smallest distance of groups so far, and in idx the first member of the nearest group. `norm` is
   the term that the keys lack; `group` is the first member of best_key's group. */
static TVK_NOINLINE void nearest_merge(tvk_nearest *nearest, int32_t best_key, int32_t second_key,
                                       int32_t norm, int32_t group) {
  const int32_t best = (best_key >> 8) + norm;
  if (best_key == NEAREST_FAR || best >= nearest->second) return;
  if (best < nearest->best) {
    nearest->second = nearest->best;
    nearest->best = best;
    nearest->idx = group;
  } else {
    nearest->second = best;
  }
  if (second_key != NEAREST_FAR) {
    nearest->second = nearest_min(nearest->second, (second_key >> 8) + norm);
  }
}

static inline void merge_columns(const nearest_block *block, int32_t first_row, int32_t num_columns,
                                 tvk_nearest *of_columns) {
  int32_t j;
  for (j = 0; j < num_columns; ++j) {
    const int32_t key = block->best[j];
    nearest_merge(&of_columns[j], key, block->second[j], block->norms[j],
                  first_row + (key & (NEAREST_PLACES - 1)) * NEAREST_QUERIES);
  }
}

/* Merges the lists of a row, one per lane, into of_row: its nearest group, its smallest and second
   smallest distance. */
static inline void merge_lanes(const int32_t *best, const int32_t *second, int32_t norm,
                               int32_t first_column, tvk_nearest *of_row) {
  int32_t smallest = NEAREST_FAR, next = NEAREST_FAR, equals = 0, lane;
  for (lane = 0; lane < NEAREST_LANES; ++lane) smallest = nearest_min(smallest, best[lane]);
  for (lane = 0; lane < NEAREST_LANES; ++lane) {
    const int32_t other = best[lane] == smallest ? second[lane] : best[lane];
    equals += best[lane] == smallest;
    next = nearest_min(next, other);
  }
  if (equals > 1) next = smallest;
  for (lane = 0; best[lane] != smallest;) ++lane;
  nearest_merge(of_row, smallest, next, norm,
                first_column + (smallest & (NEAREST_PLACES - 1)) * NEAREST_COLUMNS + lane);
}

/* Computes the distances from the query to the members of its nearest group again: `count`
   descriptors of `others`, `stride` apart, from nearest->idx on. Lowers nearest->second to the
   smallest distance of the other members. Returns the index of the strictly nearest descriptor, or
   -1 if there is a tie. */
static TVK_NOINLINE int32_t resolve_group(const uint8_t *query, const uint8_t *others,
                                          int32_t num_others, int32_t stride, int32_t count,
                                          tvk_nearest *nearest) {
  int32_t found = -1, equals = 0, k, member = nearest->idx;
  for (k = 0; k < count && member < num_others; ++k, member += stride) {
    const int32_t dist = squared_distance(query, others + (int64_t)member * TVK_DESCRIPTOR_SIZE);
    if (dist == nearest->best) {
      found = member;
      ++equals;
    } else {
      nearest->second = nearest_min(nearest->second, dist);
    }
  }
  return equals == 1 && nearest->best < nearest->second ? found : -1;
}

/* Whether a column in row i's nearest group has the group of row i as its own nearest group, at the
   same distance. If not, row i has no mutual nearest neighbour. */
static inline int32_t may_be_mutual(int32_t i, const tvk_nearest *of_row,
                                    const tvk_nearest *of_columns, int32_t num_columns) {
  int32_t k, j = of_row->idx;
  for (k = 0; k < NEAREST_VECTORS && j < num_columns; ++k, j += NEAREST_LANES) {
    const int32_t before = i - of_columns[j].idx;
    if (of_columns[j].best == of_row->best && before >= 0 && before < NEAREST_QUERIES) return 1;
  }
  return 0;
}

static inline void resolve_row(const uint8_t *rows, int32_t num_rows, int32_t i,
                               const uint8_t *columns, int32_t num_columns,
                               const tvk_nearest *of_columns, tvk_nearest *of_row) {
  const tvk_nearest none = {0, 0, -1};
  tvk_nearest row = *of_row, column;
  int32_t j;
  *of_row = none;
  if (!may_be_mutual(i, &row, of_columns, num_columns)) return;
  j = resolve_group(rows + (int64_t)i * TVK_DESCRIPTOR_SIZE, columns, num_columns, NEAREST_LANES,
                    NEAREST_VECTORS, &row);
  if (j < 0 || of_columns[j].best != row.best) return;
  column = of_columns[j];
  if (resolve_group(columns + (int64_t)j * TVK_DESCRIPTOR_SIZE, rows, num_rows, 1, NEAREST_QUERIES,
                    &column) != i) {
    return;
  }
  of_row->best = row.best;
  of_row->second = nearest_min(row.second, column.second);
  of_row->idx = j;
}

/* Vectors of NEAREST_LANES keys, signed and unsigned. */
typedef int32_t int_lanes __attribute__((vector_size(4 * NEAREST_LANES)));
typedef uint32_t key_lanes __attribute__((vector_size(4 * NEAREST_LANES)));
typedef int32_t unaligned_int_lanes
    __attribute__((vector_size(4 * NEAREST_LANES), aligned(4), may_alias));

static inline int_lanes load_ints(const int32_t *p) { return *(const unaligned_int_lanes *)p; }
static inline void store_ints(int32_t *p, int_lanes x) { *(unaligned_int_lanes *)p = x; }

static inline int_lanes min_lanes(int_lanes a, int_lanes b) {
#if defined(TVK_AVX512)
  return (int_lanes)_mm512_min_epi32((__m512i)a, (__m512i)b);
#elif defined(TVK_AVX2)
  return (int_lanes)_mm256_min_epi32((__m256i)a, (__m256i)b);
#else
  const int_lanes less = a < b;
  return (a & less) | (b & ~less);
#endif
}

static inline int_lanes max_lanes(int_lanes a, int_lanes b) {
#if defined(TVK_AVX512)
  return (int_lanes)_mm512_max_epi32((__m512i)a, (__m512i)b);
#elif defined(TVK_AVX2)
  return (int_lanes)_mm256_max_epi32((__m256i)a, (__m256i)b);
#else
  const int_lanes less = a < b;
  return (b & less) | (a & ~less);
#endif
}

static inline int_lanes make_keys(int_lanes terms, const int32_t *products) {
  return (int_lanes)((key_lanes)terms + ((key_lanes)load_ints(products) << 9));
}

/* Updates the two smallest keys of each lane with one more key. */
static inline void update_two(int_lanes keys, int32_t *best, int32_t *second) {
  const int_lanes old = load_ints(best);
  store_ints(second, min_lanes(load_ints(second), max_lanes(keys, old)));
  store_ints(best, min_lanes(keys, old));
}

/* Updates a row's lists, one per lane, with its keys of a tile: the smallest key of each lane. */
static inline void update_row(const int32_t *products, const int32_t *terms, int32_t *best,
                              int32_t *second) {
  int_lanes keys = make_keys(load_ints(terms), products);
  int32_t v;
  for (v = NEAREST_LANES; v < NEAREST_COLUMNS; v += NEAREST_LANES) {
    keys = min_lanes(keys, make_keys(load_ints(terms + v), products + v));
  }
  update_two(keys, best, second);
}

/* Updates the columns' lists with their keys of a tile: for each column the smallest key of the
   rows. */
static inline void update_columns(const int32_t *products, const int32_t *terms, int32_t *best,
                                  int32_t *second) {
  const int_lanes zero = {0};
  int32_t v, i;
  for (v = 0; v < NEAREST_COLUMNS; v += NEAREST_LANES) {
    int_lanes keys = make_keys(zero + terms[0], products + v);
    for (i = 1; i < NEAREST_QUERIES; ++i) {
      keys = min_lanes(keys, make_keys(zero + terms[i], products + NEAREST_COLUMNS * i + v));
    }
    update_two(keys, best + v, second + v);
  }
}

static void meet_tile(nearest_rows *rows, nearest_block *block) {
  int32_t products[NEAREST_QUERIES * NEAREST_COLUMNS], i;
  tile_products(rows, block, products);
  for (i = 0; i < NEAREST_QUERIES; ++i) {
    update_row(products + NEAREST_COLUMNS * i, block->terms, rows->best + NEAREST_LANES * i,
               rows->second + NEAREST_LANES * i);
  }
  update_columns(products, rows->terms, block->best, block->second);
}

static void forget_columns(nearest_block *blocks, int32_t num_columns) {
  int32_t first, k;
  for (first = 0; first < num_columns; first += NEAREST_COLUMNS, ++blocks) {
    for (k = 0; k < NEAREST_COLUMNS; ++k) blocks->best[k] = blocks->second[k] = NEAREST_FAR;
  }
}

/* Prepares the tiles of the chunk of rows that starts at row `first`; returns their number. */
static int32_t make_chunk(const uint8_t *rows, int32_t num_rows, int32_t first, int32_t largest,
                          nearest_rows *tiles) {
  int32_t t, k, row = first;
  for (t = 0; t < NEAREST_ROWS / NEAREST_QUERIES && row < num_rows; ++t, row += NEAREST_QUERIES) {
    make_rows(rows + (int64_t)row * TVK_DESCRIPTOR_SIZE,
              nearest_min(NEAREST_QUERIES, num_rows - row), row / NEAREST_QUERIES % NEAREST_PLACES,
              largest, &tiles[t]);
    for (k = 0; k < NEAREST_QUERIES * NEAREST_LANES; ++k) {
      tiles[t].best[k] = tiles[t].second[k] = NEAREST_FAR;
    }
  }
  return t;
}

/* Compares all rows with a panel of columns, a chunk of rows at a time: a chunk stays in the
   first-level cache. */
static void meet_panel(const uint8_t *rows, int32_t num_rows, nearest_block *blocks,
                       int32_t first_column, int32_t num_columns, int32_t largest,
                       nearest_rows *tiles, tvk_nearest *of_rows, tvk_nearest *of_columns) {
  int32_t first, start = 0, i, j, t;
  forget_columns(blocks, num_columns);
  for (first = 0; first < num_rows; first += NEAREST_ROWS) {
    const int32_t num_tiles = make_chunk(rows, num_rows, first, largest, tiles);
    const int32_t count = nearest_min(NEAREST_ROWS, num_rows - first);
    for (j = 0; j < num_columns; j += NEAREST_COLUMNS) {
      for (t = 0; t < num_tiles; ++t) meet_tile(&tiles[t], blocks + j / NEAREST_COLUMNS);
    }
    for (i = 0; i < count; ++i) {
      const nearest_rows *const tile = &tiles[i / NEAREST_QUERIES];
      const int32_t q = i % NEAREST_QUERIES;
      merge_lanes(tile->best + q * NEAREST_LANES, tile->second + q * NEAREST_LANES, tile->norms[q],
                  first_column, &of_rows[first + i]);
    }
    if (first + count == num_rows || first + count - start == NEAREST_PLACES * NEAREST_QUERIES) {
      for (j = 0; j < num_columns; j += NEAREST_COLUMNS) {
        merge_columns(blocks + j / NEAREST_COLUMNS, start,
                      nearest_min(NEAREST_COLUMNS, num_columns - j), of_columns + j);
      }
      /* All 256 places of a key are used, or the rows are finished. */
      forget_columns(blocks, num_columns);
      start = first + count;
    }
  }
}

/* Neither inlined nor unrolled: together this saves 570 bytes in the AVX-512 set. */
static TVK_NOINLINE void forget_nearest(tvk_nearest *nearest, int32_t count) {
  const tvk_nearest none = {NEAREST_FAR, NEAREST_FAR, 0};
  int32_t k;
  TVK_ROLLED
  for (k = 0; k < count; ++k) nearest[k] = none;
}

static void mutual_nearest(const uint8_t *rows, int32_t num_rows, const uint8_t *columns,
                           int32_t num_columns, void *scratch, tvk_nearest *of_columns,
                           tvk_nearest *of_rows) {
  nearest_rows *const tiles = (nearest_rows *)scratch;
  nearest_block *const blocks =
      (nearest_block *)(void *)((uint8_t *)scratch + TVK_NEAREST_CHUNK_BYTES(num_rows));
  const int32_t largest = largest_byte(columns, (int64_t)num_columns * TVK_DESCRIPTOR_SIZE);
  int32_t first, b, k;
  forget_nearest(of_rows, num_rows);
  forget_nearest(of_columns, num_columns);
  for (first = 0; first < num_columns; first += NEAREST_PANEL) {
    const int32_t count = nearest_min(NEAREST_PANEL, num_columns - first);
    for (b = 0; b * NEAREST_COLUMNS < count; ++b) {
      const int32_t column = first + b * NEAREST_COLUMNS;
      make_block(columns + (int64_t)column * TVK_DESCRIPTOR_SIZE,
                 nearest_min(NEAREST_COLUMNS, num_columns - column), b, largest, &blocks[b]);
    }
    meet_panel(rows, num_rows, blocks, first, count, largest, tiles, of_rows, of_columns + first);
  }
  for (k = 0; k < num_rows; ++k) {
    resolve_row(rows, num_rows, k, columns, num_columns, of_columns, &of_rows[k]);
  }
}

/* The table for ARMv8.2's dot product uses the NEON set's squared_distances. */
#if !defined(TVK_NEON_DOT)
static void squared_distances(const uint8_t *query, const uint8_t *rows, const int32_t *indices,
                              int32_t count, int32_t *out) {
  int32_t k;
  for (k = 0; k < count; ++k) {
    out[k] = squared_distance(query, rows + (int64_t)indices[k] * TVK_DESCRIPTOR_SIZE);
  }
}
#endif
