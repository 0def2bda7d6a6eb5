/* Two nearest neighbours among 128-byte descriptors, widened to int16. */

static void widen(const uint8_t *bytes, int32_t count, int16_t *out) {
  int32_t k;
  for (k = 0; k < count; ++k) out[k] = bytes[k];
}

static inline int32_t dot_128(const int16_t *a, const int16_t *b) {
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += a[k] * b[k];
  return sum;
}

#if defined(TVK_AVX512)
#include "kernels/nearest_avx512.h"
#elif defined(TVK_AVX2)
#include "kernels/nearest_avx2.h"
#else
static void squared_distances(const int16_t *query, int32_t query_norm, const int16_t *rows,
                              const int32_t *norms, int32_t num_rows, int32_t *out) {
  int32_t j;
  for (j = 0; j < num_rows; ++j) {
    out[j] = query_norm + norms[j] - 2 * dot_128(query, rows + (int64_t)j * TVK_DESCRIPTOR_SIZE);
  }
}
#endif

static int32_t update_columns(const int32_t *dist, int32_t num_columns, int32_t row, int32_t *best,
                              int32_t *second, int32_t *best_row) {
  int32_t smallest = INT32_MAX, j;
  for (j = 0; j < num_columns; ++j) {
    const int32_t d = dist[j], b = best[j], s = second[j];
    const int32_t larger = d > b ? d : b;
    second[j] = larger < s ? larger : s;
    best_row[j] = d < b ? row : best_row[j];
    best[j] = d < b ? d : b;
    smallest = d < smallest ? d : smallest;
  }
  return smallest;
}
