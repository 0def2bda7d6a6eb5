/* The tile of nearest.h for AVX-512 VNNI. A lane is a column; a register holds four bytes each of
   16 columns, and 24 sums stay in registers. vpdpbusd multiplies unsigned by signed bytes, so rows
   are stored as 127 - a: the sum of b (127 - a) is 127 sum b - a . b. */
#include <immintrin.h>

enum { NEAREST_LANES = 16, NEAREST_VECTORS = 4, NEAREST_QUERIES = 6, NEAREST_ROWS = 192 };
enum { NEAREST_SHIFT = 3 };
enum { NEAREST_PANEL = TVK_NEAREST_PANEL };
enum { NEAREST_GROUPS = TVK_DESCRIPTOR_SIZE / 4 };

typedef struct nearest_rows {
  int8_t bytes[NEAREST_QUERIES][TVK_DESCRIPTOR_SIZE]; /* 127 - (the byte of row a) */
  int32_t best[NEAREST_QUERIES * NEAREST_LANES], second[NEAREST_QUERIES * NEAREST_LANES];
  int32_t norms[8], terms[8];
} nearest_rows;

typedef struct nearest_block {
  uint8_t bytes[NEAREST_GROUPS][NEAREST_COLUMNS][4];
  int32_t norms[NEAREST_COLUMNS], terms[NEAREST_COLUMNS];
  int32_t starts[NEAREST_COLUMNS]; /* -127 times the sum of the bytes of column b */
  int32_t best[NEAREST_COLUMNS], second[NEAREST_COLUMNS];
} nearest_block;

static void make_rows(const tvk_descriptors *rows, int32_t first, int32_t place, int32_t largest,
                      nearest_rows *tile) {
  int32_t i, k;
  (void)largest;
  for (i = 0; i < NEAREST_QUERIES; ++i) {
    const uint8_t *const row = ranked(rows, first + i);
    tile->norms[i] = row ? squared_norm(row) : 0;
    tile->terms[i] = row ? nearest_term(tile->norms[i], place + i) : NEAREST_FAR;
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) tile->bytes[i][k] = 127;
    if (row) {
      for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) tile->bytes[i][k] = (int8_t)(127 - row[k]);
    }
  }
}

static void make_block(const tvk_descriptors *columns, int32_t first, int32_t place,
                       int32_t largest, nearest_block *block) {
  int32_t j, k;
  (void)largest;
  if (first + NEAREST_COLUMNS > columns->num) memset(block->bytes, 0, sizeof block->bytes);
  for (j = 0; j < NEAREST_COLUMNS; ++j) {
    const uint8_t *const column = ranked(columns, column_rank(first, j));
    int32_t sum = 0;
    if (column) {
      for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += column[k];
      TVK_ROLLED
      for (k = 0; k < NEAREST_GROUPS; ++k) memcpy(block->bytes[k][j], column + 4 * k, 4);
    }
    block->norms[j] = column ? squared_norm(column) : 0;
    block->terms[j] =
        column ? nearest_term(block->norms[j], place + j / NEAREST_LANES) : NEAREST_FAR;
    block->starts[j] = -127 * sum;
  }
}

/* The type of the sums. With __m512i, a vector of 64-bit numbers, gcc 12 holds each sum twice. */
typedef int32_t int32x16 __attribute__((vector_size(64)));

static inline int32x16 load_avx512(const void *from) { return (int32x16)_mm512_loadu_si512(from); }

static inline int32x16 four_avx512(const int8_t *row) {
  int32_t four;
  memcpy(&four, row, 4);
  return (int32x16)_mm512_set1_epi32(four);
}

static inline int32x16 add_avx512(int32x16 sum, int32x16 columns, int32x16 row) {
  return (int32x16)_mm512_dpbusd_epi32((__m512i)sum, (__m512i)columns, (__m512i)row);
}

/* Each sum is a variable with its own name (s20: row 2, first 16 columns), because gcc 12 keeps
   arrays of sums in memory, which halves the speed. */
#define EACH_ROW(do) \
  do (0) do(1) do(2) do(3) do(4) do(5)

#define START(i) \
  int32x16 s##i##0 = columns0, s##i##1 = columns1, s##i##2 = columns2, s##i##3 = columns3;

#define ADD(i)                                  \
  row = four_avx512(rows->bytes[i] + 4 * g);    \
  s##i##0 = add_avx512(s##i##0, columns0, row); \
  s##i##1 = add_avx512(s##i##1, columns1, row); \
  s##i##2 = add_avx512(s##i##2, columns2, row); \
  s##i##3 = add_avx512(s##i##3, columns3, row);

#define STORE(i)                                                 \
  _mm512_storeu_si512(products + 64 * i, (__m512i)s##i##0);      \
  _mm512_storeu_si512(products + 64 * i + 16, (__m512i)s##i##1); \
  _mm512_storeu_si512(products + 64 * i + 32, (__m512i)s##i##2); \
  _mm512_storeu_si512(products + 64 * i + 48, (__m512i)s##i##3);

static void tile_products(const nearest_rows *rows, const nearest_block *block, int32_t *products) {
  int32x16 columns0 = load_avx512(block->starts), columns1 = load_avx512(block->starts + 16);
  int32x16 columns2 = load_avx512(block->starts + 32), columns3 = load_avx512(block->starts + 48);
  int32x16 row;
  int32_t g;
  EACH_ROW(START)
  for (g = 0; g < NEAREST_GROUPS; ++g) {
    columns0 = load_avx512(block->bytes[g]);
    columns1 = load_avx512(block->bytes[g] + 16);
    columns2 = load_avx512(block->bytes[g] + 32);
    columns3 = load_avx512(block->bytes[g] + 48);
    EACH_ROW(ADD)
  }
  EACH_ROW(STORE)
}

#undef EACH_ROW
#undef START
#undef ADD
#undef STORE
