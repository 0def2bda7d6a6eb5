/* The kernels that gain by the dot product of ARMv8.2. The table is beside the NEON set's
   (kernels_neon.c), whose other kernels it shares. */
#include "kernels/neon_dot.h"

#if defined(__aarch64__)
#include <arm_neon.h>

#include "kernels/kernels.h"

/* The widened bytes, narrow again: 16 of them to a register. */
static inline uint8x16_t narrow_16(const int16_t *p) {
  return vreinterpretq_u8_s8(vuzp1q_s8(vld1q_s8((const int8_t *)p), vld1q_s8((const int8_t *)(p + 8))));
}

static inline uint32x4_t dot_lanes(const uint8x16_t query[8], const int16_t *row) {
  uint32x4_t sum = vdupq_n_u32(0);
  int k;
  for (k = 0; k < 8; ++k) sum = vdotq_u32(sum, query[k], narrow_16(row + 16 * k));
  return sum;
}

void tvk_squared_distances_neon_dot(const int16_t *query, int32_t query_norm, const int16_t *rows,
                                    const int32_t *norms, int32_t num_rows, int32_t *out) {
  uint8x16_t q[8];
  int32_t j;
  int k;
  for (k = 0; k < 8; ++k) q[k] = narrow_16(query + 16 * k);
  for (j = 0; j < num_rows; ++j) {
    const int16_t *row = rows + (int64_t)j * TVK_DESCRIPTOR_SIZE;
    out[j] = query_norm + norms[j] - 2 * (int32_t)vaddvq_u32(dot_lanes(q, row));
  }
}
#else
typedef int tvk_no_dot_product; /* C asks for a declaration in every file */
#endif
