/* The kernels of Sampson's distance over arrays of matches: squared residuals, normal equations and
   the integer score. The formula is in geometry/sampson.h. */

#include "kernels/lanes.h"
#include "kernels/match_block.h"

typedef struct epipolar_terms {
  lanes c, n; /* c = f1' M f0, n = |J0' M' f1|^2 + |J1' M f0|^2: r^2 = c^2 / n */
  lanes s0[2], s1[2];
} epipolar_terms;

static TVK_INLINE void epipolar_of(const sampson_block *b, const double m[9], int on_plane,
                                   epipolar_terms *e) {
  lanes line0[3], line1[3];
  int r, k;
  for (r = 0; r < 3; ++r) {
    const lanes last1 = on_plane ? lanes_of(m[3 * r + 2]) : m[3 * r + 2] * b->f0[2];
    const lanes last0 = on_plane ? lanes_of(m[6 + r]) : m[6 + r] * b->f1[2];
    line1[r] = (m[3 * r] * b->f0[0] + m[3 * r + 1] * b->f0[1]) + last1;
    line0[r] = (m[r] * b->f1[0] + m[3 + r] * b->f1[1]) + last0;
  }
  e->c = (b->f1[0] * line1[0] + b->f1[1] * line1[1]) + (on_plane ? line1[2] : b->f1[2] * line1[2]);
  for (k = 0; k < 2; ++k) {
    e->s0[k] = b->J0[k] * line0[0] + b->J0[2 + k] * line0[1];
    e->s1[k] = b->J1[k] * line1[0] + b->J1[2 + k] * line1[1];
    if (!on_plane) {
      e->s0[k] += b->J0[4 + k] * line0[2];
      e->s1[k] += b->J1[4 + k] * line1[2];
    }
  }
  e->n = (e->s0[0] * e->s0[0] + e->s0[1] * e->s0[1]) + (e->s1[0] * e->s1[0] + e->s1[1] * e->s1[1]);
}

static TVK_INLINE void squares_of(const double *const *arrays, const int32_t *indices,
                                  int32_t first, int32_t count, int on_plane, const double m[9],
                                  double *squares) {
  int32_t done;
  for (done = 0; done < count; done += TVK_LANES) {
    const int32_t left = count - done < TVK_LANES ? count - done : TVK_LANES;
    sampson_block b;
    epipolar_terms e;
    lanes q;
    load_block(arrays, indices ? indices + done : indices, first + done, left, on_plane, &b);
    epipolar_of(&b, m, on_plane, &e);
    q = e.c * e.c / e.n;
    store_first(squares + done, lanes_select(q >= 0.0, q, lanes_of((double)INFINITY)), left);
  }
}

void TVK_GEOMETRY(sampson_squares)(const double *const *arrays, const int32_t *indices,
                                   int32_t first, int32_t count, int32_t on_plane, const double *m,
                                   double *squares) {
  if (on_plane) {
    squares_of(arrays, indices, first, count, 1, m, squares);
  } else {
    TVK_ON_SPHERE(sampson_squares, squares_of)(arrays, indices, first, count, 0, m, squares);
  }
}

/* The mask of matches whose point is behind a camera by more than `angle`; the same test as
   depth_signs and depth_vote of geometry/essential.h. */
static TVK_INLINE lane_mask behind_of(const sampson_block *b, lanes angle, int on_plane,
                                      const double R[9], const double t[3]) {
  lanes a[3], aa, ff, af, at, ft, depth0, depth1, turn;
  int r;
  for (r = 0; r < 3; ++r) {
    const lanes last = on_plane ? lanes_of(R[3 * r + 2]) : R[3 * r + 2] * b->f0[2];
    a[r] = (R[3 * r] * b->f0[0] + R[3 * r + 1] * b->f0[1]) + last;
  }
  aa = (a[0] * a[0] + a[1] * a[1]) + a[2] * a[2];
  at = (a[0] * t[0] + a[1] * t[1]) + a[2] * t[2];
  if (on_plane) {
    ff = (b->f1[0] * b->f1[0] + b->f1[1] * b->f1[1]) + 1.0;
    af = (a[0] * b->f1[0] + a[1] * b->f1[1]) + a[2];
    ft = (b->f1[0] * t[0] + b->f1[1] * t[1]) + t[2];
  } else {
    ff = (b->f1[0] * b->f1[0] + b->f1[1] * b->f1[1]) + b->f1[2] * b->f1[2];
    af = (a[0] * b->f1[0] + a[1] * b->f1[1]) + a[2] * b->f1[2];
    ft = (b->f1[0] * t[0] + b->f1[1] * t[1]) + b->f1[2] * t[2];
  }
  depth0 = af * ft - ff * at;
  depth1 = aa * ft - af * at;
  turn = angle * angle * aa * ff;
  return ((depth0 < 0.0) & (depth0 * depth0 > turn * (ff - ft * ft))) |
         ((depth1 < 0.0) & (depth1 * depth1 > turn * (aa - at * at)));
}

static TVK_INLINE void pose_squares_of(const double *const *arrays, int32_t first, int32_t count,
                                       int on_plane, const double *pose, double scale,
                                       double *squares) {
  int32_t done;
  for (done = 0; done < count; done += TVK_LANES) {
    const int32_t left = count - done < TVK_LANES ? count - done : TVK_LANES;
    sampson_block b;
    epipolar_terms e;
    lanes q, angle;
    load_block(arrays, NULL, first + done, left, on_plane, &b);
    angle = load_first(arrays[18] + first + done, left);
    epipolar_of(&b, pose, on_plane, &e);
    q = e.c * e.c / e.n;
    q = lanes_select((q >= 0.0) & ~behind_of(&b, scale * angle, on_plane, pose + 9, pose + 18), q,
                     lanes_of((double)INFINITY));
    store_first(squares + done, q, left);
  }
}

void TVK_GEOMETRY(pose_squares)(const double *const *arrays, int32_t first, int32_t count,
                                int32_t on_plane, const double *pose, double scale,
                                double *squares) {
  if (on_plane) {
    pose_squares_of(arrays, first, count, 1, pose, scale, squares);
  } else {
    TVK_ON_SPHERE(pose_squares, pose_squares_of)(arrays, first, count, 0, pose, scale, squares);
  }
}

/* The derivatives of r by the entries of M: dr/dM_ij = (f1_i (f0_j - s g0_j) - s g1_i f0_j) /
   sqrt(n), with s = c / n, g0 = J0 J0' M' f1, g1 = J1 J1' M f0. `root` is 1 / sqrt(n). */
static TVK_INLINE void slopes_of(const sampson_block *b, const epipolar_terms *e, lanes s,
                                 lanes root, int on_plane, lanes slopes[9]) {
  lanes u0[3], u1[3];
  int i, j;
  for (i = 0; i < 3; ++i) {
    if (on_plane && i == 2) {
      u0[2] = root;
      u1[2] = lanes_of(0);
      continue;
    }
    u0[i] = (b->f0[i] - s * (b->J0[2 * i] * e->s0[0] + b->J0[2 * i + 1] * e->s0[1])) * root;
    u1[i] = s * (b->J1[2 * i] * e->s1[0] + b->J1[2 * i + 1] * e->s1[1]) * root;
  }
  for (i = 0; i < 3; ++i) {
    for (j = 0; j < 3; ++j) {
      const lanes f1 = on_plane && i == 2 ? lanes_of(1) : b->f1[i];
      const lanes f0 = on_plane && j == 2 ? lanes_of(1) : b->f0[j];
      slopes[3 * i + j] = f1 * u0[j] - u1[i] * f0;
    }
  }
}

/* Adds the upper triangle of weight g g', row by row, and then weight g r to the sums. */
static TVK_NOINLINE void add_products(const lanes g[9], lanes weight, lanes residual,
                                      double *sums) {
  int i, j, slot = 0;
  TVK_UNROLL
  for (i = 0; i < 9; ++i) {
    const lanes weighted = weight * g[i];
    TVK_UNROLL
    for (j = i; j < 9; ++j, ++slot) {
      double *sum = sums + TVK_WIDTH * slot;
      lanes_store(sum, lanes_load(sum) + weighted * g[j]);
    }
    lanes_store(sums + TVK_WIDTH * (45 + i),
                lanes_load(sums + TVK_WIDTH * (45 + i)) + weighted * residual);
  }
}

/* Adds one block's terms to the sums. `sums` points to the lane of the block's first match. */
static TVK_INLINE void add_block(const sampson_block *b, int32_t count, int on_plane,
                                 const double m[9], double inverse_sq, int cauchy, double *sums) {
  epipolar_terms e;
  lanes slopes[9], weight, inverse_n, c, root, s;
  lane_mask ok;
  epipolar_of(b, m, on_plane, &e);
  inverse_n = 1.0 / e.n;
  ok = add_loss(e.c * e.c * inverse_n * inverse_sq, count, cauchy, sums + TVK_WIDTH * 54, &weight);
  inverse_n = lanes_keep(ok, inverse_n);
  c = lanes_keep(ok, e.c);
  root = lanes_sqrt(inverse_n);
  s = c * inverse_n;
  slopes_of(b, &e, s, root, on_plane, slopes);
  add_products(slopes, weight, c * root, sums);
}

static TVK_INLINE void sums_of(const double *const *arrays, const int32_t *indices, int32_t first,
                               int32_t count, int on_plane, const double m[9], double inverse_sq,
                               int cauchy, double *sums) {
  int32_t done;
  for (done = 0; done < count; done += TVK_LANES) {
    const int32_t left = count - done < TVK_LANES ? count - done : TVK_LANES;
    sampson_block b;
    load_block(arrays, indices ? indices + done : indices, first + done, left, on_plane, &b);
    add_block(&b, left, on_plane, m, inverse_sq, cauchy, sums + done % TVK_WIDTH);
  }
}

void TVK_GEOMETRY(sampson_sums)(const double *const *arrays, const int32_t *indices, int32_t first,
                                int32_t count, int32_t on_plane, const double *m, double inverse_sq,
                                int32_t cauchy, double *sums) {
  if (on_plane) {
    sums_of(arrays, indices, first, count, 1, m, inverse_sq, cauchy, sums);
  } else {
    TVK_ON_SPHERE(sampson_sums, sums_of)
    (arrays, indices, first, count, 0, m, inverse_sq, cauchy, sums);
  }
}

/* The integer cost of a block of q = r^2 / T^2. Capping is done on the bits of the floats, so that
   every step is a plain vector operation: as unsigned integers, exactly the floats in [0, 1) are
   below the bits of 1.0f. A NaN or a negative rounding error is above them and costs 1. */
static inline int32_t sum_of_costs(const float q[TVK_SCORE_BLOCK]) {
  const uint32_t one = 0x3f800000u;
  uint32_t bits[TVK_SCORE_BLOCK];
  float capped[TVK_SCORE_BLOCK];
  int32_t sum = 0, i;
  memcpy(bits, q, sizeof bits);
  for (i = 0; i < TVK_SCORE_BLOCK; ++i) bits[i] = bits[i] < one ? bits[i] : one;
  memcpy(capped, bits, sizeof bits);
  for (i = 0; i < TVK_SCORE_BLOCK; ++i) sum += (int32_t)(capped[i] * (float)TVK_SCORE_ONE);
  return sum;
}

static inline int32_t score_on_plane(const float *const *f, int32_t begin, const float m[9],
                                     float inverse_sq) {
  const float *x0 = f[0] + begin, *y0 = f[1] + begin, *x1 = f[2] + begin, *y1 = f[3] + begin;
  const float *a0 = f[4] + begin, *b0 = f[5] + begin, *c0 = f[6] + begin;
  const float *a1 = f[7] + begin, *b1 = f[8] + begin, *c1 = f[9] + begin;
  float q[TVK_SCORE_BLOCK];
  int32_t i;
  for (i = 0; i < TVK_SCORE_BLOCK; ++i) {
    const float u = (m[0] * x0[i] + m[1] * y0[i]) + m[2];
    const float v = (m[3] * x0[i] + m[4] * y0[i]) + m[5];
    const float w = (m[6] * x0[i] + m[7] * y0[i]) + m[8];
    const float c = (x1[i] * u + y1[i] * v) + w;
    const float s = (m[0] * x1[i] + m[3] * y1[i]) + m[6];
    const float t = (m[1] * x1[i] + m[4] * y1[i]) + m[7];
    const float n1 = u * (a1[i] * u + b1[i] * v) + v * (b1[i] * u + c1[i] * v);
    const float n0 = s * (a0[i] * s + b0[i] * t) + t * (b0[i] * s + c0[i] * t);
    q[i] = c * c * inverse_sq / (n0 + n1);
  }
  return sum_of_costs(q);
}

static inline int32_t score_general(const float *const *f, int32_t begin, const float m[9],
                                    float inverse_sq) {
  float q[TVK_SCORE_BLOCK];
  int32_t k, r, j;
  for (k = 0; k < TVK_SCORE_BLOCK; ++k) {
    const int32_t i = begin + k;
    float u[3], s[3], c, n = 0;
    for (r = 0; r < 3; ++r) {
      u[r] = (m[3 * r] * f[0][i] + m[3 * r + 1] * f[1][i]) + m[3 * r + 2] * f[2][i];
      s[r] = (m[r] * f[3][i] + m[3 + r] * f[4][i]) + m[6 + r] * f[5][i];
    }
    c = (f[3][i] * u[0] + f[4][i] * u[1]) + f[5][i] * u[2];
    for (j = 0; j < 2; ++j) {
      const float g = (f[6 + j][i] * s[0] + f[8 + j][i] * s[1]) + f[10 + j][i] * s[2];
      const float h = (f[12 + j][i] * u[0] + f[14 + j][i] * u[1]) + f[16 + j][i] * u[2];
      n += g * g + h * h;
    }
    q[k] = c * c * inverse_sq / n;
  }
  return sum_of_costs(q);
}

static inline int64_t score_on_sphere(const float *const *arrays, int32_t first_block,
                                      int32_t num_blocks, int32_t on_plane, const float *m,
                                      float inverse_sq) {
  int64_t sum = 0;
  int32_t k;
  (void)on_plane;
  for (k = first_block; k < first_block + num_blocks; ++k) {
    sum += score_general(arrays, k * TVK_SCORE_BLOCK, m, inverse_sq);
  }
  return sum;
}

int64_t TVK_GEOMETRY(sampson_score)(const float *const *arrays, int32_t first_block,
                                    int32_t num_blocks, int32_t on_plane, const float *m,
                                    float inverse_sq) {
  int64_t sum = 0;
  int32_t k;
  if (!on_plane) {
    return TVK_ON_SPHERE(sampson_score, score_on_sphere)(arrays, first_block, num_blocks, 0, m,
                                                         inverse_sq);
  }
  for (k = first_block; k < first_block + num_blocks; ++k) {
    sum += score_on_plane(arrays, k * TVK_SCORE_BLOCK, m, inverse_sq);
  }
  return sum;
}
