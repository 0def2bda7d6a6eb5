/* Rows and blocks of nearest.h for AVX-512 VNNI; nearest_tile_avx512.h has the tile. A lane is a
   column; a register holds four bytes each of 16 columns. vpdpbusd multiplies unsigned by signed
   bytes, so rows are stored as 127 - a: the sum of b (127 - a) is 127 sum b - a . b. */
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

/* What a descriptor is stored as, and its sums. */
typedef struct prepared_descriptor {
  __m512i low, high; /* 127 - byte */
  int32_t norm, start;
} prepared_descriptor;

/* `start` is -127 times the sum of the bytes b. The sum of b (127 - b) is 127 sum b - |b|^2. */
static TVK_NOINLINE prepared_descriptor prepare_descriptor(const uint8_t *bytes) {
  const __m512i most = _mm512_set1_epi8(127), zero = _mm512_setzero_si512();
  const __m512i low = _mm512_loadu_si512(bytes), high = _mm512_loadu_si512(bytes + 64);
  prepared_descriptor d;
  d.low = _mm512_sub_epi8(most, low);
  d.high = _mm512_sub_epi8(most, high);
  d.start = -_mm512_reduce_add_epi32(
      _mm512_dpbusd_epi32(_mm512_dpbusd_epi32(zero, low, most), high, most));
  d.norm = -d.start - _mm512_reduce_add_epi32(
                          _mm512_dpbusd_epi32(_mm512_dpbusd_epi32(zero, low, d.low), high, d.high));
  return d;
}

static void make_rows(const tvk_descriptors *rows, int32_t first, int32_t place, int32_t largest,
                      nearest_rows *tile) {
  const uint8_t none[TVK_DESCRIPTOR_SIZE] = {0};
  int32_t i;
  (void)largest;
  for (i = 0; i < NEAREST_QUERIES; ++i) {
    const uint8_t *const row = ranked(rows, first + i);
    const prepared_descriptor d = prepare_descriptor(row ? row : none);
    tile->norms[i] = d.norm;
    tile->terms[i] = row ? nearest_term(d.norm, place + i) : NEAREST_FAR;
    _mm512_storeu_si512(tile->bytes[i], d.low);
    _mm512_storeu_si512(tile->bytes[i] + 64, d.high);
  }
}

/* Prefetches the descriptor of a rank: ranks that follow each other may be anywhere in the set, and
   half of prepare_descriptor's time was waiting for them. */
static inline void prefetch_ranked(const tvk_descriptors *set, int32_t rank) {
  const uint8_t *const bytes = ranked(set, rank);
  if (!bytes) return;
  _mm_prefetch((const char *)bytes, _MM_HINT_T0);
  _mm_prefetch((const char *)bytes + 64, _MM_HINT_T0);
}

static void make_block(const tvk_descriptors *columns, int32_t first, int32_t place,
                       int32_t largest, nearest_block *block) {
  const uint8_t none[TVK_DESCRIPTOR_SIZE] = {0};
  int32_t j, k;
  (void)largest;
  for (j = 0; j < NEAREST_COLUMNS; ++j) {
    const uint8_t *const column = ranked(columns, column_rank(first, j));
    const uint8_t *const bytes = column ? column : none;
    prefetch_ranked(columns, column_rank(first, j + 8));
    const prepared_descriptor d = prepare_descriptor(bytes);
    TVK_ROLLED
    for (k = 0; k < NEAREST_GROUPS; ++k) {
      memcpy(block->bytes[k][j], bytes + 4 * k, 4);
      __asm__("" : "+r"(k)); /* keeps gcc 12 from writing out all 32 copies: 0.4 KB */
    }
    block->norms[j] = d.norm;
    block->terms[j] = column ? nearest_term(d.norm, place + j / NEAREST_LANES) : NEAREST_FAR;
    block->starts[j] = d.start;
  }
}
