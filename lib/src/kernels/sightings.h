/* The kernel sighting_costs. Each operation is the same IEEE operation on every lane, and the sum
   is one of integers. */

enum { FLOATS = 2 * TVK_LANES };
typedef float floats __attribute__((vector_size(4 * FLOATS)));
typedef int32_t float_mask __attribute__((vector_size(4 * FLOATS))); /* lanes are -1 or 0 */
typedef float unaligned_floats __attribute__((vector_size(4 * FLOATS), aligned(4), may_alias));

int32_t TVK_ODOMETRY(sighting_costs)(const float *const *arrays, int32_t first, const float *m,
                                     float inverse_sq) {
  const floats one = (floats){0} + 1.0f;
  float_mask sum = {0};
  int32_t at, k, total = 0;
  for (at = first; at < first + TVK_SIGHTING_BLOCK; at += FLOATS) {
#define NUMBERS(k) (*(const unaligned_floats *)(arrays[k] + at))
    const floats x = NUMBERS(0), y = NUMBERS(1), z = NUMBERS(2);
    const floats p = ((m[0] * x + m[1] * y) + m[2] * z) + m[9];
    const floats q = ((m[3] * x + m[4] * y) + m[5] * z) + m[10];
    const floats r = ((m[6] * x + m[7] * y) + m[8] * z) + m[11];
    const floats u = (NUMBERS(3) * p + NUMBERS(4) * q) + NUMBERS(5) * r;
    const floats v = (NUMBERS(6) * p + NUMBERS(7) * q) + NUMBERS(8) * r;
    const floats w = (NUMBERS(9) * p + NUMBERS(10) * q) + NUMBERS(11) * r;
#undef NUMBERS
    const floats error = (u * u + v * v) * inverse_sq, unit = w * w;
    const float_mask inside = (w > 0.0f) & (error < unit);
    const floats ratio = error / unit;
    const floats cost = (floats)(((float_mask)ratio & inside) | ((float_mask)one & ~inside));
    sum += __builtin_convertvector(cost * (float)TVK_SIGHTING_COST, float_mask);
  }
  for (k = 0; k < FLOATS; ++k) total += sum[k];
  return total;
}
