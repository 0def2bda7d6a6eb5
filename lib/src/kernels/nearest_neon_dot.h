/* The tile of nearest.h for the dot product of ARMv8.2. A lane is a column; a register holds four
   bytes each of four columns, and 24 sums stay in registers. */
#include <arm_neon.h>

enum { NEAREST_LANES = 4, NEAREST_VECTORS = 4, NEAREST_QUERIES = 6, NEAREST_ROWS = 192 };
enum { NEAREST_SHIFT = 3 };
enum { NEAREST_PANEL = TVK_NEAREST_PANEL / 2 };
enum { NEAREST_GROUPS = TVK_DESCRIPTOR_SIZE / 4 };

typedef struct nearest_rows {
  uint8_t bytes[NEAREST_QUERIES][TVK_DESCRIPTOR_SIZE];
  int32_t best[NEAREST_QUERIES * NEAREST_LANES], second[NEAREST_QUERIES * NEAREST_LANES];
  int32_t norms[8], terms[8];
} nearest_rows;

typedef struct nearest_block {
  uint8_t bytes[NEAREST_GROUPS][NEAREST_COLUMNS][4];
  int32_t norms[NEAREST_COLUMNS], terms[NEAREST_COLUMNS];
  int32_t best[NEAREST_COLUMNS], second[NEAREST_COLUMNS];
} nearest_block;

static void make_rows(const tvk_descriptors *rows, int32_t first, int32_t place, int32_t largest,
                      nearest_rows *tile) {
  int32_t i;
  (void)largest;
  memset(tile->bytes, 0, sizeof tile->bytes);
  for (i = 0; i < NEAREST_QUERIES; ++i) {
    const uint8_t *const row = ranked(rows, first + i);
    tile->norms[i] = row ? squared_norm(row) : 0;
    tile->terms[i] = row ? nearest_term(tile->norms[i], place + i) : NEAREST_FAR;
    if (row) memcpy(tile->bytes[i], row, TVK_DESCRIPTOR_SIZE);
  }
}

static void make_block(const tvk_descriptors *columns, int32_t first, int32_t place,
                       int32_t largest, nearest_block *block) {
  int32_t j, k;
  (void)largest;
  if (first + NEAREST_COLUMNS > columns->num) memset(block->bytes, 0, sizeof block->bytes);
  for (j = 0; j < NEAREST_COLUMNS; ++j) {
    const uint8_t *const column = ranked(columns, column_rank(first, j));
    if (column) {
      for (k = 0; k < NEAREST_GROUPS; ++k) memcpy(block->bytes[k][j], column + 4 * k, 4);
    }
    block->norms[j] = column ? squared_norm(column) : 0;
    block->terms[j] =
        column ? nearest_term(block->norms[j], place + j / NEAREST_LANES) : NEAREST_FAR;
  }
}

static inline uint8x16_t four_neon(const uint8_t *row) {
  uint32_t four;
  memcpy(&four, row, 4);
  return vreinterpretq_u8_u32(vdupq_n_u32(four));
}

static inline void store_negated(int32_t *products, uint32x4_t sums) {
  vst1q_s32(products, vnegq_s32(vreinterpretq_s32_u32(sums)));
}

/* Each sum is a variable with its own name (s20: row 2, first four columns), as in
   nearest_avx512.h. */
#define EACH_ROW(do) \
  do (0) do(1) do(2) do(3) do(4) do(5)

#define START(i) uint32x4_t s##i##0 = zero, s##i##1 = zero, s##i##2 = zero, s##i##3 = zero;

#define ADD(i)                                 \
  row = four_neon(rows->bytes[i] + 4 * g);     \
  s##i##0 = vdotq_u32(s##i##0, columns0, row); \
  s##i##1 = vdotq_u32(s##i##1, columns1, row); \
  s##i##2 = vdotq_u32(s##i##2, columns2, row); \
  s##i##3 = vdotq_u32(s##i##3, columns3, row);

#define STORE(i)                                 \
  store_negated(products + 16 * i, s##i##0);     \
  store_negated(products + 16 * i + 4, s##i##1); \
  store_negated(products + 16 * i + 8, s##i##2); \
  store_negated(products + 16 * i + 12, s##i##3);

static void tile_products(const nearest_rows *rows, const nearest_block *block, int32_t *products) {
  const uint32x4_t zero = vdupq_n_u32(0);
  int32_t g;
  EACH_ROW(START)
  for (g = 0; g < NEAREST_GROUPS; ++g) {
    const uint8x16_t columns0 = vld1q_u8(block->bytes[g][0]);
    const uint8x16_t columns1 = vld1q_u8(block->bytes[g][4]);
    const uint8x16_t columns2 = vld1q_u8(block->bytes[g][8]);
    const uint8x16_t columns3 = vld1q_u8(block->bytes[g][12]);
    uint8x16_t row;
    EACH_ROW(ADD)
  }
  EACH_ROW(STORE)
}

#undef EACH_ROW
#undef START
#undef ADD
#undef STORE
