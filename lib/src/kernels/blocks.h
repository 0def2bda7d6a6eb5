/* The kernels subtract_products and add_observation of a window's reduced system: blocks of 6x6. A
   pair is two doubles, whatever the set. */

#if defined(__aarch64__)
#include <arm_neon.h>
#endif

enum { BLOCK_SIDE = 6 };
typedef double block_pair __attribute__((vector_size(16), aligned(8), may_alias));

static TVK_INLINE block_pair pair_load(const double *p) { return *(const block_pair *)p; }
static TVK_INLINE void pair_add(double *sums, block_pair more) { *(block_pair *)sums += more; }
/* The first, and the second numbers of two pairs. */
static TVK_INLINE block_pair firsts_of(block_pair a, block_pair b) {
  return (block_pair){a[0], b[0]};
}
static TVK_INLINE block_pair seconds_of(block_pair a, block_pair b) {
  return (block_pair){a[1], b[1]};
}
/* a[0] + a[1], b[0] + b[1] */
static TVK_INLINE block_pair totals_of(block_pair a, block_pair b) {
#if defined(__aarch64__)
  return vpaddq_f64(a, b);
#else
  return firsts_of(a, b) + seconds_of(a, b);
#endif
}

/* lanes_of(x), but -0 stays -0: compilers leave this subtraction out, and so load x into all lanes
   at once, where lanes_of has to add. */
static TVK_INLINE lanes all_lanes(double x) { return x - (lanes){0}; }
#if TVK_LANES > 2
static TVK_INLINE block_pair low(lanes a) { return (block_pair){a[0], a[1]}; }
#endif

static TVK_INLINE double *row_of_blocks(double *entries, size_t row) {
  return entries + BLOCK_SIDE * BLOCK_SIDE / 2 * row * (row + 1);
}

/* The three numbers of a row of Z_a, each in all lanes. */
typedef struct row_numbers {
  lanes u, v, w;
} row_numbers;

static TVK_INLINE row_numbers numbers_of(const double *columns, int32_t pitch) {
  return (row_numbers){all_lanes(columns[0]), all_lanes(columns[pitch]),
                       all_lanes(columns[2 * pitch])};
}

static TVK_INLINE void subtract(double *entries, row_numbers n, lanes x, lanes y, lanes z) {
  lanes_store(entries, lanes_load(entries) - ((n.u * x + n.v * y) + n.w * z));
}

#if TVK_LANES > 2
static TVK_INLINE void subtract_pair(double *entries, row_numbers n, block_pair x, block_pair y,
                                     block_pair z) {
  *(block_pair *)entries -= (low(n.u) * x + low(n.v) * y) + low(n.w) * z;
}
#endif

/* Where vectors have more than two lanes, blocks that follow each other in the matrix are one run
   of entries of each row, as they are in the columns. Three rows share the loads of these. */
void TVK_ODOMETRY(subtract_products)(double *entries, const double *columns, int32_t pitch,
                                     const int32_t *blocks, int32_t num) {
  int32_t a, b, c, r, end;
  for (a = 0; a < num; ++a) {
    const size_t row = (size_t)blocks[a], stride = BLOCK_SIDE * (row + 1);
    double *const corner = row_of_blocks(entries, row);
    for (b = 0; b <= a; b = end) {
      const double *const x = columns + BLOCK_SIDE * (size_t)b, *const y = x + pitch;
      const double *const z = y + pitch;
      double *row0 = corner + BLOCK_SIDE * (size_t)blocks[b];
      int32_t run;
      end = b + 1;
#if TVK_LANES > 2
      while (end <= a && blocks[end] == blocks[end - 1] + 1) ++end;
#endif
      run = BLOCK_SIDE * (end - b);
      for (r = 0; r < BLOCK_SIDE; r += 3, row0 += 3 * stride) {
        const double *const of_row = columns + BLOCK_SIDE * (size_t)a + r;
        const row_numbers n0 = numbers_of(of_row, pitch), n1 = numbers_of(of_row + 1, pitch);
        const row_numbers n2 = numbers_of(of_row + 2, pitch);
        double *const row1 = row0 + stride, *const row2 = row1 + stride;
        for (c = 0; c + TVK_LANES <= run; c += TVK_LANES) {
          const lanes xs = lanes_load(x + c), ys = lanes_load(y + c), zs = lanes_load(z + c);
          subtract(row0 + c, n0, xs, ys, zs);
          subtract(row1 + c, n1, xs, ys, zs);
          subtract(row2 + c, n2, xs, ys, zs);
        }
#if TVK_LANES > 2
        if (c < run) {
          const block_pair xs = pair_load(x + c), ys = pair_load(y + c), zs = pair_load(z + c);
          subtract_pair(row0 + c, n0, xs, ys, zs);
          subtract_pair(row1 + c, n1, xs, ys, zs);
          subtract_pair(row2 + c, n2, xs, ys, zs);
        }
#endif
      }
    }
  }
}

/* A row of six numbers. */
typedef struct block_row {
#if TVK_LANES == 4
  lanes head;
  block_pair tail;
#else
  block_pair at[3];
#endif
} block_row;

static TVK_INLINE block_row row_of(block_pair first, block_pair second, block_pair third) {
#if TVK_LANES == 4
  return (block_row){{first[0], first[1], second[0], second[1]}, third};
#else
  return (block_row){{first, second, third}};
#endif
}

/* sums += a number of factors times row0 + the other one times row1 */
static TVK_INLINE void add_rows(double *sums, block_pair factors, block_row row0, block_row row1) {
  const lanes factor0 = all_lanes(factors[0]), factor1 = all_lanes(factors[1]);
#if TVK_LANES == 4
  lanes_store(sums, lanes_load(sums) + (factor0 * row0.head + factor1 * row1.head));
  pair_add(sums + 4, low(factor0) * row0.tail + low(factor1) * row1.tail);
#else
  int c;
  TVK_UNROLL
  for (c = 0; c < 3; ++c) pair_add(sums + 2 * c, factor0 * row0.at[c] + factor1 * row1.at[c]);
#endif
}

/* The terms of the view. by: the derivatives of both rows of the residual by w, which are still to
   be written, by v, and by the point, three of each. */
static TVK_INLINE void add_view_terms(const double *x, const double q[3], block_pair by[9],
                                      const tvk_reduced_system *system, size_t at, double *columns,
                                      int32_t pitch) {
  const block_pair *const h = by + BLOCK_SIDE / 2;
  double *const diagonal = system->diagonal + BLOCK_SIDE * at;
  double *const gradient = system->gradient + BLOCK_SIDE * at;
  const double gx = x[1] * q[2] - x[2] * q[1], gy = x[2] * q[0] - x[0] * q[2];
  const double gz = x[0] * q[1] - x[1] * q[0];
  double *row = row_of_blocks(system->entries, at) + BLOCK_SIDE * at;
  size_t stride = BLOCK_SIDE * (at + 1);
  block_row row0, row1;
  int i;
  by[0] = x[1] * h[2] - x[2] * h[1];
  by[1] = x[2] * h[0] - x[0] * h[2];
  by[2] = x[0] * h[1] - x[1] * h[0];
  pair_add(gradient, (block_pair){gx, gy});
  pair_add(gradient + 2, (block_pair){gz, q[0]});
  pair_add(gradient + 4, (block_pair){q[1], q[2]});
  row0 = row_of(firsts_of(by[0], by[1]), firsts_of(by[2], h[0]), firsts_of(h[1], h[2]));
  row1 = row_of(seconds_of(by[0], by[1]), seconds_of(by[2], h[0]), seconds_of(h[1], h[2]));
#if TVK_LANES == 4
  lanes_store(diagonal, lanes_load(diagonal) + (row0.head * row0.head + row1.head * row1.head));
  pair_add(diagonal + 4, row0.tail * row0.tail + row1.tail * row1.tail);
#else
  TVK_UNROLL
  for (i = 0; i < 3; ++i) {
    pair_add(diagonal + 2 * i, row0.at[i] * row0.at[i] + row1.at[i] * row1.at[i]);
  }
#endif
  for (i = 0; i < BLOCK_SIDE + 3; ++i, row += stride) {
    if (i == BLOCK_SIDE) row = columns, stride = (size_t)pitch;
    add_rows(row, by[i], row0, row1);
  }
}

void TVK_ODOMETRY(add_observation)(const double *observation, const double *R, const double *linear,
                                   double *sums, const tvk_reduced_system *system, int32_t block,
                                   double *columns, int32_t pitch) {
  const double *const n = observation + 6;
  const block_pair e = pair_load(linear + 3);
  const double inverse_depth = linear[5], weight = linear[6], root = linear[7], along = linear[8];
  block_pair by[9], *const h = by + 3, *const Jp = by + 6, dots;
  double q[3], dot2;
  int i;
  TVK_UNROLL
  for (i = 0; i < 3; ++i) h[i] = (pair_load(observation + 2 * i) - e * n[i]) * inverse_depth;
  dots = totals_of(e * h[0], e * h[1]);
  dot2 = (e * h[2])[0] + (e * h[2])[1];
  q[0] = weight * dots[0], q[1] = weight * dots[1], q[2] = weight * dot2;
  if (root != 1.0) {
    h[0] = root * (h[0] - e * (along * dots[0]));
    h[1] = root * (h[1] - e * (along * dots[1]));
    h[2] = root * (h[2] - e * (along * dot2));
  }
  TVK_UNROLL
  for (i = 0; i < 3; ++i) Jp[i] = (R[i] * h[0] + R[3 + i] * h[1]) + R[6 + i] * h[2];
  pair_add(sums, totals_of(Jp[0] * Jp[0], Jp[0] * Jp[1]));
  pair_add(sums + 2, totals_of(Jp[0] * Jp[2], Jp[1] * Jp[1]));
  pair_add(sums + 4, totals_of(Jp[1] * Jp[2], Jp[2] * Jp[2]));
  pair_add(sums + 6, (q[0] * pair_load(R) + q[1] * pair_load(R + 3)) + q[2] * pair_load(R + 6));
  sums[8] += (R[2] * q[0] + R[5] * q[1]) + R[8] * q[2];
  if (block >= 0) add_view_terms(linear, q, by, system, (size_t)block, columns, pitch);
}
