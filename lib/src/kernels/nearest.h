/* The kernel nearest_groups: for each of two sets of 128-byte descriptors, the groups of
   descriptors of the other set that are nearest, found by comparing all pairs.

   Rows (descriptors of image 0) and columns (of image 1) are compared in tiles of NEAREST_QUERIES x
   NEAREST_COLUMNS. For each pair a, b a tile makes two keys: one from |a|^2 - 2 a . b for b's list
   and one from |b|^2 - 2 a . b for a's list. The term that is missing for the squared distance is
   the same for the whole list. A key is that number (24 bits with its sign) << 8, plus the place of
   a in the low 8 bits: of the row among those of a chunk, or of the column among those of its lane
   in a panel.

   A group is the set of descriptors of a tile that share a list entry: all rows of the tile for a
   column; the columns of the tile in one lane for a row. A tile computes the smallest key of each
   group. The two smallest keys are kept of each column for a chunk of rows, and of each row for a
   lane: such a set of groups is a bin. From these pairs of keys merge_keys (columns, NEAREST_LANES
   at a time) and merge_lanes (a row) collect the list of the nearest groups of a descriptor. What a
   bin holds besides is not nearer than its second key, which is marked in the list.

   A group consists of descriptors whose ranks follow each other, and the next ranks are in another
   bin. Where the caller ranks keypoints of a neighbourhood together, these are then in few groups
   and in different bins, and the list reaches beyond them.

   Each kernel set provides the tile in a file of its own (nearest_*.h): the constants
   NEAREST_LANES, _VECTORS, _QUERIES, _SHIFT (a tile has 1 << _SHIFT places of rows), _ROWS (rows of
   a chunk) and _PANEL; the structs nearest_rows and nearest_block; make_rows and make_block, which
   fill them; largest_byte where these need it (AVX2); and tile_products, which writes -a . b of all
   pairs of a tile, row by row. The AVX-512 set has a meet_tile of its own in its place. */

#define NEAREST_FAR INT32_MAX
#define NEAREST_COLUMNS (NEAREST_LANES * NEAREST_VECTORS)
#define NEAREST_PLACES 256
#define NEAREST_UNUSED 127                             /* each byte of a key that is not used */
#define NEAREST_TILES (NEAREST_ROWS / NEAREST_QUERIES) /* of a chunk */

/* The part of a key that does not depend on the product: the squared norm and the place. make_rows
   and make_block write NEAREST_FAR instead for rows and columns after the last descriptor; no key
   is larger. */
static inline int32_t nearest_term(int32_t norm, int32_t place) { return norm * 256 + place; }

#if !defined(TVK_AVX512)
/* Not inlined, like the other functions that run once per descriptor or tile instead of once per
   pair: -O3 would copy them to each call. */
static TVK_NOINLINE int32_t squared_norm(const uint8_t *a) {
  int16_t wide[TVK_DESCRIPTOR_SIZE]; /* so that the compiler uses multiply-adds of 16-bit numbers */
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) wide[k] = a[k];
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += wide[k] * wide[k];
  return sum;
}
#endif

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
               sizeof(nearest_block) <= NEAREST_COLUMNS * (NEAREST_PANEL == TVK_NEAREST_PANEL_16
                                                               ? TVK_NEAREST_COLUMN_16_BYTES
                                                               : TVK_NEAREST_COLUMN_BYTES));
NEAREST_ASSERT(nearest_chunks_are_whole, NEAREST_ROWS % NEAREST_QUERIES == 0 &&
                                             NEAREST_QUERIES <= 1 << NEAREST_SHIFT &&
                                             NEAREST_TILES << NEAREST_SHIFT <= NEAREST_PLACES);
NEAREST_ASSERT(nearest_groups_of_columns,
               NEAREST_VECTORS == TVK_NEAREST_GROUP && 16 % NEAREST_LANES == 0);
NEAREST_ASSERT(nearest_panels_are_whole, 64 % NEAREST_COLUMNS == 0 &&
                                             NEAREST_PANEL % NEAREST_COLUMNS == 0 &&
                                             NEAREST_PANEL / NEAREST_LANES <= NEAREST_PLACES);
#undef NEAREST_ASSERT

static inline int32_t nearest_min(int32_t a, int32_t b) { return a < b ? a : b; }

/* Vectors of NEAREST_LANES keys, signed and unsigned. */
typedef int32_t int_lanes __attribute__((vector_size(4 * NEAREST_LANES)));
typedef uint32_t key_lanes __attribute__((vector_size(4 * NEAREST_LANES)));
typedef int32_t unaligned_int_lanes
    __attribute__((vector_size(4 * NEAREST_LANES), aligned(4), may_alias));
typedef uint16_t rank_lanes __attribute__((vector_size(2 * NEAREST_LANES)));
typedef uint16_t unaligned_rank_lanes
    __attribute__((vector_size(2 * NEAREST_LANES), aligned(2), may_alias));

static inline int_lanes load_ints(const int32_t *p) { return *(const unaligned_int_lanes *)p; }
static inline void store_ints(int32_t *p, int_lanes x) { *(unaligned_int_lanes *)p = x; }
static inline int_lanes load_ranks(const uint16_t *p) {
  return __builtin_convertvector(*(const unaligned_rank_lanes *)p, int_lanes);
}
static inline void store_ranks(uint16_t *p, int_lanes x) {
  *(unaligned_rank_lanes *)p = __builtin_convertvector(x, rank_lanes);
}

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

/* Keys of a list: its terms and the scaled products. Modulo 2^32, like the scaling. */
static inline int_lanes make_keys(int_lanes terms, const int32_t *products) {
  return (int_lanes)((key_lanes)terms + (key_lanes)load_ints(products));
}

static inline int_lanes scale_and_make_keys(int_lanes terms, int32_t *products) {
  store_ints(products, (int_lanes)((key_lanes)load_ints(products) << 9));
  return make_keys(terms, products);
}

/* `a` where all bits of the mask are set, else `b`. */
static inline int_lanes select_lanes(int_lanes mask, int_lanes a, int_lanes b) {
  return (a & mask) | (b & ~mask);
}

/* The keys of lists: twice the distance, and 1 for the second group of a bin. */
static inline int_lanes list_keys(int_lanes keys, int_lanes norms, int32_t odd) {
  return ((keys >> 8) + norms) * 2 + odd;
}

/* Merges the two keys of each of NEAREST_LANES columns into their lists. A tile of rows begins
   `step` ranks after the one before, the first with rank `first`. */
static TVK_NOINLINE void merge_keys(const int32_t *best, const int32_t *second,
                                    const int32_t *norms, int32_t step, int32_t first,
                                    tvk_nearest_lists *lists, int32_t lane) {
  int32_t odd, k;
  for (odd = 0; odd < 2; ++odd) {
    const int_lanes from = load_ints(odd ? second : best);
    int_lanes keys = list_keys(from, load_ints(norms), odd);
    int_lanes ranks = ((from & (NEAREST_PLACES - 1)) >> NEAREST_SHIFT) * step + first +
                      (from & ((1 << NEAREST_SHIFT) - 1));
    TVK_ROLLED
    for (k = 0; k < TVK_NEAREST_LIST; ++k) {
      int32_t *const key = lists->entries[k].keys + lane;
      uint16_t *const rank = lists->entries[k].ranks + lane;
      const int_lanes old = load_ints(key), old_ranks = load_ranks(rank), less = keys < old;
      store_ints(key, min_lanes(keys, old));
      store_ranks(rank, select_lanes(less, ranks, old_ranks));
      keys = max_lanes(keys, old);
      ranks = select_lanes(less, old_ranks, ranks);
    }
  }
}

/* Merges the keys of a block, number `number` of all blocks of columns, into the columns' lists. Of
   num_chunks chunks of rows this is number `chunk`. */
static inline void merge_columns(const nearest_block *block, int32_t number, int32_t chunk,
                                 int32_t num_chunks, tvk_nearest_lists *of_columns) {
  const int32_t step = num_chunks * NEAREST_QUERIES, first = chunk * NEAREST_QUERIES;
  const int32_t lane = number * NEAREST_LANES % 16;
  tvk_nearest_lists *lists = of_columns + number * NEAREST_LANES / 16 * NEAREST_VECTORS;
  int32_t v;
  TVK_ROLLED
  for (v = 0; v < NEAREST_COLUMNS; v += NEAREST_LANES, ++lists) {
    merge_keys(block->best + v, block->second + v, block->norms + v, step, first, lists, lane);
  }
}

/* The smallest key, in every lane. */
static inline int_lanes smallest_key(int_lanes keys) {
#if defined(TVK_AVX512)
  __m512i x = (__m512i)keys;
  x = _mm512_min_epi32(x, _mm512_shuffle_i64x2(x, x, 0x4E));
  x = _mm512_min_epi32(x, _mm512_shuffle_i64x2(x, x, 0xB1));
  x = _mm512_min_epi32(x, _mm512_shuffle_epi32(x, (_MM_PERM_ENUM)0x4E));
  return (int_lanes)_mm512_min_epi32(x, _mm512_shuffle_epi32(x, (_MM_PERM_ENUM)0xB1));
#elif defined(TVK_AVX2)
  __m256i x = (__m256i)keys;
  x = _mm256_min_epi32(x, _mm256_permute2x128_si256(x, x, 1));
  x = _mm256_min_epi32(x, _mm256_shuffle_epi32(x, 0x4E));
  return (int_lanes)_mm256_min_epi32(x, _mm256_shuffle_epi32(x, 0xB1));
#else
  const int_lanes zero = {0};
  return zero + nearest_min(nearest_min(keys[0], keys[1]), nearest_min(keys[2], keys[3]));
#endif
}

/* The ranks of the columns with these keys; `first` is the rank of the panel's first column. */
static inline int_lanes ranks_of(int_lanes keys, int_lanes lanes, int32_t first) {
  const int_lanes places = keys & (NEAREST_PLACES - 1);
  return (places & ~(NEAREST_VECTORS - 1)) * NEAREST_LANES + lanes * NEAREST_VECTORS +
         (places & (NEAREST_VECTORS - 1)) + first;
}

/* Merges the keys of a row, two for each lane, into its list; `first` is the rank of the panel's
   first column. The smallest key is moved to the list again and again; its low five bits say which
   one it is. */
static TVK_NOINLINE void merge_lanes(const int32_t *best, const int32_t *second, int32_t norm,
                                     int32_t first, tvk_nearest *list) {
  const tvk_nearest old = *list;
  const int_lanes zero = {0};
  int_lanes lanes, keys = zero, next = zero;
  int32_t ranks[32], k, odd, num_old = 0;
  for (k = 0; k < NEAREST_LANES; ++k) lanes[k] = k;
  for (odd = 0; odd < 2; ++odd) {
    const int_lanes from = load_ints(odd ? second : best);
    store_ints(ranks + 16 * odd, ranks_of(from, lanes, first));
    keys = next;
    next = list_keys(from, zero + norm, odd) * 16 + lanes;
  }
  for (k = 0; k < TVK_NEAREST_LIST; ++k) {
    const int_lanes smallest_keys = smallest_key(keys);
    const int32_t smallest = smallest_keys[0];
    if (old.keys[num_old] <= smallest >> 4) {
      list->keys[k] = old.keys[num_old];
      list->ranks[k] = old.ranks[num_old++];
    } else {
      const int_lanes taken = keys == smallest_keys;
      list->keys[k] = smallest >> 4;
      list->ranks[k] = (uint16_t)ranks[smallest & 31];
      keys = select_lanes(taken, next, keys);
      next |= taken & NEAREST_FAR;
    }
  }
}

/* Updates the two smallest keys of each lane with one more key. */
static inline void update_two(int_lanes keys, int32_t *best, int32_t *second) {
  const int_lanes old = load_ints(best);
  store_ints(second, min_lanes(load_ints(second), max_lanes(keys, old)));
  store_ints(best, min_lanes(keys, old));
}

#if defined(TVK_AVX512)
#include "kernels/nearest_tile_avx512.h"
#else
/* Scales a row's products of a tile by 512, and updates the row's lists, one per lane, with its
   keys: the smallest key of each lane. */
static inline void update_row(int32_t *products, const int32_t *terms, int32_t *best,
                              int32_t *second) {
  int_lanes keys = scale_and_make_keys(load_ints(terms), products);
  int32_t v;
  for (v = NEAREST_LANES; v < NEAREST_COLUMNS; v += NEAREST_LANES) {
    keys = min_lanes(keys, scale_and_make_keys(load_ints(terms + v), products + v));
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
#endif

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
    make_rows(rows, first, t << NEAREST_SHIFT, largest, &tiles[t]);
    for (k = 0; k < NEAREST_QUERIES * NEAREST_LANES; ++k) {
      tiles[t].best[k] = tiles[t].second[k] = NEAREST_FAR;
    }
  }
  return t;
}

/* Compares all rows with the panel of columns from rank `first_column` on, a chunk of rows at a
   time: a chunk stays in the first-level cache. */
static void meet_panel(const tvk_descriptors *rows, nearest_block *blocks, int32_t num_blocks,
                       int32_t first_column, int32_t largest, nearest_rows *tiles,
                       tvk_nearest *of_rows, tvk_nearest_lists *of_columns) {
  const int32_t num_chunks = (rows->num + NEAREST_ROWS - 1) / NEAREST_ROWS;
  int32_t chunk, b, t, q;
  for (chunk = 0; chunk < num_chunks; ++chunk) {
    const int32_t num_tiles = make_chunk(rows, chunk, num_chunks, largest, tiles);
    for (b = 0; b < num_blocks; ++b) {
      forget_columns(&blocks[b]);
      for (t = 0; t < num_tiles; ++t) meet_tile(&tiles[t], &blocks[b]);
      merge_columns(&blocks[b], first_column / NEAREST_COLUMNS + b, chunk, num_chunks, of_columns);
    }
    for (t = 0; t < num_tiles; ++t) {
      const int32_t rank = (t * num_chunks + chunk) * NEAREST_QUERIES;
      for (q = 0; q < NEAREST_QUERIES && rank + q < rows->num; ++q) {
        merge_lanes(tiles[t].best + q * NEAREST_LANES, tiles[t].second + q * NEAREST_LANES,
                    tiles[t].norms[q], first_column, &of_rows[rows->order[rank + q]]);
      }
    }
  }
}

static tvk_nearest_shape nearest_groups(const tvk_descriptors *rows, const tvk_descriptors *columns,
                                        void *scratch, tvk_nearest_lists *of_columns,
                                        tvk_nearest *of_rows) {
  nearest_rows *const tiles = (nearest_rows *)scratch;
  nearest_block *const blocks =
      (nearest_block *)(void *)((uint8_t *)scratch + TVK_NEAREST_CHUNK_BYTES(rows->num));
  const int32_t largest = largest_byte(columns->bytes, (int64_t)columns->num * TVK_DESCRIPTOR_SIZE);
  const tvk_nearest_shape shape = {NEAREST_QUERIES, (rows->num + NEAREST_ROWS - 1) / NEAREST_ROWS,
                                   NEAREST_LANES};
  int32_t first, b;
  memset(of_rows, NEAREST_UNUSED, (size_t)rows->num * sizeof *of_rows);
  memset(of_columns, NEAREST_UNUSED, TVK_NEAREST_LISTS((size_t)columns->num) * sizeof *of_columns);
  for (first = 0; first < columns->num; first += NEAREST_PANEL) {
    const int32_t count = nearest_min(NEAREST_PANEL, columns->num - first);
    const int32_t num_blocks = (count + NEAREST_COLUMNS - 1) / NEAREST_COLUMNS;
    for (b = 0; b < num_blocks; ++b) {
      make_block(columns, first + b * NEAREST_COLUMNS, b * NEAREST_VECTORS, largest, &blocks[b]);
    }
    meet_panel(rows, blocks, num_blocks, first, largest, tiles, of_rows, of_columns);
  }
  return shape;
}

#if defined(TVK_AVX2) || defined(TVK_AVX512)
#if defined(TVK_AVX512)
typedef __m512i wide_bytes; /* bytes as 16-bit numbers */
static inline wide_bytes widen(const uint8_t *p) {
  return _mm512_cvtepu8_epi16(_mm256_loadu_si256((const __m256i *)p));
}
#else
typedef __m256i wide_bytes;
static inline wide_bytes widen(const uint8_t *p) {
  return _mm256_cvtepu8_epi16(_mm_loadu_si128((const __m128i *)p));
}
#endif
enum {
  WIDE_BYTES = sizeof(wide_bytes) / 2,
  WIDE_QUERY = TVK_DESCRIPTOR_SIZE / WIDE_BYTES,
  DISTANCES = 4
};

/* Eight parts of a squared distance. */
static inline __m256i parts_of_distance(const wide_bytes query[WIDE_QUERY], const uint8_t *row) {
  int32_t k;
#if defined(TVK_AVX512)
  __m512i sum = _mm512_setzero_si512();
  for (k = 0; k < WIDE_QUERY; ++k) {
    const __m512i difference = _mm512_sub_epi16(query[k], widen(row + WIDE_BYTES * k));
    sum = _mm512_dpwssd_epi32(sum, difference, difference);
  }
  return _mm256_add_epi32(_mm512_castsi512_si256(sum), _mm512_extracti64x4_epi64(sum, 1));
#else
  __m256i sum = _mm256_setzero_si256();
  for (k = 0; k < WIDE_QUERY; ++k) {
    const __m256i difference = _mm256_sub_epi16(query[k], widen(row + WIDE_BYTES * k));
    sum = _mm256_add_epi32(sum, _mm256_madd_epi16(difference, difference));
  }
  return sum;
#endif
}

/* The query is widened once, and the parts of four distances are added together. */
static void squared_distances(const uint8_t *query, const uint8_t *rows, const int32_t *indices,
                              int32_t count, int32_t *out) {
  wide_bytes wide[WIDE_QUERY];
  int32_t k, j, last[DISTANCES];
  for (k = 0; k < WIDE_QUERY; ++k) wide[k] = widen(query + WIDE_BYTES * k);
  for (k = 0; k < count; k += DISTANCES) {
    __m256i parts[DISTANCES], halves;
    TVK_ROLLED
    for (j = 0; j < DISTANCES; ++j) { /* the last one again, where there are fewer */
      const int32_t idx = indices[nearest_min(k + j, count - 1)];
      parts[j] = parts_of_distance(wide, rows + (int64_t)idx * TVK_DESCRIPTOR_SIZE);
    }
    halves = sums_of_halves(parts);
    _mm_storeu_si128(
        (__m128i *)(k + DISTANCES > count ? last : out + k),
        _mm_add_epi32(_mm256_castsi256_si128(halves), _mm256_extracti128_si256(halves, 1)));
  }
  if (k > count) memcpy(out + k - DISTANCES, last, sizeof *out * (size_t)(count + DISTANCES - k));
}
#elif !defined(TVK_NEON_DOT) /* its table uses the NEON set's squared_distances */
static inline int32_t squared_distance(const uint8_t *a, const uint8_t *b) {
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
