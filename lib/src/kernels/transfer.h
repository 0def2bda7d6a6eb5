/* The kernels of the transfer residual of a homography over arrays of matches: squared residuals
   and normal equations. The formula is in geometry/transfer.h. */

#include "kernels/lanes.h"
#include "kernels/match_block.h"

/* The displacement is d = P h / (a . h) with h = H f0. P is the left inverse of J1 that maps f1 to
   zero; a is e_z for rays on the plane, f1 for rays on the sphere. */
typedef struct transfer_terms {
  lanes d[2], slope[2][3]; /* slope: d d / d h */
  lanes w00, w01, w11;     /* (I + D D')^-1, D = d d / d pixel0 */
  lanes r_sq;              /* infinite where H maps the ray behind view 1 */
} transfer_terms;

static inline void transfer_of(const sampson_block *b, const double h[9], int on_plane,
                               transfer_terms *t) {
  lanes P[2][3], moved[3], swung[3][2], D[2][2]; /* moved: H f0; swung: H J0 */
  lanes depth, inverse, g00, g01, g11, r_sq;
  int r, k;
  if (on_plane) {
    const lanes over = 1.0 / (b->J1[0] * b->J1[3] - b->J1[1] * b->J1[2]);
    P[0][0] = b->J1[3] * over;
    P[0][1] = -b->J1[1] * over;
    P[1][0] = -b->J1[2] * over;
    P[1][1] = b->J1[0] * over;
    for (r = 0; r < 2; ++r) P[r][2] = -(P[r][0] * b->f1[0] + P[r][1] * b->f1[1]);
  } else {
    lanes aa = {0}, ab = {0}, bb = {0}, over;
    for (k = 0; k < 3; ++k) {
      aa += b->J1[2 * k] * b->J1[2 * k];
      ab += b->J1[2 * k] * b->J1[2 * k + 1];
      bb += b->J1[2 * k + 1] * b->J1[2 * k + 1];
    }
    over = 1.0 / (aa * bb - ab * ab);
    for (k = 0; k < 3; ++k) {
      P[0][k] = (bb * b->J1[2 * k] - ab * b->J1[2 * k + 1]) * over;
      P[1][k] = (aa * b->J1[2 * k + 1] - ab * b->J1[2 * k]) * over;
    }
  }
  for (r = 0; r < 3; ++r) {
    const lanes last = on_plane ? lanes_of(h[3 * r + 2]) : h[3 * r + 2] * b->f0[2];
    moved[r] = (h[3 * r] * b->f0[0] + h[3 * r + 1] * b->f0[1]) + last;
    for (k = 0; k < 2; ++k) {
      swung[r][k] = h[3 * r] * b->J0[k] + h[3 * r + 1] * b->J0[2 + k];
      if (!on_plane) swung[r][k] += h[3 * r + 2] * b->J0[4 + k];
    }
  }
  depth = on_plane ? moved[2] : (b->f1[0] * moved[0] + b->f1[1] * moved[1]) + b->f1[2] * moved[2];
  inverse = 1.0 / depth;
  for (r = 0; r < 2; ++r) {
    t->d[r] = ((P[r][0] * moved[0] + P[r][1] * moved[1]) + P[r][2] * moved[2]) * inverse;
    for (k = 0; k < 3; ++k) {
      const lanes turned = on_plane ? (k == 2 ? t->d[r] : lanes_of(0)) : t->d[r] * b->f1[k];
      t->slope[r][k] = (P[r][k] - turned) * inverse;
    }
    for (k = 0; k < 2; ++k) {
      D[r][k] = (t->slope[r][0] * swung[0][k] + t->slope[r][1] * swung[1][k]) +
                t->slope[r][2] * swung[2][k];
    }
  }
  g00 = 1.0 + (D[0][0] * D[0][0] + D[0][1] * D[0][1]);
  g11 = 1.0 + (D[1][0] * D[1][0] + D[1][1] * D[1][1]);
  g01 = D[0][0] * D[1][0] + D[0][1] * D[1][1];
  inverse = 1.0 / (g00 * g11 - g01 * g01);
  t->w00 = g11 * inverse;
  t->w01 = -g01 * inverse;
  t->w11 = g00 * inverse;
  r_sq = t->d[0] * (t->w00 * t->d[0] + t->w01 * t->d[1]) +
         t->d[1] * (t->w01 * t->d[0] + t->w11 * t->d[1]);
  t->r_sq = lanes_select((depth > 0.0) & (r_sq >= 0.0), r_sq, lanes_of((double)INFINITY));
}

static inline void transfer_squares_of(const double *const *arrays, const int32_t *indices,
                                       int32_t first, int32_t count, int on_plane,
                                       const double h[9], double *squares) {
  int32_t done;
  for (done = 0; done < count; done += TVK_LANES) {
    const int32_t left = count - done < TVK_LANES ? count - done : TVK_LANES;
    sampson_block b;
    transfer_terms t;
    load_block(arrays, indices ? indices + done : indices, first + done, left, on_plane, &b);
    transfer_of(&b, h, on_plane, &t);
    store_first(squares + done, t.r_sq, left);
  }
}

void TVK_GEOMETRY(transfer_squares)(const double *const *arrays, const int32_t *indices,
                                    int32_t first, int32_t count, int32_t on_plane, const double *h,
                                    double *squares) {
  transfer_squares_of(arrays, indices, first, count, on_plane, h, squares);
}

/* Adds one block's terms to the sums. With A = S' W S and S = d d / d h, d d / d H_ab = S_a f0_b.
   The normal equations of the entries of H are therefore products of the six entries of A and of
   those of f0 f0'. */
static inline void add_transfer_block(const sampson_block *b, int32_t count, int on_plane,
                                      const double h[9], double inverse_sq, int cauchy,
                                      double *sums) {
  transfer_terms t;
  lanes weight, f0[3], pairs[6];
  lane_mask ok;
  int i, j, k, slot = 0;
  transfer_of(b, h, on_plane, &t);
  ok = add_loss(t.r_sq * inverse_sq, count, cauchy, sums + TVK_WIDTH * 45, &weight);
  for (i = 0; i < 3; ++i) f0[i] = on_plane && i == 2 ? lanes_of(1) : b->f0[i];
  for (i = 0; i < 3; ++i) {
    for (j = i; j < 3; ++j) pairs[slot++] = f0[i] * f0[j];
  }
  t.w00 = lanes_keep(ok, t.w00) * weight;
  t.w01 = lanes_keep(ok, t.w01) * weight;
  t.w11 = lanes_keep(ok, t.w11) * weight;
  for (k = 0; k < 2; ++k) {
    t.d[k] = lanes_keep(ok, t.d[k]);
    for (i = 0; i < 3; ++i) t.slope[k][i] = lanes_keep(ok, t.slope[k][i]);
  }
  slot = 0;
  for (i = 0; i < 3; ++i) {
    const lanes u = t.w00 * t.slope[0][i] + t.w01 * t.slope[1][i];
    const lanes v = t.w01 * t.slope[0][i] + t.w11 * t.slope[1][i];
    const lanes along = u * t.d[0] + v * t.d[1];
    for (j = i; j < 3; ++j) {
      const lanes a = u * t.slope[0][j] + v * t.slope[1][j];
      for (k = 0; k < 6; ++k, ++slot) {
        double *sum = sums + TVK_WIDTH * slot;
        lanes_store(sum, lanes_load(sum) + a * pairs[k]);
      }
    }
    for (k = 0; k < 3; ++k) {
      double *sum = sums + TVK_WIDTH * (36 + 3 * i + k);
      lanes_store(sum, lanes_load(sum) + along * f0[k]);
    }
  }
}

static inline void transfer_sums_of(const double *const *arrays, const int32_t *indices,
                                    int32_t first, int32_t count, int on_plane, const double h[9],
                                    double inverse_sq, int cauchy, double *sums) {
  int32_t done;
  for (done = 0; done < count; done += TVK_LANES) {
    const int32_t left = count - done < TVK_LANES ? count - done : TVK_LANES;
    sampson_block b;
    load_block(arrays, indices ? indices + done : indices, first + done, left, on_plane, &b);
    add_transfer_block(&b, left, on_plane, h, inverse_sq, cauchy, sums + done % TVK_WIDTH);
  }
}

void TVK_GEOMETRY(transfer_sums)(const double *const *arrays, const int32_t *indices, int32_t first,
                                 int32_t count, int32_t on_plane, const double *h,
                                 double inverse_sq, int32_t cauchy, double *sums) {
  transfer_sums_of(arrays, indices, first, count, on_plane, h, inverse_sq, cauchy, sums);
}
