/* The kernel relpose_5pt: essential matrices from five matched rays, for TVK_LANES samples at a
   time. The code does not branch on the values in single lanes, except to separate roots that are
   close together.

   D. Nister, "An efficient solution to the five-point relative pose problem", PAMI 2004. The five
   epipolar constraints leave E = x X + y Y + z Z + W. The cubic constraints det E = 0 and 2 E E' E
   - tr(E E') E = 0 are ten equations in twenty monomials. Elimination gives a 3x3 matrix of
   polynomials in z, whose determinant has degree ten; its real roots z give x and y. Elimination is
   by Householder reflections here, which need no pivot. Accuracy is measured in
   test/unit/test_relpose_5pt.cc. */

#include "kernels/lanes.h"

/* Writes an orthonormal basis of the vectors orthogonal to the five rows, by Householder
   reflections. The rows are overwritten. Clears the bits of `ok` for lanes whose rows are linearly
   dependent. */
static inline void null_space_5x9(lanes rows[5][9], lanes basis[4][9], lane_mask *ok) {
  lanes scale[5],
      largest = {0}; /* scale[k]: 2 / |v|^2 of the reflector v that is stored in rows[k][k..8] */
  int k, i, c, b;
  for (k = 0; k < 5; ++k) {
    lanes sum = {0};
    for (i = 0; i < 9; ++i) sum += rows[k][i] * rows[k][i];
    largest = lanes_select(sum > largest, sum, largest);
  }
  for (k = 0; k < 5; ++k) {
    lanes *v = rows[k], sum = {0}, length, head;
    for (i = k; i < 9; ++i) sum += v[i] * v[i];
    *ok &= sum > 1e-20 * largest;
    length = lanes_sqrt(sum);
    head = v[k];
    v[k] = head + lanes_select(head < 0.0, -length, length);
    scale[k] = 1.0 / (sum + lanes_abs(head) * length);
    for (c = k + 1; c < 5; ++c) {
      lanes dot = {0};
      for (i = k; i < 9; ++i) dot += v[i] * rows[c][i];
      dot *= scale[k];
      for (i = k; i < 9; ++i) rows[c][i] -= dot * v[i];
    }
  }
  for (b = 0; b < 4; ++b) {
    /* The last reflector is applied to a vector with a single entry that is not 0. */
    const lanes first = rows[4][5 + b] * scale[4];
    for (i = 0; i < 4; ++i) basis[b][i] = lanes_of(0);
    for (i = 4; i < 9; ++i) basis[b][i] = (i == 5 + b ? 1.0 : 0.0) - first * rows[4][i];
    for (k = 3; k >= 0; --k) {
      const lanes *v = rows[k];
      lanes dot = {0};
      for (i = k + 1; i < 9; ++i) dot += v[i] * basis[b][i];
      dot *= scale[k];
      for (i = k; i < 9; ++i) basis[b][i] -= dot * v[i];
    }
  }
}

/* Replaces the basis by its image under a fixed reflection without zero entries. The basis of
   null_space_5x9 contains ones and zeros, and the essential matrix of a motion exactly along an
   axis contains zeros, too. Without the reflection, W could have the coefficient 0 in that matrix,
   which is a root at infinity, in every sample. */
static inline void mix_basis(lanes basis[4][9]) {
  static const double v[4] = {1.0, 1.3, 1.7, 2.3};
  const double scale = 2.0 / (v[0] * v[0] + v[1] * v[1] + v[2] * v[2] + v[3] * v[3]);
  int i, b;
  for (i = 0; i < 9; ++i) {
    const lanes along = scale * ((v[0] * basis[0][i] + v[1] * basis[1][i]) +
                                 (v[2] * basis[2][i] + v[3] * basis[3][i]));
    for (b = 0; b < 4; ++b) basis[b][i] -= along * v[b];
  }
}

/* The order of coefficients. Linear polynomials: x, y, z, 1. Quadratic ones: xx xy xz x yy yz y zz
   z 1. Cubic ones, in Nister's order: xxx yyy xxy xyy xxz xx yyz yy xyz xy | xzz xz x yzz yz y zzz
   zz z 1. */
static TVK_NOINLINE void add_product(const lanes a[4], const lanes b[4], lanes out[10]) {
  out[0] += a[0] * b[0];
  out[1] += a[0] * b[1] + a[1] * b[0];
  out[2] += a[0] * b[2] + a[2] * b[0];
  out[3] += a[0] * b[3] + a[3] * b[0];
  out[4] += a[1] * b[1];
  out[5] += a[1] * b[2] + a[2] * b[1];
  out[6] += a[1] * b[3] + a[3] * b[1];
  out[7] += a[2] * b[2];
  out[8] += a[2] * b[3] + a[3] * b[2];
  out[9] += a[3] * b[3];
}

static TVK_NOINLINE void add_cubic_product(const lanes q[10], const lanes l[4], lanes out[20]) {
  out[0] += q[0] * l[0];
  out[1] += q[4] * l[1];
  out[2] += q[0] * l[1] + q[1] * l[0];
  out[3] += q[1] * l[1] + q[4] * l[0];
  out[4] += q[0] * l[2] + q[2] * l[0];
  out[5] += q[0] * l[3] + q[3] * l[0];
  out[6] += q[4] * l[2] + q[5] * l[1];
  out[7] += q[4] * l[3] + q[6] * l[1];
  out[8] += (q[1] * l[2] + q[2] * l[1]) + q[5] * l[0];
  out[9] += (q[1] * l[3] + q[3] * l[1]) + q[6] * l[0];
  out[10] += q[2] * l[2] + q[7] * l[0];
  out[11] += (q[2] * l[3] + q[3] * l[2]) + q[8] * l[0];
  out[12] += q[3] * l[3] + q[9] * l[0];
  out[13] += q[5] * l[2] + q[7] * l[1];
  out[14] += (q[5] * l[3] + q[6] * l[2]) + q[8] * l[1];
  out[15] += q[6] * l[3] + q[9] * l[1];
  out[16] += q[7] * l[2];
  out[17] += q[7] * l[3] + q[8] * l[2];
  out[18] += q[8] * l[3] + q[9] * l[2];
  out[19] += q[9] * l[3];
}

/* The ten cubic constraints, one in each row. */
static TVK_NOINLINE void cubic_constraints(const lanes e[9][4], lanes rows[10][20]) {
  static const int place[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  lanes gram[6][10]; /* E E' - tr(E E') / 2: entries 00 01 02 11 12 22 */
  int i, j, k, m;
  memset(gram, 0, sizeof gram);
  memset(rows, 0, 10 * sizeof rows[0]);
  for (i = 0; i < 3; ++i) {
    for (j = i; j < 3; ++j) {
      for (k = 0; k < 3; ++k) add_product(e[3 * i + k], e[3 * j + k], gram[place[i][j]]);
    }
  }
  for (m = 0; m < 10; ++m) {
    const lanes half_trace = 0.5 * ((gram[0][m] + gram[3][m]) + gram[5][m]);
    gram[0][m] -= half_trace;
    gram[3][m] -= half_trace;
    gram[5][m] -= half_trace;
  }
  for (i = 0; i < 3; ++i) {
    for (j = 0; j < 3; ++j) {
      for (k = 0; k < 3; ++k) add_cubic_product(gram[place[i][k]], e[3 * k + j], rows[3 * i + j]);
    }
  }
  for (j = 0; j < 3; ++j) { /* the determinant, expanded along the first row */
    const int a = (j + 1) % 3, b = (j + 2) % 3;
    lanes minor[10], negative[10];
    memset(minor, 0, sizeof minor);
    memset(negative, 0, sizeof negative);
    add_product(e[3 + a], e[6 + b], minor);
    add_product(e[3 + b], e[6 + a], negative);
    for (m = 0; m < 10; ++m) minor[m] -= negative[m];
    add_cubic_product(minor, e[j], rows[9]);
  }
}

/* Reduces the left ten columns to the identity. Only the last six rows are finished, because the
   first four are never used. Clears the bits of `ok` for lanes where these columns are singular. */
static TVK_NOINLINE void eliminate(lanes rows[10][20], lane_mask *ok) {
  lanes diagonal[10];
  int k, r, c;
  for (k = 0; k < 10; ++k) {
    const int first_used = k < 4 ? k + 1 : k;
    lanes v[10], sum = {0}, length, head, scale;
    for (r = k; r < 10; ++r) {
      v[r] = rows[r][k];
      sum += v[r] * v[r];
    }
    *ok &= sum > 1e-28;
    length = lanes_sqrt(sum);
    head = v[k];
    length = lanes_select(head < 0.0, -length, length);
    v[k] = head + length;
    scale = 1.0 / (sum + head * length);
    diagonal[k] = -length;
    for (c = k + 1; c < 20; ++c) {
      lanes dot = v[k] * rows[k][c];
      for (r = k + 1; r < 10; ++r) dot += v[r] * rows[r][c];
      dot *= scale;
      for (r = first_used; r < 10; ++r) rows[r][c] -= dot * v[r];
    }
  }
  TVK_ROLLED
  for (k = 9; k >= 4; --k) {
    const lanes inverse = 1.0 / diagonal[k];
    for (c = 10; c < 20; ++c) {
      rows[k][c] *= inverse;
      for (r = 4; r < k; ++r) rows[r][c] -= rows[r][k] * rows[k][c];
    }
  }
}

/* The 3x3 matrix of polynomials in z, with the coefficient of the lowest power first. Its columns
   multiply x, y and 1; x[k], y[k], one[k] are row k. */
typedef struct z_matrix {
  lanes x[3][4], y[3][4], one[3][5];
} z_matrix;

static inline void z_matrix_of(const lanes rows[10][20], z_matrix *b) {
  int k;
  for (k = 0; k < 3; ++k) { /* row k of the matrix: row 4 + 2k - z times row 5 + 2k */
    const lanes *e = rows[4 + 2 * k], *f = rows[5 + 2 * k];
    b->x[k][0] = e[12];
    b->x[k][1] = e[11] - f[12];
    b->x[k][2] = e[10] - f[11];
    b->x[k][3] = -f[10];
    b->y[k][0] = e[15];
    b->y[k][1] = e[14] - f[15];
    b->y[k][2] = e[13] - f[14];
    b->y[k][3] = -f[13];
    b->one[k][0] = e[19];
    b->one[k][1] = e[18] - f[19];
    b->one[k][2] = e[17] - f[18];
    b->one[k][3] = e[16] - f[17];
    b->one[k][4] = -f[16];
  }
}

/* Not inlined, like the functions above: their arrays are the largest part of the stack, and are
   released before the search for roots begins. */
static TVK_NOINLINE void reduce_constraints(const lanes e[9][4], z_matrix *b, lane_mask *ok) {
  lanes rows[10][20];
  cubic_constraints(e, rows);
  eliminate(rows, ok);
  z_matrix_of(rows, b);
}

static inline void determinant_of(const z_matrix *b, lanes polynomial[11]) {
  int k, p, q;
  memset(polynomial, 0, 11 * sizeof polynomial[0]);
  for (k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    lanes minor[7];
    memset(minor, 0, sizeof minor);
    TVK_ROLLED
    for (p = 0; p < 4; ++p) {
      TVK_UNROLL
      for (q = 0; q < 4; ++q) minor[p + q] += b->x[i][p] * b->y[j][q] - b->x[j][p] * b->y[i][q];
    }
    TVK_ROLLED
    for (p = 0; p < 5; ++p) {
      TVK_UNROLL
      for (q = 0; q < 7; ++q) polynomial[p + q] += b->one[k][p] * minor[q];
    }
  }
}

/* Sturm's chain of the polynomial: p[0] = p, p[1] = p', and p[k-1] = (a[k] z + b[k]) p[k] - c[k]
   p[k+1] with c > 0. Only a (slope), b (offset) and c (scale) are kept. Evaluation starts at the
   constant end of the chain and takes three multiplications per link. (D. G. Hook, P. R. McAree,
   "Using Sturm sequences to bracket real roots of polynomial equations", Graphics Gems, 1990, with
   the quotients in place of the polynomials.) With repeated roots the chain ends early; the links
   after its end have a = c = 0 and b = 1. */
typedef struct sturm_chain {
  lanes slope[10], offset[10], scale[10];
  lanes last; /* +1 or -1, the sign of the last polynomial of the chain */
} sturm_chain;

static TVK_NOINLINE void make_sturm_chain(const lanes p[11], sturm_chain *chain) {
  lanes previous[11], current[11];
  const lanes one = lanes_of(1), sign = lanes_select(p[10] < 0.0, -one, one);
  const lanes inverse_lead = sign / (10.0 * p[10]);
  lane_mask alive = one > 0.0;
  int i, d;
  for (i = 0; i <= 10; ++i) previous[i] = p[i];
  for (i = 0; i < 10; ++i) current[i] = (i + 1.0) * p[i + 1] * inverse_lead;
  current[9] = sign;
  chain->last = sign;
  for (d = 9; d >= 0; --d) { /* current has degree d and leading coefficient +-1 throughout */
    const int k = 9 - d;
    const lanes lead = current[d], slope = previous[d + 1] * lead;
    const lanes offset = d > 0 ? (previous[d] - slope * current[d - 1]) * lead : previous[0] * lead;
    lanes remainder[10], size, inverse;
    chain->slope[k] = lanes_keep(alive, slope);
    chain->offset[k] = lanes_select(alive, offset, one);
    chain->scale[k] = lanes_of(0);
    chain->last = lanes_select(alive, lead, chain->last);
    if (d == 0) break;
    /* The remainder of the division, with its sign changed: slope z current + offset current -
       previous, of a degree below d. */
    for (i = 0; i < d; ++i) {
      const lanes shifted = i > 0 ? slope * current[i - 1] : lanes_of(0);
      remainder[i] = (offset * current[i] + shifted) - previous[i];
    }
    size = lanes_abs(remainder[d - 1]);
    alive &= size > 1e-300;
    chain->scale[k] = lanes_keep(alive, size);
    inverse = 1.0 / size;
    for (i = 0; i <= d; ++i) previous[i] = current[i];
    for (i = 0; i < d - 1; ++i) current[i] = remainder[i] * inverse;
    current[d - 1] = lanes_select(remainder[d - 1] < 0.0, -one, one);
  }
}

/* The number of sign changes of each lane's chain at z. The difference between two values of z is
   the number of distinct roots between them. */
static TVK_NOINLINE lane_mask sign_changes(const sturm_chain *chain, double z) {
  lanes next = {0}, current = chain->last;
  lane_mask changes = {0}; /* the negative count, because a set mask is -1 */
  int k;
  TVK_UNROLL
  for (k = 9; k >= 0; --k) {
    const lanes previous =
        (chain->slope[k] * z + chain->offset[k]) * current - chain->scale[k] * next;
    changes += (previous < 0.0) ^ (current < 0.0);
    next = current;
    current = previous;
  }
  return -changes;
}

static inline int sign_changes_of_lane(const sturm_chain *chain, int lane, double z) {
  double next = 0, current = chain->last[lane];
  int changes = 0, k;
  for (k = 9; k >= 0; --k) {
    const double previous = (chain->slope[k][lane] * z + chain->offset[k][lane]) * current -
                            chain->scale[k][lane] * next;
    changes += (previous < 0) != (current < 0);
    next = current;
    current = previous;
  }
  return changes;
}

/* Intervals (low, high] with one root each, in ascending order, for each lane. A repeated root has
   an interval of length 0. `num` is the number of each lane, `most` the largest of them. */
typedef struct root_brackets {
  lanes low[10], high[10];
  int num[TVK_LANES], most;
} root_brackets;

static inline void add_bracket(root_brackets *b, int lane, double low, double high) {
  const int n = b->num[lane];
  if (n == 10) return;
  b->low[n][lane] = low;
  b->high[n][lane] = high;
  b->num[lane] = n + 1;
  if (n + 1 > b->most) b->most = n + 1;
}

/* Halves an interval with several roots until each part has one. A part whose relative length is at
   most 1e-12 is counted as one repeated root. Intervals beyond +-1 are halved in 1 / z, the others
   in z. */
static TVK_NOINLINE void split_bracket(const sturm_chain *chain, int lane, double low, double high,
                                       int changes_low, int changes_high, root_brackets *brackets) {
  struct {
    double low, high;
    int changes_low, changes_high;
  } stack[64];
  int depth = 1;
  stack[0].low = low;
  stack[0].high = high;
  stack[0].changes_low = changes_low;
  stack[0].changes_high = changes_high;
  while (depth > 0) {
    const int top = --depth, count = stack[top].changes_low - stack[top].changes_high;
    const double a = stack[top].low, b = stack[top].high;
    const int outside = a >= 1 || b <= -1;
    const double middle = outside ? 2 / (1 / a + 1 / b) : 0.5 * (a + b);
    int changes;
    if (count <= 0) continue;
    if (count == 1) {
      add_bracket(brackets, lane, a, b);
      continue;
    }
    if (b - a <= 1e-12 * (1 + fabs(middle)) || depth > 60) {
      add_bracket(brackets, lane, middle, middle);
      continue;
    }
    changes = sign_changes_of_lane(chain, lane, middle);
    stack[depth + 1].low = a;
    stack[depth + 1].high = middle;
    stack[depth + 1].changes_low = stack[top].changes_low;
    stack[depth + 1].changes_high = changes;
    stack[depth].low = middle;
    stack[depth].high = b;
    stack[depth].changes_high = stack[top].changes_high;
    stack[depth].changes_low = changes;
    depth += 2;
  }
}

/* Finds intervals for the roots within +-1e6. z is the quotient of two of four homogeneous
   coordinates, so the roots are distributed evenly over the angle atan z: the initial intervals are
   7.5 degrees each. */
static inline void find_brackets(const sturm_chain *chain, lane_mask ok, root_brackets *b) {
  enum { CELLS = 24 };
  static const double edges[CELLS + 1] = {-1e6,
                                          -7.59575411272515,
                                          -3.73205080756888,
                                          -2.41421356237309,
                                          -1.73205080756888,
                                          -1.30322537284121,
                                          -1.0,
                                          -0.76732698797896,
                                          -0.577350269189626,
                                          -0.414213562373095,
                                          -0.267949192431123,
                                          -0.131652497587396,
                                          0.0,
                                          0.131652497587396,
                                          0.267949192431123,
                                          0.414213562373095,
                                          0.577350269189626,
                                          0.76732698797896,
                                          1.0,
                                          1.30322537284121,
                                          1.73205080756888,
                                          2.41421356237309,
                                          3.73205080756888,
                                          7.59575411272515,
                                          1e6};
  lane_mask before = sign_changes(chain, edges[0]) & ok;
  int cell, l;
  memset(b, 0, sizeof *b);
  for (cell = 0; cell < CELLS; ++cell) {
    const lane_mask after = sign_changes(chain, edges[cell + 1]) & ok;
    const lane_mask roots = before - after;
    if (lanes_any(roots)) {
      for (l = 0; l < TVK_LANES; ++l) {
        if (roots[l] == 1) {
          add_bracket(b, l, edges[cell], edges[cell + 1]);
        } else if (roots[l] > 1) {
          split_bracket(chain, l, edges[cell], edges[cell + 1], (int)before[l], (int)after[l], b);
        }
      }
    }
    before = after;
  }
}

static TVK_NOINLINE lanes polynomial_at(const lanes p[11], lanes z, lanes *derivative) {
  lanes value = p[10], slope = {0};
  int i;
  TVK_UNROLL
  for (i = 9; i >= 0; --i) {
    slope = slope * z + value;
    value = value * z + p[i];
  }
  *derivative = slope;
  return value;
}

/* The root in each lane's interval, by Newton steps; a step that would leave the interval is
   replaced by bisection. Beyond +-1 this is done with the reversed polynomial in 1 / z. */
static inline lanes roots_in(const lanes p[11], lanes low, lanes high) {
  const lane_mask outside = (low >= 1.0) | (high <= -1.0);
  const lanes one = lanes_of(1);
  const lanes inverse_low = 1.0 / lanes_select(outside, low, one);
  const lanes inverse_high = 1.0 / lanes_select(outside, high, one);
  lanes q[11], slope, at_low, at_high, z;
  lane_mask low_negative, active;
  int i, iteration;
  for (i = 0; i <= 10; ++i) q[i] = lanes_select(outside, p[10 - i], p[i]);
  low = lanes_select(outside, inverse_high, low);
  high = lanes_select(outside, inverse_low, high);
  at_low = polynomial_at(q, low, &slope);
  at_high = polynomial_at(q, high, &slope);
  low_negative = at_low < 0.0;
  /* If the signs at both ends are equal, the root is an end of the interval, within rounding. */
  active = low_negative ^ (at_high < 0.0);
  z = low - at_low * (high - low) / lanes_select(active, at_high - at_low, one);
  z = lanes_select(active, z, lanes_select(lanes_abs(at_low) < lanes_abs(at_high), low, high));
  for (iteration = 0; iteration < 60 && lanes_any(active); ++iteration) {
    const lanes value = polynomial_at(q, z, &slope);
    const lane_mask below = ~((value < 0.0) ^ low_negative);
    lanes newton, next, limit, step;
    lane_mask inside;
    low = lanes_select(below, z, low);
    high = lanes_select(below, high, z);
    newton = z - value / slope;
    inside = (newton > low) & (newton < high);
    next = lanes_select(inside, newton, 0.5 * (low + high));
    /* Newton's method squares the error: after a step shorter than this the next step would be
       rounding only. */
    limit = lanes_select(inside, lanes_of(1e-9), lanes_of(1e-15)) * (1.0 + lanes_abs(z));
    step = lanes_abs(next - z);
    z = lanes_select(active, next, z);
    active &= step > limit;
  }
  return lanes_select(outside, 1.0 / z, z);
}

/* A multiple of (x, y, 1) at a root z: the longest of the cross products of two rows of the
   matrix. */
static inline void null_vector(const z_matrix *b, lanes z, lanes best[3]) {
  lanes rows[3][3], best_sq = {0};
  int k, i;
  for (k = 0; k < 3; ++k) {
    const lanes *x = b->x[k], *y = b->y[k], *one = b->one[k];
    rows[k][0] = ((x[3] * z + x[2]) * z + x[1]) * z + x[0];
    rows[k][1] = ((y[3] * z + y[2]) * z + y[1]) * z + y[0];
    rows[k][2] = (((one[4] * z + one[3]) * z + one[2]) * z + one[1]) * z + one[0];
  }
  for (i = 0; i < 3; ++i) best[i] = lanes_of(0);
  for (k = 0; k < 3; ++k) {
    const lanes *a = rows[k], *c = rows[(k + 1) % 3];
    lanes cross[3], sq;
    lane_mask longer;
    cross[0] = a[1] * c[2] - a[2] * c[1];
    cross[1] = a[2] * c[0] - a[0] * c[2];
    cross[2] = a[0] * c[1] - a[1] * c[0];
    sq = (cross[0] * cross[0] + cross[1] * cross[1]) + cross[2] * cross[2];
    longer = sq > best_sq;
    best_sq = lanes_select(longer, sq, best_sq);
    for (i = 0; i < 3; ++i) best[i] = lanes_select(longer, cross[i], best[i]);
  }
}

/* The mask of lanes where the five matches satisfy the oriented epipolar constraint (O. Chum, T.
   Werner, J. Matas, "Epipolar geometry estimation via RANSAC benefits from the oriented epipolar
   constraint", ICPR 2004). e x f1 and E f0 are normals of the same epipolar plane. For matches in
   front of both cameras they all point the same way, or all point opposite ways, for the sign of E
   is arbitrary. Matches within about 0.01 rad of the epipoles are ignored. */
static inline lane_mask same_side(const lanes f[10][3], const lanes E[9]) {
  lanes e[3] = {{0}, {0}, {0}}, best_sq = {0};
  lane_mask some_positive = {0}, some_negative = {0};
  int k, i;
  for (k = 0; k < 3; ++k) { /* e, the left null vector: the longest cross product of two columns */
    const int a = k, c = (k + 1) % 3;
    lanes cross[3], sq;
    lane_mask longer;
    cross[0] = E[3 + a] * E[6 + c] - E[6 + a] * E[3 + c];
    cross[1] = E[6 + a] * E[c] - E[a] * E[6 + c];
    cross[2] = E[a] * E[3 + c] - E[3 + a] * E[c];
    sq = (cross[0] * cross[0] + cross[1] * cross[1]) + cross[2] * cross[2];
    longer = sq > best_sq;
    best_sq = lanes_select(longer, sq, best_sq);
    for (i = 0; i < 3; ++i) e[i] = lanes_select(longer, cross[i], e[i]);
  }
  for (k = 0; k < 5; ++k) {
    const lanes *f0 = f[2 * k], *f1 = f[2 * k + 1];
    lanes value = {0}, sq0 = {0}, sq1 = {0};
    lane_mask clear;
    for (i = 0; i < 3; ++i) {
      const int a = (i + 1) % 3, c = (i + 2) % 3;
      const lanes normal = (E[3 * i] * f0[0] + E[3 * i + 1] * f0[1]) + E[3 * i + 2] * f0[2];
      value += (e[a] * f1[c] - e[c] * f1[a]) * normal;
      sq0 += f0[i] * f0[i];
      sq1 += f1[i] * f1[i];
    }
    clear = value * value > (0.5e-8 * best_sq) * (sq0 * sq1);
    some_positive |= clear & (value > 0.0);
    some_negative |= clear & (value < 0.0);
  }
  return ~(some_positive & some_negative);
}

static inline void load_rays(const double *rays, int first, lanes f[10][3]) {
  int k, i;
  TVK_ROLLED
  for (k = 0; k < 10; ++k) {
    for (i = 0; i < 3; ++i) f[k][i] = lanes_load(rays + TVK_WIDTH * (3 * k + i) + first);
  }
}

/* Writes the entries of E as linear polynomials in x, y, z. */
static TVK_NOINLINE void null_space_of(const double *rays, int first, lanes e[9][4],
                                       lane_mask *ok) {
  lanes f[10][3], constraints[5][9], basis[4][9];
  int k, i, j;
  load_rays(rays, first, f);
  for (k = 0; k < 5; ++k) {
    for (i = 0; i < 3; ++i) {
      for (j = 0; j < 3; ++j) constraints[k][3 * i + j] = f[2 * k + 1][i] * f[2 * k][j];
    }
  }
  null_space_5x9(constraints, basis, ok);
  mix_basis(basis);
  for (i = 0; i < 9; ++i) {
    for (k = 0; k < 4; ++k) e[i][k] = basis[k][i];
  }
}

/* Writes the essential matrices that belong to the roots of the determinant. */
static TVK_NOINLINE void write_models(const double *rays, int first, const lanes e[9][4],
                                      const z_matrix *b, lane_mask ok, double *essentials,
                                      int32_t *counts) {
  lanes f[10][3], polynomial[11];
  sturm_chain chain;
  root_brackets brackets;
  int i, r, l;
  determinant_of(b, polynomial);
  ok &= (lanes_abs(polynomial[10]) > 1e-300) & (lanes_abs(polynomial[10]) < 1e300);
  make_sturm_chain(polynomial, &chain);
  find_brackets(&chain, ok, &brackets);
  load_rays(rays, first, f);
  for (l = 0; l < TVK_LANES; ++l) counts[first + l] = 0;
  for (r = 0; r < brackets.most; ++r) {
    const lanes z = roots_in(polynomial, brackets.low[r], brackets.high[r]);
    lanes xy1[3], entries[9], sum = {0}, scale;
    lane_mask keep;
    null_vector(b, z, xy1);
    for (i = 0; i < 9; ++i) {
      entries[i] = (xy1[0] * e[i][0] + xy1[1] * e[i][1]) + xy1[2] * (z * e[i][2] + e[i][3]);
      sum += entries[i] * entries[i];
    }
    scale = 1.0 / lanes_sqrt(sum);
    for (i = 0; i < 9; ++i) entries[i] *= scale;
    keep = (sum > 0.0) & (sum < 1e300) & same_side((const lanes(*)[3])f, entries);
    for (l = 0; l < TVK_LANES; ++l) {
      double *out = essentials + 9 * (10 * (first + l) + counts[first + l]);
      if (r >= brackets.num[l] || !keep[l]) continue;
      for (i = 0; i < 9; ++i) out[i] = entries[i][l];
      ++counts[first + l];
    }
  }
}

/* Solves the samples first .. first + TVK_LANES - 1. */
static void solve_lanes(const double *rays, int first, double *essentials, int32_t *counts) {
  lanes e[9][4];
  lane_mask ok = lanes_of(1) > 0.0;
  z_matrix b;
  null_space_of(rays, first, e, &ok);
  reduce_constraints((const lanes(*)[4])e, &b, &ok);
  write_models(rays, first, (const lanes(*)[4])e, &b, ok, essentials, counts);
}

void TVK_GEOMETRY(relpose_5pt)(const double *rays, int32_t num_samples, double *essentials,
                               int32_t *counts) {
  int first;
  for (first = 0; first < num_samples; first += TVK_LANES) {
    solve_lanes(rays, first, essentials, counts);
  }
}
