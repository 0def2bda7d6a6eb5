/* The kernel nearest_groups: for each of two sets of 128-byte descriptors, the groups of
   descriptors of the other set that are nearest, found by comparing all pairs.

   Rows (descriptors of image 0) and columns (of image 1) are compared in tiles of NEAREST_QUERIES x
   NEAREST_COLUMNS. For each pair a, b a tile makes two keys: one from |a|^2 - 2 a . b for b's list
   and one from |b|^2 - 2 a . b for a's list. The term that is missing for the squared distance is
   the same for the whole list. A key is that number (24 bits with its sign) << 8, plus the place of
   its tile in the low 8 bits: among the tiles of a chunk of rows, or of a panel of columns.

   A group is the set of descriptors of a tile that share a list entry: all rows of the tile for a
   column; the columns of the tile in one lane for a row. A tile computes the smallest key of each
   group. The two smallest keys are kept of each column for a chunk of rows, and of each row for a
   lane: such a set of groups is a bin. From these pairs of keys merge_bin collects the list of the
   nearest groups of a descriptor. What a bin holds besides is not nearer than its second key, so
   that the smallest second key bounds the distance of all that is not in the list.

   A group consists of descriptors whose ranks follow each other, and the next ranks are in another
   bin. Where the caller ranks keypoints of a neighbourhood together, these are then in few groups
   and in different bins, and the list reaches beyond them.

   Each kernel set provides the tile in a file of its own (nearest_*.h): the constants
   NEAREST_LANES, _VECTORS, _QUERIES, _ROWS (rows of a chunk) and _PANEL; the structs nearest_rows
   and nearest_block; make_rows and make_block, which fill them; largest_byte where these need it
   (AVX2); and tile_products, which writes -a . b of all pairs of a tile, row by row. */

#define NEAREST_FAR INT32_MAX
#define NEAREST_COLUMNS (NEAREST_LANES * NEAREST_VECTORS)
#define NEAREST_PLACES 256
#define NEAREST_TILES (NEAREST_ROWS / NEAREST_QUERIES) /* of a chunk */

/* The part of a key that does not depend on the product: the squared norm and the place. make_rows
   and make_block write NEAREST_FAR instead for rows and columns after the last descriptor; no key
   is larger. */
static inline int32_t nearest_term(int32_t norm, int32_t place) { return norm * 256 + place; }

/* The first limit of a column: above every key, or below it after the last column. */
static inline int32_t nearest_limit(int32_t term, int32_t norm) {
  return term == NEAREST_FAR ? INT32_MIN : (TVK_NEAREST_NONE - norm) * 256;
}

/* Not inlined, like the other functions that run once per descriptor or tile instead of once per
   pair: -O3 would copy them to each call. */
static TVK_NOINLINE int32_t squared_norm(const uint8_t *a) {
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += a[k] * a[k];
  return sum;
}

/* The descriptor of that rank; null after the last one. */
static inline const uint8_t *ranked(const tvk_descriptors *set, int32_t rank) {
  return rank < set->num ? set->bytes + (size_t)set->order[rank] * TVK_DESCRIPTOR_SIZE : NULL;
}

/* The rank of column j of a block whose first column has rank `first`. */
static inline int32_t column_rank(int32_t first, int32_t j);

#if defined(TVK_AVX512)
#include "kernels/nearest_avx512.h"
#elif defined(TVK_AVX2)
#include "kernels/nearest_avx2.h"
#elif defined(TVK_NEON_DOT)
#include "kernels/nearest_neon_dot.h"
#else
#include "kernels/nearest_c.h"
#endif

static inline int32_t column_rank(int32_t first, int32_t j) {
  return first + j % NEAREST_LANES * NEAREST_VECTORS + j / NEAREST_LANES;
}

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
NEAREST_ASSERT(nearest_chunks_are_whole,
               NEAREST_ROWS % NEAREST_QUERIES == 0 && NEAREST_TILES <= NEAREST_PLACES);
NEAREST_ASSERT(nearest_groups_of_columns, NEAREST_VECTORS == TVK_NEAREST_GROUP);
NEAREST_ASSERT(nearest_panels_are_whole, 64 % NEAREST_COLUMNS == 0 &&
                                             NEAREST_PANEL % NEAREST_COLUMNS == 0 &&
                                             NEAREST_PANEL / NEAREST_COLUMNS <= NEAREST_PLACES);
#undef NEAREST_ASSERT

static inline int32_t nearest_min(int32_t a, int32_t b) { return a < b ? a : b; }

enum { NEAREST_BOUND = TVK_NEAREST_LIST - 1 };

/* Lowers the bound of a list to that of a group, if it is nearer. */
static inline void nearest_bound(tvk_nearest *list, int32_t dist, int32_t group) {
  if (dist >= list->dists[NEAREST_BOUND]) return;
  list->dists[NEAREST_BOUND] = dist;
  list->groups[NEAREST_BOUND] = (uint16_t)group;
}

/* Adds a group that is not beyond the bound. What leaves a full list may lower the bound. */
static TVK_NOINLINE void nearest_add(tvk_nearest *list, int32_t dist, int32_t group) {
  int32_t k = NEAREST_BOUND - 1;
  if (dist >= list->dists[k]) {
    nearest_bound(list, dist, group);
    return;
  }
  nearest_bound(list, list->dists[k], list->groups[k]);
  for (; k > 0 && list->dists[k - 1] > dist; --k) {
    list->dists[k] = list->dists[k - 1];
    list->groups[k] = list->groups[k - 1];
  }
  list->dists[k] = dist;
  list->groups[k] = (uint16_t)group;
}

/* The squared distance of a key; at least TVK_NEAREST_NONE for NEAREST_FAR. */
static inline int32_t key_distance(int32_t key, int32_t norm) { return (key >> 8) + norm; }

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

/* A bit for each lane whose key is below its limit. Not inlined: in the sanitizers' build gcc 12
   then stores the mask's 16 bits on the stack and reads 32, of which the upper half is stale. */
static TVK_NOINLINE uint32_t lanes_below(const int32_t *keys, int_lanes limits) {
#if defined(TVK_AVX512)
  return _mm512_cmplt_epi32_mask((__m512i)load_ints(keys), (__m512i)limits);
#elif defined(TVK_AVX2)
  const __m256i below = _mm256_cmpgt_epi32((__m256i)limits, (__m256i)load_ints(keys));
  return (uint32_t)_mm256_movemask_ps(_mm256_castsi256_ps(below));
#else
  uint32_t bits = 0;
  int32_t lane;
  for (lane = 0; lane < NEAREST_LANES; ++lane) {
    bits |= (uint32_t)(keys[lane] < limits[lane]) << lane;
  }
  return bits;
#endif
}

/* The smallest key of a distance: a key is below it where its distance is smaller. */
static inline int32_t first_key(int32_t dist, int32_t norm) { return (dist - norm) * 256; }

/* Merges the lists of a block of columns into those of all rows. Of `num_chunks` chunks of rows
   this is number `chunk`. The second group of a bin bounds the distance of the bin's others. */
static inline void merge_columns(nearest_block *block, int32_t chunk, int32_t num_chunks,
                                 const tvk_descriptors *columns, int32_t first,
                                 tvk_nearest *of_columns) {
  int32_t v;
  for (v = 0; v < NEAREST_COLUMNS; v += NEAREST_LANES) {
    uint32_t bits = lanes_below(block->best + v, load_ints(block->limits + v));
    for (; bits; bits &= bits - 1) {
      const int32_t j = v + __builtin_ctz(bits);
      const int32_t best = block->best[j], second = block->second[j], norm = block->norms[j];
      tvk_nearest *const list = &of_columns[columns->order[column_rank(first, j)]];
      nearest_bound(list, key_distance(second, norm),
                    (second & (NEAREST_PLACES - 1)) * num_chunks + chunk);
      nearest_add(list, key_distance(best, norm),
                  (best & (NEAREST_PLACES - 1)) * num_chunks + chunk);
      block->limits[j] = first_key(list->dists[NEAREST_BOUND], norm);
    }
  }
}

/* Merges the lists of a row, one per lane, into its list of the panel that starts with group
   `first`. */
static inline void merge_lanes(const int32_t *best, const int32_t *second, int32_t norm,
                               int32_t first, tvk_nearest *list) {
  const int_lanes zero = {0};
  int32_t smallest = NEAREST_FAR, lane;
  uint32_t bits;
  for (lane = 0; lane < NEAREST_LANES; ++lane) smallest = nearest_min(smallest, second[lane]);
  for (lane = 0; second[lane] != smallest;) ++lane;
  nearest_bound(list, key_distance(smallest, norm),
                first + (smallest & (NEAREST_PLACES - 1)) * NEAREST_LANES + lane);
  bits = lanes_below(
      best,
      zero + first_key(nearest_min(list->dists[NEAREST_BOUND], TVK_NEAREST_NONE - 1) + 1, norm));
  for (; bits; bits &= bits - 1) {
    const int32_t key = best[lane = __builtin_ctz(bits)], dist = key_distance(key, norm);
    if (dist > list->dists[NEAREST_BOUND]) continue;
    nearest_add(list, dist, first + (key & (NEAREST_PLACES - 1)) * NEAREST_LANES + lane);
  }
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

static void forget_columns(nearest_block *block) {
  int32_t k;
  for (k = 0; k < NEAREST_COLUMNS; ++k) block->best[k] = block->second[k] = NEAREST_FAR;
}

/* Prepares the tiles of a chunk of rows: of all tiles, those whose number is `chunk` more than a
   multiple of num_chunks. Returns how many there are. */
static int32_t make_chunk(const tvk_descriptors *rows, int32_t chunk, int32_t num_chunks,
                          int32_t largest, nearest_rows *tiles) {
  int32_t t, k;
  for (t = 0; t < NEAREST_TILES; ++t) {
    const int32_t first = (t * num_chunks + chunk) * NEAREST_QUERIES;
    if (first >= rows->num) break;
    make_rows(rows, first, t, largest, &tiles[t]);
    for (k = 0; k < NEAREST_QUERIES * NEAREST_LANES; ++k) {
      tiles[t].best[k] = tiles[t].second[k] = NEAREST_FAR;
    }
  }
  return t;
}

/* Compares all rows with the panel of columns from rank `first_column` on, a chunk of rows at a
   time: a chunk stays in the first-level cache. */
static void meet_panel(const tvk_descriptors *rows, nearest_block *blocks, int32_t num_blocks,
                       const tvk_descriptors *columns, int32_t first_column, int32_t largest,
                       nearest_rows *tiles, tvk_nearest *of_rows, tvk_nearest *of_columns) {
  const int32_t num_chunks = (rows->num + NEAREST_ROWS - 1) / NEAREST_ROWS;
  int32_t chunk, b, t, q;
  for (chunk = 0; chunk < num_chunks; ++chunk) {
    const int32_t num_tiles = make_chunk(rows, chunk, num_chunks, largest, tiles);
    for (b = 0; b < num_blocks; ++b) {
      forget_columns(&blocks[b]);
      for (t = 0; t < num_tiles; ++t) meet_tile(&tiles[t], &blocks[b]);
      merge_columns(&blocks[b], chunk, num_chunks, columns, first_column + b * NEAREST_COLUMNS,
                    of_columns);
    }
    for (t = 0; t < num_tiles; ++t) {
      const int32_t rank = (t * num_chunks + chunk) * NEAREST_QUERIES;
      for (q = 0; q < NEAREST_QUERIES && rank + q < rows->num; ++q) {
        merge_lanes(tiles[t].best + q * NEAREST_LANES, tiles[t].second + q * NEAREST_LANES,
                    tiles[t].norms[q], first_column / NEAREST_VECTORS,
                    &of_rows[rows->order[rank + q]]);
      }
    }
  }
}

/* Neither inlined nor unrolled: together this saves 570 bytes in the AVX-512 set. */
static TVK_NOINLINE void forget_nearest(tvk_nearest *lists, int32_t count) {
  int32_t i, k;
  for (i = 0; i < count; ++i) {
    TVK_ROLLED
    for (k = 0; k < TVK_NEAREST_LIST; ++k) lists[i].dists[k] = TVK_NEAREST_NONE;
  }
}

static int32_t nearest_groups(const tvk_descriptors *rows, const tvk_descriptors *columns,
                              void *scratch, tvk_nearest *of_columns, tvk_nearest *of_rows) {
  nearest_rows *const tiles = (nearest_rows *)scratch;
  nearest_block *const blocks =
      (nearest_block *)(void *)((uint8_t *)scratch + TVK_NEAREST_CHUNK_BYTES(rows->num));
  const int32_t largest = largest_byte(columns->bytes, (int64_t)columns->num * TVK_DESCRIPTOR_SIZE);
  int32_t first, b;
  forget_nearest(of_rows, rows->num);
  forget_nearest(of_columns, columns->num);
  for (first = 0; first < columns->num; first += NEAREST_PANEL) {
    const int32_t count = nearest_min(NEAREST_PANEL, columns->num - first);
    const int32_t num_blocks = (count + NEAREST_COLUMNS - 1) / NEAREST_COLUMNS;
    for (b = 0; b < num_blocks; ++b) {
      make_block(columns, first + b * NEAREST_COLUMNS, b, largest, &blocks[b]);
    }
    meet_panel(rows, blocks, num_blocks, columns, first, largest, tiles, of_rows, of_columns);
  }
  return NEAREST_QUERIES;
}

/* The table for ARMv8.2's dot product uses the NEON set's squared_distances. */
#if !defined(TVK_NEON_DOT)
static TVK_NOINLINE int32_t squared_distance(const uint8_t *a, const uint8_t *b) {
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
    const int16_t difference = (int16_t)(a[k] - b[k]);
    sum += difference * difference;
  }
  return sum;
}

static void squared_distances(const uint8_t *query, const uint8_t *rows, const int32_t *indices,
                              int32_t count, int32_t *out) {
  int32_t k;
  for (k = 0; k < count; ++k) {
    out[k] = squared_distance(query, rows + (int64_t)indices[k] * TVK_DESCRIPTOR_SIZE);
  }
}
#endif
