/* The tile of nearest.h in plain C. It computes four dot products of 16-bit numbers at a time, a
   loop that every compiler turns into the multiply-adds of its base instruction set. */

enum { NEAREST_LANES = 4, NEAREST_VECTORS = 4, NEAREST_QUERIES = 4, NEAREST_ROWS = 128 };
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

static inline void widen_rows(const uint8_t *bytes, int32_t count, int32_t room, int32_t place,
                              int16_t (*values)[TVK_DESCRIPTOR_SIZE], int32_t *norms,
                              int32_t *terms) {
  int32_t i, k;
  for (i = 0; i < room; ++i, bytes += TVK_DESCRIPTOR_SIZE) {
    norms[i] = i < count ? squared_norm(bytes) : 0;
    terms[i] = i < count ? nearest_term(norms[i], place) : NEAREST_FAR;
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) values[i][k] = 0;
    if (i < count) {
      for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) values[i][k] = bytes[k];
    }
  }
}

static void make_rows(const uint8_t *rows, int32_t count, int32_t place, int32_t largest,
                      nearest_rows *tile) {
  (void)largest;
  widen_rows(rows, count, NEAREST_QUERIES, place, tile->values, tile->norms, tile->terms);
}

static void make_block(const uint8_t *columns, int32_t count, int32_t place, int32_t largest,
                       nearest_block *block) {
  (void)largest;
  widen_rows(columns, count, NEAREST_COLUMNS, place, block->values, block->norms, block->terms);
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
