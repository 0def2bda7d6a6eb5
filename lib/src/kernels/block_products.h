/* Kernels of a window's reduced system (odometry/block_cholesky.h, odometry/window_system.h):
   blocks of 6x6, each of whose rows is one vector of four and one of two, or three of two. */

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

/* A row of six numbers: (x cross h, h). */
typedef struct block_row {
#if TVK_LANES == 4
  lanes head;
  block_pair tail;
#else
  block_pair at[3];
#endif
} block_row;

/* The row of x and h; `numbers` receives it, too. */
static TVK_INLINE block_row row_of(const double *x, const double *h, double numbers[BLOCK_SIDE]) {
  block_row row;
  numbers[0] = x[1] * h[2] - x[2] * h[1];
  numbers[1] = x[2] * h[0] - x[0] * h[2];
  numbers[2] = x[0] * h[1] - x[1] * h[0];
  numbers[3] = h[0], numbers[4] = h[1], numbers[5] = h[2];
#if TVK_LANES == 4
  row.head = (lanes){numbers[0], numbers[1], numbers[2], numbers[3]};
  row.tail = (block_pair){numbers[4], numbers[5]};
#else
  row.at[0] = (block_pair){numbers[0], numbers[1]};
  row.at[1] = (block_pair){numbers[2], numbers[3]};
  row.at[2] = (block_pair){numbers[4], numbers[5]};
#endif
  return row;
}

/* sums += factor0 row0 + factor1 row1 */
static TVK_INLINE void add_rows(double *sums, double factor0, const block_row *row0, double factor1,
                                const block_row *row1) {
#if TVK_LANES == 4
  lanes_store(sums, lanes_load(sums) + (factor0 * row0->head + factor1 * row1->head));
  *(block_pair *)(sums + 4) += factor0 * row0->tail + factor1 * row1->tail;
#else
  int c;
  TVK_UNROLL
  for (c = 0; c < 3; ++c) {
    *(block_pair *)(sums + 2 * c) += factor0 * row0->at[c] + factor1 * row1->at[c];
  }
#endif
}

void TVK_MATCH(add_view_terms)(const double *part, double *block, int32_t stride, double *gradient,
                               double *diagonal, double *columns) {
  const double *x = part, *J = part + 12;
  double a[BLOCK_SIDE], b[BLOCK_SIDE], g[BLOCK_SIDE];
  const block_row row0 = row_of(x, part + 3, a), row1 = row_of(x, part + 6, b);
  const block_row of_gradient = row_of(x, part + 9, g);
  int i;
#if TVK_LANES == 4
  lanes_store(gradient, lanes_load(gradient) + of_gradient.head);
  *(block_pair *)(gradient + 4) += of_gradient.tail;
  lanes_store(diagonal, lanes_load(diagonal) + (row0.head * row0.head + row1.head * row1.head));
  *(block_pair *)(diagonal + 4) += row0.tail * row0.tail + row1.tail * row1.tail;
#else
  TVK_UNROLL
  for (i = 0; i < 3; ++i) {
    *(block_pair *)(gradient + 2 * i) += of_gradient.at[i];
    *(block_pair *)(diagonal + 2 * i) += row0.at[i] * row0.at[i] + row1.at[i] * row1.at[i];
  }
#endif
  for (i = 0; i < BLOCK_SIDE; ++i) add_rows(block + i * stride, a[i], &row0, b[i], &row1);
  for (i = 0; i < 3; ++i) add_rows(columns + BLOCK_SIDE * i, J[i], &row0, J[3 + i], &row1);
}
