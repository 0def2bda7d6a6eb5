/* The kernel subtract_products of a window's reduced system (odometry/block_cholesky.h): blocks of
   6x6, each of whose rows is one vector of four and one of two, or three of two. */

#include "kernels/lanes.h"

enum { BLOCK_SIDE = 6 };
typedef double block_pair __attribute__((vector_size(16), aligned(8), may_alias));

void TVK_MATCH(subtract_products)(double *entries, const double *columns, const int32_t *blocks,
                                  int32_t num) {
  int32_t a, b, c, r;
  for (a = 0; a < num; ++a) {
    const double *of_row = columns + 3 * BLOCK_SIDE * (size_t)a;
    const size_t row = (size_t)blocks[a], stride = BLOCK_SIDE * (row + 1);
    double *first = entries + BLOCK_SIDE * BLOCK_SIDE / 2 * row * (row + 1);
    for (r = 0; r < BLOCK_SIDE; ++r, first += stride) {
      const double z0 = of_row[r], z1 = of_row[BLOCK_SIDE + r], z2 = of_row[2 * BLOCK_SIDE + r];
      for (b = 0; b <= a; ++b) {
        double *entry = first + BLOCK_SIDE * (size_t)blocks[b];
        const double *z = columns + 3 * BLOCK_SIDE * (size_t)b;
        TVK_UNROLL
        for (c = 0; c + TVK_LANES <= BLOCK_SIDE; c += TVK_LANES) {
          const lanes sum = (z0 * lanes_load(z + c) + z1 * lanes_load(z + BLOCK_SIDE + c)) +
                            z2 * lanes_load(z + 2 * BLOCK_SIDE + c);
          lanes_store(entry + c, lanes_load(entry + c) - sum);
        }
        if (c < BLOCK_SIDE) {
          const block_pair sum =
              (z0 * *(const block_pair *)(z + c) + z1 * *(const block_pair *)(z + BLOCK_SIDE + c)) +
              z2 * *(const block_pair *)(z + 2 * BLOCK_SIDE + c);
          *(block_pair *)(entry + c) -= sum;
        }
      }
    }
  }
}
