/* meet_tile of nearest.h for AVX-512 VNNI: 24 sums of 16 columns each, which stay in registers
   until they are in the lists. To store and load them took an eighth of the matching's time on
   Zen 4. */

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

/* Modulo 2^32, like the terms. */
static inline int32x16 scale_avx512(int32x16 sum) {
  return (int32x16)_mm512_slli_epi32((__m512i)sum, 9);
}

static inline int32x16 key_avx512(int32x16 scaled, int32x16 term) {
  return (int32x16)_mm512_add_epi32((__m512i)scaled, (__m512i)term);
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

/* Scales the products of row i, and updates the row's lists with its keys, as update_row does. */
#define UPDATE_ROW(i)                                                                            \
  s##i##0 = scale_avx512(s##i##0);                                                               \
  s##i##1 = scale_avx512(s##i##1);                                                               \
  s##i##2 = scale_avx512(s##i##2);                                                               \
  s##i##3 = scale_avx512(s##i##3);                                                               \
  update_two(min_lanes(min_lanes(key_avx512(s##i##0, columns0), key_avx512(s##i##1, columns1)),  \
                       min_lanes(key_avx512(s##i##2, columns2), key_avx512(s##i##3, columns3))), \
             rows->best + NEAREST_LANES * i, rows->second + NEAREST_LANES * i);

/* Updates the lists of 16 columns with their keys, as update_columns does. */
#define UPDATE_COLUMNS(v)                                                                        \
  update_two(min_lanes(min_lanes(min_lanes(key_avx512(s0##v, term0), key_avx512(s1##v, term1)),  \
                                 min_lanes(key_avx512(s2##v, term2), key_avx512(s3##v, term3))), \
                       min_lanes(key_avx512(s4##v, term4), key_avx512(s5##v, term5))),           \
             block->best + NEAREST_LANES * v, block->second + NEAREST_LANES * v);

#define TERM(i) const int32x16 term##i = (int32x16)_mm512_set1_epi32(rows->terms[i]);

static void meet_tile(nearest_rows *rows, nearest_block *block) {
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
  columns0 = load_avx512(block->terms);
  columns1 = load_avx512(block->terms + 16);
  columns2 = load_avx512(block->terms + 32);
  columns3 = load_avx512(block->terms + 48);
  EACH_ROW(UPDATE_ROW) {
    EACH_ROW(TERM)
    UPDATE_COLUMNS(0) UPDATE_COLUMNS(1) UPDATE_COLUMNS(2) UPDATE_COLUMNS(3)
  }
}

#undef EACH_ROW
#undef START
#undef ADD
#undef UPDATE_ROW
#undef TERM
#undef UPDATE_COLUMNS
