/* The tile of nearest.h for AVX2. A lane is a column; a register holds four bytes each of eight
   columns.

   vpmaddubsw multiplies unsigned by signed bytes and adds pairs of products in 16 bits. Columns are
   stored as c - b, where c is half the largest byte, so that |c - b| <= h = largest - c. Two such
   sums of pairs are added in 16 bits before they are widened. This is exact if the four bytes of
   the row add up to at most 32767 / h: 255 at worst, 370 for descriptors as they are, whose mean
   byte is 35. A row whose bytes add up to more is split into a sum of rows that satisfy the bound.
   Each of these is a further step; they are almost never needed. */
#include <immintrin.h>

enum { NEAREST_LANES = 8, NEAREST_VECTORS = 4, NEAREST_QUERIES = 2, NEAREST_ROWS = 64 };
enum { NEAREST_SHIFT = 1 };
enum { NEAREST_PANEL = TVK_NEAREST_PANEL };
enum { NEAREST_GROUPS = TVK_DESCRIPTOR_SIZE / 4, NEAREST_MOST_STEPS = 2 * NEAREST_GROUPS };

/* A row as a sequence of steps. bytes[s] are eight bytes of each row of the tile, and places[s]
   says with which of the groups of four bytes of a column they are multiplied: this one and the
   next. */
typedef struct nearest_rows {
  uint8_t bytes[NEAREST_MOST_STEPS][NEAREST_QUERIES][8];
  int32_t places[NEAREST_MOST_STEPS], num_steps;
  int32_t starts[NEAREST_QUERIES]; /* -c times the sum of the bytes of row a */
  int32_t norms[NEAREST_QUERIES], terms[NEAREST_QUERIES];
  int32_t best[NEAREST_QUERIES * NEAREST_LANES], second[NEAREST_QUERIES * NEAREST_LANES];
} nearest_rows;

typedef struct nearest_block {
  int8_t bytes[NEAREST_GROUPS][NEAREST_COLUMNS][4];
  int32_t norms[NEAREST_COLUMNS], terms[NEAREST_COLUMNS];
  int32_t best[NEAREST_COLUMNS], second[NEAREST_COLUMNS];
} nearest_block;

static inline int32_t largest_byte(const uint8_t *bytes, int64_t count) {
  uint8_t largest = 0;
  int64_t k;
  for (k = 0; k < count; ++k) largest = bytes[k] > largest ? bytes[k] : largest;
  return largest;
}

static inline int32_t nearest_centre(int32_t largest) { return largest / 2; }

/* Moves from `left` to `step` as much of eight bytes as may be added in 16 bits. The bytes that are
   added in one sum are 0 1 4 5 and 2 3 6 7; each sum is limited to `most`. Returns whether a part
   is left for a further step. */
static inline int32_t take_step(uint8_t *left, int32_t most, uint8_t *step) {
  static const uint8_t meet[2][4] = {{0, 1, 4, 5}, {2, 3, 6, 7}};
  int32_t half, k, stays = 0;
  if (left[0] + left[1] + left[4] + left[5] <= most &&
      left[2] + left[3] + left[6] + left[7] <= most) {
    memcpy(step, left, 8);
    memset(left, 0, 8);
    return 0;
  }
  for (half = 0; half < 2; ++half) {
    int32_t room = most;
    for (k = 0; k < 4; ++k) {
      uint8_t *const from = left + meet[half][k];
      const int32_t part = *from < room ? *from : room;
      step[meet[half][k]] = (uint8_t)part;
      *from = (uint8_t)(*from - part);
      room -= part;
      stays |= *from;
    }
  }
  return stays;
}

static void make_rows(const tvk_descriptors *rows, int32_t first, int32_t place, int32_t largest,
                      nearest_rows *tile) {
  const int32_t centre = nearest_centre(largest), farthest = largest - centre;
  const int32_t most = farthest > 0 ? 32767 / farthest : 32767;
  int32_t i, k, p;
  uint8_t left[NEAREST_QUERIES][TVK_DESCRIPTOR_SIZE];
  memset(left, 0, sizeof left);
  for (i = 0; i < NEAREST_QUERIES; ++i) {
    const uint8_t *const row = ranked(rows, first + i);
    int32_t sum = 0;
    if (row) memcpy(left[i], row, TVK_DESCRIPTOR_SIZE);
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += left[i][k];
    tile->norms[i] = squared_norm(left[i]);
    tile->terms[i] = row ? nearest_term(tile->norms[i], place + i) : NEAREST_FAR;
    tile->starts[i] = -centre * sum;
  }
  tile->num_steps = 0;
  for (p = 0; p < TVK_DESCRIPTOR_SIZE / 8; ++p) {
    int32_t stays;
    do {
      const int32_t step = tile->num_steps++;
      tile->places[step] = 2 * p;
      stays = 0;
      for (i = 0; i < NEAREST_QUERIES; ++i) {
        stays |= take_step(left[i] + 8 * p, most, tile->bytes[step][i]);
      }
    } while (stays);
  }
}

static void make_block(const tvk_descriptors *columns, int32_t first, int32_t place,
                       int32_t largest, nearest_block *block) {
  const int32_t centre = nearest_centre(largest);
  int32_t j, k;
  if (first + NEAREST_COLUMNS > columns->num) memset(block->bytes, centre, sizeof block->bytes);
  for (j = 0; j < NEAREST_COLUMNS; ++j) {
    const uint8_t *const column = ranked(columns, column_rank(first, j));
    if (column) {
      int8_t centred[TVK_DESCRIPTOR_SIZE];
      for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) centred[k] = (int8_t)(centre - column[k]);
      TVK_ROLLED
      for (k = 0; k < NEAREST_GROUPS; ++k) memcpy(block->bytes[k][j], centred + 4 * k, 4);
    }
    block->norms[j] = column ? squared_norm(column) : 0;
    block->terms[j] =
        column ? nearest_term(block->norms[j], place + j / NEAREST_LANES) : NEAREST_FAR;
  }
}

static inline __m256i load_avx2(const void *from) {
  return _mm256_loadu_si256((const __m256i *)from);
}

static inline __m256i four_avx2(const uint8_t *row) {
  int32_t four;
  memcpy(&four, row, 4);
  return _mm256_set1_epi32(four);
}

/* For each of eight columns, the products with eight bytes of the row, four in `row` and four in
   `next`, summed. */
static inline __m256i products_avx2(__m256i row, __m256i next, const int8_t *columns) {
  const __m256i pairs =
      _mm256_add_epi16(_mm256_maddubs_epi16(row, load_avx2(columns)),
                       _mm256_maddubs_epi16(next, load_avx2(columns + 4 * NEAREST_COLUMNS)));
  return _mm256_madd_epi16(pairs, _mm256_set1_epi16(1));
}

static inline void store_avx2(int32_t *to, __m256i x) { _mm256_storeu_si256((__m256i *)to, x); }

/* Each sum is a variable with its own name (s12: row 1, third eight columns), because gcc 12 keeps
   arrays of sums in memory. */
#define START(i)                                                           \
  __m256i s##i##0 = _mm256_set1_epi32(rows->starts[i]), s##i##1 = s##i##0; \
  __m256i s##i##2 = s##i##0, s##i##3 = s##i##0;

#define ADD(i)                                                                 \
  row = four_avx2(rows->bytes[step][i]);                                       \
  next = four_avx2(rows->bytes[step][i] + 4);                                  \
  s##i##0 = _mm256_add_epi32(s##i##0, products_avx2(row, next, columns));      \
  s##i##1 = _mm256_add_epi32(s##i##1, products_avx2(row, next, columns + 32)); \
  s##i##2 = _mm256_add_epi32(s##i##2, products_avx2(row, next, columns + 64)); \
  s##i##3 = _mm256_add_epi32(s##i##3, products_avx2(row, next, columns + 96));

#define STORE(i)                               \
  store_avx2(products + 32 * i, s##i##0);      \
  store_avx2(products + 32 * i + 8, s##i##1);  \
  store_avx2(products + 32 * i + 16, s##i##2); \
  store_avx2(products + 32 * i + 24, s##i##3);

static void tile_products(const nearest_rows *rows, const nearest_block *block, int32_t *products) {
  __m256i row, next;
  int32_t step;
  START(0)
  START(1)
  for (step = 0; step < rows->num_steps; ++step) {
    const int8_t *const columns = block->bytes[rows->places[step]][0];
    ADD(0)
    /* Prevents the compiler from holding all columns in registers until the second row: there are
       too few registers. */
    __asm__ volatile("" ::: "memory");
    ADD(1)
  }
  STORE(0)
  STORE(1)
}

#undef START
#undef ADD
#undef STORE
