/* The tile of nearest.h in plain C. It computes four dot products of 16-bit numbers at a time, a
   loop that every compiler turns into the multiply-adds of its base instruction set. */

enum { NEAREST_LANES = 4, NEAREST_VECTORS = 4, NEAREST_QUERIES = 4, NEAREST_ROWS = 128 };
enum { NEAREST_SHIFT = 2 };
enum { NEAREST_PANEL = TVK_NEAREST_PANEL_16 };

typedef struct nearest_rows {
  int16_t values[NEAREST_QUERIES][TVK_DESCRIPTOR_SIZE];
  int32_t norms[NEAREST_QUERIES], terms[NEAREST_QUERIES];
  int32_t best[NEAREST_QUERIES * NEAREST_LANES], second[NEAREST_QUERIES * NEAREST_LANES];
} nearest_rows;

typedef struct nearest_block {
  int16_t values[NEAREST_COLUMNS][TVK_DESCRIPTOR_SIZE];
  int32_t norms[NEAREST_COLUMNS], terms[NEAREST_COLUMNS];
  int32_t best[NEAREST_COLUMNS], second[NEAREST_COLUMNS];
} nearest_block;

/* Widens one descriptor, or zeros if it is null. */
static TVK_NOINLINE void widen(const uint8_t *bytes, int32_t place, int16_t *values, int32_t *norm,
                               int32_t *term) {
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) values[k] = 0;
  if (bytes) {
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) values[k] = bytes[k];
  }
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += values[k] * values[k];
  *norm = sum;
  *term = bytes ? nearest_term(sum, place) : NEAREST_FAR;
}

static void make_rows(const tvk_descriptors *rows, int32_t first, int32_t place, int32_t largest,
                      nearest_rows *tile) {
  int32_t i;
  (void)largest;
  for (i = 0; i < NEAREST_QUERIES; ++i) {
    widen(ranked(rows, first + i), place + i, tile->values[i], &tile->norms[i], &tile->terms[i]);
  }
}

static void make_block(const tvk_descriptors *columns, int32_t first, int32_t place,
                       int32_t largest, nearest_block *block) {
  int32_t j;
  (void)largest;
  for (j = 0; j < NEAREST_COLUMNS; ++j) {
    widen(ranked(columns, column_rank(first, j)), place + j / NEAREST_LANES, block->values[j],
          &block->norms[j], &block->terms[j]);
  }
}

static inline void products_of_four(const int16_t *a, const int16_t (*b)[TVK_DESCRIPTOR_SIZE],
                                    int32_t *products) {
  int32_t sum0 = 0, sum1 = 0, sum2 = 0, sum3 = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
    sum0 += a[k] * b[0][k];
    sum1 += a[k] * b[1][k];
    sum2 += a[k] * b[2][k];
    sum3 += a[k] * b[3][k];
  }
  products[0] = -sum0;
  products[1] = -sum1;
  products[2] = -sum2;
  products[3] = -sum3;
}

static void tile_products(const nearest_rows *rows, const nearest_block *block, int32_t *products) {
  int32_t i, j;
  for (i = 0; i < NEAREST_QUERIES; ++i) {
    for (j = 0; j < NEAREST_COLUMNS; j += 4) {
      products_of_four(rows->values[i], block->values + j, products + NEAREST_COLUMNS * i + j);
    }
  }
}
