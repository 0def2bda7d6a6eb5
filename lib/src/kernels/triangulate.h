/* The kernel triangulate: points from the pixels of two pinhole cameras by Midpoint, Linear-LS or
   Iterative-LS, TVK_LANES matches at a time. It computes what triangulation/triangulation.cc
   computes for one match of any lens, in coordinates of the image planes z = 1. R. Hartley, P.
   Sturm, "Triangulation", CVIU 68(2), 1997. docs/algorithms/triangulation.md. */

#include "kernels/lanes.h"
#include "twoview/triangulate.h"

/* The layout of tv_point in words of eight bytes: three for the position, one for the angle and the
   error (floats), one for the status. */
enum { POINT_WORDS = 5 };
typedef char triangulate_words_fit[sizeof(tv_point) == 8 * POINT_WORDS ? 1 : -1];

/* The rays (x, y, 1), one per lane. */
typedef struct ray_lanes {
  lanes x, y;
} ray_lanes;

/* Results that are stored as floats are computed in floats: their square roots and divisions take a
   quarter of the time. */
typedef float float_lanes __attribute__((vector_size(4 * TVK_LANES)));
typedef int32_t float_mask __attribute__((vector_size(4 * TVK_LANES)));
typedef uint32_t float_bits __attribute__((vector_size(4 * TVK_LANES)));
typedef uint64_t word_lanes __attribute__((vector_size(8 * TVK_LANES)));

static inline float_lanes floats_of(lanes x) { return __builtin_convertvector(x, float_lanes); }
static inline float_lanes floats_select(float_mask mask, float_lanes a, float_lanes b) {
  return (float_lanes)((mask & (float_mask)a) | (~mask & (float_mask)b));
}
static inline float_lanes floats_sqrt(float_lanes a) {
#if defined(TVK_AVX512)
  return (float_lanes)_mm256_sqrt_ps((__m256)a);
#elif defined(TVK_AVX2)
  return (float_lanes)_mm_sqrt_ps((__m128)a);
#else
  int k;
  for (k = 0; k < TVK_LANES; ++k) a[k] = sqrtf(a[k]);
  return a;
#endif
}

/* Packs a lane's two floats into a word of eight bytes, `lower` in the lower half. */
static inline lanes pack_floats(float_lanes lower, float_lanes upper) {
  return (lanes)(__builtin_convertvector((float_bits)lower, word_lanes) |
                 __builtin_convertvector((float_bits)upper, word_lanes) << 32);
}

/* Separates x y x y .. into x x .. and y y .. */
static inline void load_pairs(const double *xy, lanes *x, lanes *y) {
  const lanes a = lanes_load(xy), b = lanes_load(xy + TVK_LANES);
  *x = lanes_shuffle(a, b, LANES_EVEN);
  *y = lanes_shuffle(a, b, LANES_ODD);
}

/* Stores a and b of each lane as two neighbouring words: those of an even lane k start at
   words[0][k], those of an odd lane k at words[1][k - 1]. */
static inline void store_pairs(double words[2][TVK_LANES], lanes a, lanes b) {
  lanes_store(words[0], lanes_shuffle(a, b, LANES_EVEN_PAIRS));
  lanes_store(words[1], lanes_shuffle(a, b, LANES_ODD_PAIRS));
}

/* atan2(sine, cosine) for sine >= 0, to the rounding of a float; the polynomial is exact to
   2e-8. */
static inline float_lanes angle_of(float_lanes sine, float_lanes cosine) {
  static const float c[4] = {-0.333329552f, 0.199779254f, -0.138798422f, 0.0806028197f};
  const float_lanes zero = {0}, size = (float_lanes)((float_mask)cosine & INT32_MAX);
  const float_mask steep = sine > size;
  const float_lanes small = floats_select(steep, size, sine);
  const float_lanes large = floats_select(steep, sine, size);
  const float_mask turned = small > 0.41421356f * large; /* the angle is above 22.5 degrees */
  const float_lanes t =
      floats_select(turned, small - large, small) / floats_select(turned, small + large, large);
  const float_lanes s = t * t;
  float_lanes angle = t + t * (s * (((c[3] * s + c[2]) * s + c[1]) * s + c[0]));
  angle += floats_select(turned, zero + 0.78539816f, zero);
  angle = floats_select(steep, 1.57079633f - angle, angle);
  return floats_select(cosine < 0.0f, 3.14159265f - angle, angle);
}

/* Linear-LS and Iterative-LS: the equations of triangulation/linear.cc for two image
   planes. Clears the bits of `settled` for lanes where the iteration does not converge. */
static inline void least_squares_point(const tvk_triangulate_pair *p, const ray_lanes *ray0,
                                       const ray_lanes *ray1, int iterative, lanes point[3],
                                       lane_mask *settled) {
  const double *R = p->R, *d = p->direction;
  const double step0[2] = {p->inverse_focal[0] * p->inverse_focal[0],
                           p->inverse_focal[1] * p->inverse_focal[1]};
  const double step1[2] = {p->inverse_focal[2] * p->inverse_focal[2],
                           p->inverse_focal[3] * p->inverse_focal[3]};
  lanes A[2][2], m[2], b[2], cov[3], square0 = lanes_of(1), square1 = lanes_of(1);
  lanes depth0 = {0}, depth1 = {0};
  lane_mask active;
  int row, i;
  for (row = 0; row < 2; ++row) {
    const lanes along = row ? ray1->y : ray1->x;
    for (i = 0; i < 2; ++i) A[row][i] = along * R[6 + i] - R[3 * row + i];
    m[row] = (A[row][0] * ray0->x + A[row][1] * ray0->y) + (along * R[8] - R[3 * row + 2]);
    b[row] = along * d[2] - d[row];
  }
  cov[0] = A[0][0] * A[0][0] * step0[0] + A[0][1] * A[0][1] * step0[1];
  cov[1] = A[0][0] * A[1][0] * step0[0] + A[0][1] * A[1][1] * step0[1];
  cov[2] = A[1][0] * A[1][0] * step0[0] + A[1][1] * A[1][1] * step0[1];
  active = square0 > 0.0;
  for (i = 0; i <= 10; ++i) { /* at most 10 iterations, as in Hartley and Sturm */
    const lanes xx = square0 * cov[0] + square1 * step1[0], xy = square0 * cov[1];
    const lanes yy = square0 * cov[2] + square1 * step1[1];
    const lanes m0 = yy * m[0] - xy * m[1], m1 = xx * m[1] - xy * m[0];
    const lanes size = m0 * m[0] + m1 * m[1], det = xx * yy - xy * xy;
    const lanes inverse = 1.0 / (size * det);
    const lanes before0 = depth0, before1 = depth1;
    const lanes depth = -(m0 * b[0] + m1 * b[1]) * (det * inverse);
    const lanes e0 = m[0] * depth + b[0], e1 = m[1] * depth + b[1];
    const lanes factor = -square0 * (size * inverse);
    const lanes r0 = factor * (yy * e0 - xy * e1), r1 = factor * (xx * e1 - xy * e0);
    const lanes x = depth * ray0->x + step0[0] * (A[0][0] * r0 + A[1][0] * r1);
    const lanes y = depth * ray0->y + step0[1] * (A[0][1] * r0 + A[1][1] * r1);
    point[0] = lanes_select(active, x, point[0]);
    point[1] = lanes_select(active, y, point[1]);
    point[2] = lanes_select(active, depth, point[2]);
    if (!iterative) return;
    depth0 = depth;
    depth1 = (R[6] * x + R[7] * y) + (R[8] * depth + d[2]);
    active &= ~((lanes_abs(depth0 - before0) <= 1e-10 * lanes_abs(depth0)) &
                (lanes_abs(depth1 - before1) <= 1e-10 * lanes_abs(depth1)));
    if (!lanes_any(active)) return;
    square0 = depth0 * depth0;
    square1 = depth1 * depth1;
  }
  *settled &= ~active;
}

/* Triangulates one block of pixels, given relative to the principal points. Writes the words of
   the points: two pairs by store_pairs, then the status. Returns the mask of the lanes without a
   point. */
static inline lane_mask triangulate_lanes(const tvk_triangulate_pair *p, int method, lanes u0,
                                          lanes v0, lanes u1, lanes v1,
                                          double words[POINT_WORDS][TVK_LANES]) {
  const double *R = p->R, *d = p->direction, *c = p->center1;
  const ray_lanes r0 = {u0 * p->inverse_focal[0], v0 * p->inverse_focal[1]};
  const ray_lanes r1 = {u1 * p->inverse_focal[2], v1 * p->inverse_focal[3]};
  lanes f[3], n[3], point[3] = {{0}, {0}, {0}}, moved[3]; /* f: ray 1 in camera 0; n = ray 0 x f */
  lanes n_sq, size_sq, cosine, along0, along1, inverse, error_sq, floats;
  lane_mask good, status;
  int i;
  TVK_UNROLL
  for (i = 0; i < 3; ++i) f[i] = (R[i] * r1.x + R[3 + i] * r1.y) + R[6 + i];
  n[0] = r0.y * f[2] - f[1];
  n[1] = f[0] - r0.x * f[2];
  n[2] = r0.x * f[1] - r0.y * f[0];
  n_sq = (n[0] * n[0] + n[1] * n[1]) + n[2] * n[2];
  size_sq = ((r0.x * r0.x + r0.y * r0.y) + 1.0) * ((f[0] * f[0] + f[1] * f[1]) + f[2] * f[2]);
  cosine = (r0.x * f[0] + r0.y * f[1]) + f[2];
  good = (n_sq > p->parallel_sine_sq * size_sq) & (size_sq < 1e36);
  along0 = ((c[1] * f[2] - c[2] * f[1]) * n[0] + (c[2] * f[0] - c[0] * f[2]) * n[1]) +
           (c[0] * f[1] - c[1] * f[0]) * n[2];
  along1 = ((c[1] - c[2] * r0.y) * n[0] + (c[2] * r0.x - c[0]) * n[1]) +
           (c[0] * r0.y - c[1] * r0.x) * n[2];
  if (method == TV_TRIANGULATION_MIDPOINT) {
    const lanes half = 0.5 / n_sq;
    const lanes t0 = along0 * half, t1 = along1 * half;
    point[0] = (t0 * r0.x + t1 * f[0]) + 0.5 * c[0];
    point[1] = (t0 * r0.y + t1 * f[1]) + 0.5 * c[1];
    point[2] = (t0 + t1 * f[2]) + 0.5 * c[2];
  } else {
    least_squares_point(p, &r0, &r1, method == TV_TRIANGULATION_ITERATIVE_LS, point, &good);
  }
  TVK_UNROLL
  for (i = 0; i < 3; ++i) {
    moved[i] = ((R[3 * i] * point[0] + R[3 * i + 1] * point[1]) + R[3 * i + 2] * point[2]) + d[i];
  }
  /* A point behind a camera is projected through the camera's centre. */
  inverse = 1.0 / (point[2] * moved[2]);
  {
    const lanes inverse0 = moved[2] * inverse, inverse1 = point[2] * inverse;
    const lanes ex0 = p->focal[0] * (point[0] * inverse0) - u0;
    const lanes ey0 = p->focal[1] * (point[1] * inverse0) - v0;
    const lanes ex1 = p->focal[2] * (moved[0] * inverse1) - u1;
    const lanes ey1 = p->focal[3] * (moved[1] * inverse1) - v1;
    error_sq = 0.5 * ((ex0 * ex0 + ey0 * ey0) + (ex1 * ex1 + ey1 * ey1));
  }
  {
    const lanes ahead0 = (r0.x * point[0] + r0.y * point[1]) + point[2];
    const lanes ahead1 = (r1.x * moved[0] + r1.y * moved[1]) + moved[2];
    const lane_mask in_front = (along0 > 0.0) & (along1 > 0.0) & (ahead0 > 0.0) & (ahead1 > 0.0);
    /* No pixel sees a point whose depths along the ray and along the optical axis differ in
       sign. */
    good &= (ahead0 * point[2] > 0.0) & (ahead1 * moved[2] > 0.0) & (error_sq < 1e36);
    status = (in_front & TV_POINT_OK) | (~in_front & TV_POINT_BEHIND);
  }
  TVK_UNROLL
  for (i = 0; i < 3; ++i) {
    point[i] *= p->baseline;
    good &= lanes_abs(point[i]) < 1e300;
  }
  TVK_UNROLL
  for (i = 0; i < 3; ++i) point[i] = lanes_keep(good, point[i]);
  floats = pack_floats(angle_of(floats_sqrt(floats_of(n_sq)), floats_of(cosine)),
                       floats_sqrt(floats_of(error_sq)));
  store_pairs(words, point[0], point[1]);
  store_pairs(words + 2, point[2], lanes_keep(good, floats));
  lanes_store(words[4],
              (lanes)((status | ~good) & UINT32_MAX)); /* status -1 in the lanes without a point */
  return ~good;
}

/* Triangulates TVK_LANES matches and writes the points of the first `count`. Returns the mask of
   the lanes without a point, which includes lanes after the first `count`. */
static inline lane_mask triangulate_block(const tvk_triangulate_pair *p, int method,
                                          const double *pixels0, const double *pixels1, int count,
                                          tv_point *points) {
  double words[POINT_WORDS][TVK_LANES];
  lanes u0, v0, u1, v1;
  lane_mask left;
  int k;
  load_pairs(pixels0, &u0, &v0);
  load_pairs(pixels1, &u1, &v1);
  u0 -= p->principal[0];
  v0 -= p->principal[1];
  u1 -= p->principal[2];
  v1 -= p->principal[3];
  left = triangulate_lanes(p, method, u0, v0, u1, v1, words);
  for (k = 0; k < count; ++k) {
    char *const point = (char *)(points + k);
    memcpy(point, words[k & 1] + (k & ~1), 16);
    memcpy(point + 16, words[2 + (k & 1)] + (k & ~1), 16);
    memcpy(point + 32, words[4] + k, 8);
  }
  return left;
}

int32_t TVK_GEOMETRY(triangulate)(const tvk_triangulate_pair *pair, int32_t method,
                                  const double *pixels0, const double *pixels1, int32_t count,
                                  tv_point *points) {
  const int32_t whole = count - count % TVK_LANES, rest = count - whole;
  lane_mask left = {0};
  int32_t k, any;
  for (k = 0; k < whole; k += TVK_LANES) {
    left |=
        triangulate_block(pair, method, pixels0 + 2 * k, pixels1 + 2 * k, TVK_LANES, points + k);
  }
  any = lanes_any(left);
  if (rest > 0) {
    double last0[2 * TVK_LANES] = {0}, last1[2 * TVK_LANES] = {0};
    memcpy(last0, pixels0 + 2 * whole, (size_t)rest * 2 * sizeof last0[0]);
    memcpy(last1, pixels1 + 2 * whole, (size_t)rest * 2 * sizeof last1[0]);
    left = triangulate_block(pair, method, last0, last1, rest, points + whole);
    for (k = 0; k < rest; ++k) any |= left[k] != 0;
  }
  return any;
}
