#include "geometry/residuals.h"

#include <cmath>
#include <cstring>

#include "base/math.h"
#include "twoview/context.h"

namespace tv {
namespace {

constexpr double kInfinity = __builtin_inf();
// A model is given up after this many blocks, or twice, four times as many, when it does badly.
constexpr int kFirstBlocks = 2;

size_t padded(int max_matches) {
  return (static_cast<size_t>(max_matches) + kScoreBlock - 1) / kScoreBlock * kScoreBlock;
}

struct Epipolar {
  Vec3 f0, f1;
  Vec3 line1, line0;    // M f0, M' f1
  double c, n;          // f1' M f0, and the sum under the root
  double s0[2], s1[2];  // J0' M' f1, J1' M f0
};

inline void epipolar(const RayPairs& p, int i, const Mat3& M, Epipolar* e) {
  const double x0 = p.ray[0][0][i], y0 = p.ray[0][1][i], z0 = p.ray[0][2][i];
  const double x1 = p.ray[1][0][i], y1 = p.ray[1][1][i], z1 = p.ray[1][2][i];
  e->f0 = Vec3(x0, y0, z0);
  e->f1 = Vec3(x1, y1, z1);
  for (int r = 0; r < 3; ++r) {
    e->line1[r] = (M(r, 0) * x0 + M(r, 1) * y0) + M(r, 2) * z0;
    e->line0[r] = (M(0, r) * x1 + M(1, r) * y1) + M(2, r) * z1;
  }
  e->c = (x1 * e->line1[0] + y1 * e->line1[1]) + z1 * e->line1[2];
  for (int k = 0; k < 2; ++k) {
    e->s0[k] = (p.jacobian[0][k][i] * e->line0[0] + p.jacobian[0][2 + k][i] * e->line0[1]) +
               p.jacobian[0][4 + k][i] * e->line0[2];
    e->s1[k] = (p.jacobian[1][k][i] * e->line1[0] + p.jacobian[1][2 + k][i] * e->line1[1]) +
               p.jacobian[1][4 + k][i] * e->line1[2];
  }
  e->n = (e->s0[0] * e->s0[0] + e->s0[1] * e->s0[1]) + (e->s1[0] * e->s1[0] + e->s1[1] * e->s1[1]);
}

// A model's entries, row by row.
struct Entries {
  double m[9];
};

Entries entries_of(const Mat3& M) {
  Entries e;
  for (int k = 0; k < 9; ++k) e.m[k] = M(k / 3, k % 3);
  return e;
}

struct Arrays {
  const double* p[18];
};

Arrays arrays_of(const RayPairs& pairs) {
  Arrays a;
  for (int v = 0; v < 2; ++v) {
    for (int k = 0; k < 3; ++k) a.p[3 * v + k] = pairs.ray[v][k];
    for (int k = 0; k < 6; ++k) a.p[6 + 6 * v + k] = pairs.jacobian[v][k];
  }
  return a;
}

}  // namespace

size_t ray_pairs_bytes(int max_matches) {
  return 19 * arena_bytes<double>(static_cast<size_t>(max_matches)) +
         18 * arena_bytes<float>(padded(max_matches));
}

RayPairs alloc_ray_pairs(Arena& arena, int max_matches, bool on_plane) {
  RayPairs pairs{};
  pairs.kernels = tvk_select(TV_KERNELS_C);
  const size_t n = static_cast<size_t>(max_matches);
  pairs.on_plane = on_plane;
  for (int v = 0; v < 2; ++v) {
    for (int k = 0; k < 3; ++k) pairs.ray[v][k] = arena_alloc<double>(arena, n);
    for (int k = 0; k < 6; ++k) pairs.jacobian[v][k] = arena_alloc<double>(arena, n);
  }
  pairs.pixel_angle = arena_alloc<double>(arena, n);
  for (int k = 0; k < (on_plane ? 10 : 18); ++k) {
    pairs.fast[k] = arena_alloc<float>(arena, padded(max_matches));
  }
  return pairs;
}

void set_ray(RayPairs& pairs, int view, int i, const Vec3& ray, const Mat32& jacobian) {
  double entries[6];
  for (int k = 0; k < 6; ++k) entries[k] = jacobian(k / 2, k % 2);
  set_ray(pairs, view, i, ray.data(), entries);
}

void set_ray(RayPairs& pairs, int view, int i, const double ray[3], const double jacobian[6]) {
  for (int k = 0; k < 3; ++k) pairs.ray[view][k][i] = ray[k];
  for (int k = 0; k < 6; ++k) pairs.jacobian[view][k][i] = jacobian[k];
}

namespace {

// |J|^2 is twice the squared angle of a pixel; lengths across the ray count, those along it do not.
double pixel_angle(const RayPairs& pairs, int i) {
  double sum = 0;
  for (int v = 0; v < 2; ++v) {
    const double x = pairs.ray[v][0][i], y = pairs.ray[v][1][i], z = pairs.ray[v][2][i];
    const double inverse_sq = 1 / (x * x + (y * y + z * z));
    for (int k = 0; k < 2; ++k) {
      const double a = pairs.jacobian[v][k][i], b = pairs.jacobian[v][2 + k][i],
                   c = pairs.jacobian[v][4 + k][i];
      const double along = a * x + (b * y + c * z);
      sum += ((a * a + (b * b + c * c)) - along * along * inverse_sq) * inverse_sq;
    }
  }
  return std::sqrt(0.5 * sum);
}

// Of n numbers, one that shares no factor with n, near n times the golden ratio: k step mod n, for
// k = 0, 1, .., visits all, and any first few of them are spread evenly.
int even_step(int n) {
  int step = static_cast<int>(0.6180339887498949 * n);
  for (;; ++step) {
    int a = n, b = step;
    while (b > 0) {
      const int remainder = a % b;
      a = b;
      b = remainder;
    }
    if (a == 1) return step;
  }
}

void set_fast(RayPairs& pairs, int slot, int i) {
  for (int v = 0; v < 2; ++v) {
    if (pairs.on_plane) {
      for (int k = 0; k < 2; ++k) {
        pairs.fast[2 * v + k][slot] = static_cast<float>(pairs.ray[v][k][i]);
      }
      double* const* J = pairs.jacobian[v];
      const double a = J[0][i], b = J[1][i], c = J[2][i], d = J[3][i];
      const double metric[3] = {a * a + b * b, a * c + b * d, c * c + d * d};
      for (int k = 0; k < 3; ++k) {
        pairs.fast[4 + 3 * v + k][slot] = static_cast<float>(metric[k]);
      }
    } else {
      for (int k = 0; k < 3; ++k) {
        pairs.fast[3 * v + k][slot] = static_cast<float>(pairs.ray[v][k][i]);
      }
      for (int k = 0; k < 6; ++k) {
        pairs.fast[6 + 6 * v + k][slot] = static_cast<float>(pairs.jacobian[v][k][i]);
      }
    }
  }
}

}  // namespace

void finish_rays(RayPairs& pairs) { finish_rays(pairs, pairs.num); }

void finish_rays(RayPairs& pairs, int num_scored) {
  for (int i = 0; i < pairs.num; ++i) pairs.pixel_angle[i] = pixel_angle(pairs, i);
  const int step = num_scored > 0 ? even_step(num_scored) : 0;
  for (int slot = 0, i = 0; slot < num_scored; ++slot) {
    set_fast(pairs, slot, i);
    i = i < num_scored - step ? i + step : i - (num_scored - step);
  }
  const int end = static_cast<int>(padded(num_scored));
  for (int k = 0; k < (pairs.on_plane ? 10 : 18); ++k) {
    for (int slot = num_scored; slot < end; ++slot) pairs.fast[k][slot] = 0;
  }
}

double sampson_sq(const RayPairs& pairs, int i, const Mat3& M) {
  Epipolar e;
  epipolar(pairs, i, M, &e);
  const double q = e.c * e.c / e.n;
  return q >= 0 ? q : kInfinity;
}

bool sampson_slopes(const RayPairs& pairs, int i, const Mat3& M, const double curvature[2][9],
                    SampsonSlopes* slopes) {
  Epipolar e;
  epipolar(pairs, i, M, &e);
  if (!(e.n > 0)) return false;
  const double inverse = 1 / std::sqrt(e.n), share = e.c / e.n;
  slopes->residual = e.c * inverse;
  // c / sqrt(n) has the slopes (d c - c / n (s0' d s0 + s1' d s1)) / sqrt(n), s0 = J0' M' f1 and s1
  // = J1' M f0: by M those of f1' M q0 + (q1 - f1)' M f0.
  double q0[3], q1[3];
  for (int r = 0; r < 3; ++r) {
    double* const* J = pairs.jacobian[0] + 2 * r;
    q0[r] = e.f0[r] - share * (J[0][i] * e.s0[0] + J[1][i] * e.s0[1]);
    J = pairs.jacobian[1] + 2 * r;
    q1[r] = e.f1[r] - share * (J[0][i] * e.s1[0] + J[1][i] * e.s1[1]);
  }
  double along[2][3];  // M' q1, M q0: what a ray that moves changes
  for (int r = 0; r < 3; ++r) {
    along[0][r] = (M(0, r) * q1[0] + M(1, r) * q1[1]) + M(2, r) * q1[2];
    along[1][r] = (M(r, 0) * q0[0] + M(r, 1) * q0[1]) + M(r, 2) * q0[2];
    for (int c = 0; c < 3; ++c) {
      slopes->by_entry[3 * r + c] = inverse * (e.f1[r] * q0[c] + (q1[r] - e.f1[r]) * e.f0[c]);
    }
  }
  for (int k = 0; k < 2; ++k) {
    double slope = 0;
    for (int r = 0; r < 3; ++r) {
      slope -= pairs.jacobian[0][2 * r + k][i] * along[0][r] +
               pairs.jacobian[1][2 * r + k][i] * along[1][r];
      if (curvature == nullptr) continue;
      const double *bend0 = curvature[0] + 3 * r + k, *bend1 = curvature[1] + 3 * r + k;
      slope += share * ((bend0[0] * e.s0[0] + bend0[1] * e.s0[1]) * e.line0[r] +
                        (bend1[0] * e.s1[0] + bend1[1] * e.s1[1]) * e.line1[r]);
    }
    slopes->by_point[k] = inverse * slope;
  }
  return true;
}

void sampson_squares(const RayPairs& pairs, int first, int count, const Mat3& M, double* squares) {
  pairs.kernels->sampson_squares(arrays_of(pairs).p, nullptr, first, count, pairs.on_plane,
                                 entries_of(M).m, squares);
}

void sampson_squares(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& M,
                     double* squares) {
  pairs.kernels->sampson_squares(arrays_of(pairs).p, indices, 0, count, pairs.on_plane,
                                 entries_of(M).m, squares);
}

void pose_squares(const RayPairs& pairs, int first, int count, const Pose& pose, double scale_px,
                  double* squares) {
  const Arrays rays = arrays_of(pairs);
  const double* arrays[19];
  for (int k = 0; k < 18; ++k) arrays[k] = rays.p[k];
  arrays[18] = pairs.pixel_angle;
  double entries[21];
  const Mat3 E = essential_from_pose(pose);
  for (int k = 0; k < 9; ++k) {
    entries[k] = E(k / 3, k % 3);
    entries[9 + k] = pose.R(k / 3, k % 3);
  }
  for (int k = 0; k < 3; ++k) entries[18 + k] = pose.t[k];
  pairs.kernels->pose_squares(arrays, first, count, pairs.on_plane, entries, scale_px, squares);
}

namespace {

// What the first `num` of all matches cost at most, 98 times in a hundred, when all cost `bound`
// and the first are drawn at random without replacement: the mean, and two standard deviations of
// what lies between 0 and 1 with that mean.
int64_t bound_of_first(int64_t bound, int num, int all) {
  const double mean = static_cast<double>(bound) / (static_cast<double>(all) * kCostOne);
  if (mean >= 1) return INT64_MAX;
  const double left = 1 - static_cast<double>(num) / all;
  const double slack = 2 * std::sqrt(mean * (1 - mean) * num * left);
  return static_cast<int64_t>((mean * num + slack) * kCostOne);
}

}  // namespace

int64_t msac_cost_fast(const RayPairs& pairs, const Mat3& M, double threshold_px, int64_t bound) {
  float m[9];
  for (int k = 0; k < 9; ++k) m[k] = static_cast<float>(M(k / 3, k % 3));
  const double inverse = 1 / (threshold_px * threshold_px);
  const float inverse_sq = static_cast<float>(inverse < 1e37 ? inverse : 1e37);
  const int num_blocks = static_cast<int>(padded(pairs.num)) / kScoreBlock;
  // The padding costs kCostOne each.
  int64_t sum = -static_cast<int64_t>(num_blocks * kScoreBlock - pairs.num) * kCostOne;
  int done = 0;
  for (int end = kFirstBlocks; done < num_blocks; end *= 2) {
    if (end > num_blocks) end = num_blocks;
    sum +=
        pairs.kernels->sampson_score(pairs.fast, done, end - done, pairs.on_plane, m, inverse_sq);
    done = end;
    if (done == num_blocks) break;
    if (bound < INT64_MAX && sum > bound_of_first(bound, done * kScoreBlock, pairs.num)) {
      return INT64_MAX;
    }
  }
  return sum;
}

namespace {

// The prediction's displacement d (pixels of image 1) and slope = d d / d h (2x3), h = H f0.
// With P the left inverse of J1 that sends f1 to zero, d = P h / (m . h), where m = e_z on the
// plane and f1 on the sphere. False when H sends the ray behind.
struct Transfer {
  double f0[3];
  double d[2];
  double slope[2][3];
  double weight[3];  // (I + D D')^-1: 00, 01, 11
};

inline void left_inverse(const RayPairs& pairs, int i, double P[2][3], double m[3]) {
  double* const* J = pairs.jacobian[1];
  double* const* f = pairs.ray[1];
  if (pairs.on_plane) {
    const double a = J[0][i], b = J[1][i], c = J[2][i], d = J[3][i];
    const double inverse = 1 / (a * d - b * c);
    P[0][0] = d * inverse;
    P[0][1] = -b * inverse;
    P[1][0] = -c * inverse;
    P[1][1] = a * inverse;
    for (int r = 0; r < 2; ++r) P[r][2] = -(P[r][0] * f[0][i] + P[r][1] * f[1][i]);
    m[0] = m[1] = 0;
    m[2] = 1;
    return;
  }
  double a = 0, b = 0, c = 0;
  for (int k = 0; k < 3; ++k) {
    a += J[2 * k][i] * J[2 * k][i];
    b += J[2 * k][i] * J[2 * k + 1][i];
    c += J[2 * k + 1][i] * J[2 * k + 1][i];
    m[k] = f[k][i];
  }
  const double inverse = 1 / (a * c - b * b);
  for (int k = 0; k < 3; ++k) {
    P[0][k] = (c * J[2 * k][i] - b * J[2 * k + 1][i]) * inverse;
    P[1][k] = (a * J[2 * k + 1][i] - b * J[2 * k][i]) * inverse;
  }
}

bool transfer(const RayPairs& pairs, int i, const Mat3& H, Transfer* t) {
  double P[2][3], m[3], h[3], moved[3][2];  // moved = H J0
  left_inverse(pairs, i, P, m);
  for (int k = 0; k < 3; ++k) t->f0[k] = pairs.ray[0][k][i];
  double* const* J0 = pairs.jacobian[0];
  for (int r = 0; r < 3; ++r) {
    h[r] = (H(r, 0) * t->f0[0] + H(r, 1) * t->f0[1]) + H(r, 2) * t->f0[2];
    for (int c = 0; c < 2; ++c) {
      moved[r][c] = (H(r, 0) * J0[c][i] + H(r, 1) * J0[2 + c][i]) + H(r, 2) * J0[4 + c][i];
    }
  }
  const double depth = (m[0] * h[0] + m[1] * h[1]) + m[2] * h[2];
  if (!(depth > 0)) return false;
  const double inverse = 1 / depth;
  double D[2][2];
  for (int r = 0; r < 2; ++r) {
    t->d[r] = ((P[r][0] * h[0] + P[r][1] * h[1]) + P[r][2] * h[2]) * inverse;
    for (int k = 0; k < 3; ++k) t->slope[r][k] = (P[r][k] - t->d[r] * m[k]) * inverse;
    for (int c = 0; c < 2; ++c) {
      D[r][c] = (t->slope[r][0] * moved[0][c] + t->slope[r][1] * moved[1][c]) +
                t->slope[r][2] * moved[2][c];
    }
  }
  const double g00 = 1 + (D[0][0] * D[0][0] + D[0][1] * D[0][1]);
  const double g11 = 1 + (D[1][0] * D[1][0] + D[1][1] * D[1][1]);
  const double g01 = D[0][0] * D[1][0] + D[0][1] * D[1][1];
  const double inverse_det = 1 / (g00 * g11 - g01 * g01);
  t->weight[0] = g11 * inverse_det;
  t->weight[1] = -g01 * inverse_det;
  t->weight[2] = g00 * inverse_det;
  return true;
}

inline double weighted_sq(const Transfer& t) {
  return t.d[0] * (t.weight[0] * t.d[0] + t.weight[1] * t.d[1]) +
         t.d[1] * (t.weight[1] * t.d[0] + t.weight[2] * t.d[1]);
}

}  // namespace

TransferResidual transfer_residual(const RayPairs& pairs, int i, const Mat3& H) {
  // A homography is known up to sign: the caller's H has the sign that sends points in front.
  Transfer t;
  if (!transfer(pairs, i, H, &t)) return {kInfinity, kInfinity};
  const double r_sq = weighted_sq(t);
  return {r_sq >= 0 ? r_sq : kInfinity, t.d[0] * t.d[0] + t.d[1] * t.d[1]};
}

void transfer_squares(const RayPairs& pairs, int first, int count, const Mat3& H, double* squares) {
  pairs.kernels->transfer_squares(arrays_of(pairs).p, nullptr, first, count, pairs.on_plane,
                                  entries_of(H).m, squares);
}

void transfer_squares(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& H,
                      double* squares) {
  pairs.kernels->transfer_squares(arrays_of(pairs).p, indices, 0, count, pairs.on_plane,
                                  entries_of(H).m, squares);
}

void squared_sines(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& R,
                   double* sines_sq) {
  for (int k = 0; k < count; ++k) {
    const int i = indices[k];
    const double b[3] = {pairs.ray[1][0][i], pairs.ray[1][1][i], pairs.ray[1][2][i]};
    double a[3], across[3];
    turn_ray0(pairs, i, R, a);
    cross(a, b, across);
    sines_sq[k] = dot(a, b) > 0 ? dot(across, across) / (dot(a, a) * dot(b, b)) : 2;
  }
}

void direction_noise(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                     double block[3]) {
  Vec3 b[2];
  tangent_basis(pose.t, &b[0], &b[1]);
  double along[3][3];  // b[0], b[1] and t
  for (int i = 0; i < 3; ++i) {
    along[0][i] = b[0][i];
    along[1][i] = b[1][i];
    along[2][i] = pose.t[i];
  }
  block[0] = block[1] = block[2] = 0;
  for (int k = 0; k < count; ++k) {
    const int i = indices[k];
    const double f1[3] = {pairs.ray[1][0][i], pairs.ray[1][1][i], pairs.ray[1][2][i]};
    double f0[3], g[3][4];  // g: gradients of along . (f0 x f1) by the four pixels
    turn_ray0(pairs, i, pose.R, f0);
    for (int c = 0; c < 4; ++c) {
      double* const* J = pairs.jacobian[c / 2];
      const double slope[3] = {J[c % 2][i], J[2 + c % 2][i], J[4 + c % 2][i]};
      double turned[3], moved[3];
      if (c < 2) {
        for (int r = 0; r < 3; ++r) {
          turned[r] = (pose.R(r, 0) * slope[0] + pose.R(r, 1) * slope[1]) + pose.R(r, 2) * slope[2];
        }
        cross(turned, f1, moved);
      } else {
        cross(f0, slope, moved);
      }
      for (int a = 0; a < 3; ++a) g[a][c] = dot(along[a], moved);
    }
    const double norm_sq =
        (g[2][0] * g[2][0] + g[2][1] * g[2][1]) + (g[2][2] * g[2][2] + g[2][3] * g[2][3]);
    if (!(norm_sq > 0)) continue;
    const double inverse = 1 / norm_sq;
    for (int c = 0; c < 4; ++c) {
      block[0] += g[0][c] * g[0][c] * inverse;
      block[1] += g[0][c] * g[1][c] * inverse;
      block[2] += g[1][c] * g[1][c] * inverse;
    }
  }
}

// The lanes of one of the kernel's sums, in a fixed order.
inline double over_lanes(const double* x) {
  return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
}

using SumsKernel = void (*)(const double* const*, const int32_t*, int32_t, int32_t, int32_t,
                            const double*, double, int32_t, double*);

// What the kernel adds up, lanes together; returns the loss. The logarithms of Cauchy's loss are
// those of products of few enough factors, each at most 1 + TVK_LARGEST_LOSS.
double add_up(SumsKernel kernel, int num_sums, const RayPairs& pairs, const int32_t* indices,
              int count, const Mat3& M, const RobustLoss& loss, double* totals) {
  constexpr int kFactors = 64;
  const Arrays arrays = arrays_of(pairs);
  const Entries entries = entries_of(M);
  const double inverse_sq = 1 / (loss.scale_px * loss.scale_px);
  const bool cauchy = loss.kind == Loss::kCauchy;
  double sums[TVK_SAMPSON_SUMS][TVK_WIDTH] = {};
  double* products = sums[num_sums - 1];
  double cost = 0;
  for (int first = 0; first < count; first += TVK_WIDTH * kFactors) {
    const int some = count - first < TVK_WIDTH * kFactors ? count - first : TVK_WIDTH * kFactors;
    for (int l = 0; l < TVK_WIDTH; ++l) products[l] = 1;
    kernel(arrays.p, indices ? indices + first : nullptr, first, some, pairs.on_plane, entries.m,
           inverse_sq, cauchy, sums[0]);
    for (int l = 0; l < TVK_WIDTH && cauchy; ++l) cost += log(products[l]);
  }
  for (int k = 0; k < num_sums - 2; ++k) totals[k] = over_lanes(sums[k]);
  return cauchy ? cost : over_lanes(sums[num_sums - 2]);
}

// Normal equations of the matrix's entries, to those of parameters with d matrix / dparameter p =
// columns[p].
void project(const double full[9][9], const double slope[9], const Mat3* columns, int num,
             double* upper, double* gradient) {
  double flat[9][9];
  for (int p = 0; p < num; ++p) {
    for (int i = 0; i < 9; ++i) flat[p][i] = columns[p](i / 3, i % 3);
  }
  int slot = 0;
  for (int p = 0; p < num; ++p) {
    double product[9];
    gradient[p] = 0;
    for (int i = 0; i < 9; ++i) {
      gradient[p] += flat[p][i] * slope[i];
      product[i] = 0;
      for (int j = 0; j < 9; ++j) product[i] += full[i][j] * flat[p][j];
    }
    for (int r = p; r < num; ++r) {
      double sum = 0;
      for (int i = 0; i < 9; ++i) sum += flat[r][i] * product[i];
      upper[slot++] = sum;
    }
  }
}

double sampson_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                const Mat3& M, const Mat3* columns, int num_parameters,
                                const RobustLoss& loss, double* upper, double* gradient) {
  double totals[TVK_SAMPSON_SUMS - 2], full[9][9];
  const double cost =
      add_up(pairs.kernels->sampson_sums, TVK_SAMPSON_SUMS, pairs, indices, count, M, loss, totals);
  int slot = 0;
  for (int i = 0; i < 9; ++i) {
    for (int j = i; j < 9; ++j) full[i][j] = full[j][i] = totals[slot++];
  }
  project(full, totals + 45, columns, num_parameters, upper, gradient);
  return cost;
}

double transfer_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                 const Mat3& H, const Mat3* columns, int num_parameters,
                                 const RobustLoss& loss, double* upper, double* gradient) {
  static constexpr int kPlace[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};
  double totals[TVK_TRANSFER_SUMS - 2], full[9][9];
  const double cost = add_up(pairs.kernels->transfer_sums, TVK_TRANSFER_SUMS, pairs, indices, count,
                             H, loss, totals);
  for (int i = 0; i < 9; ++i) {
    for (int j = 0; j < 9; ++j) {
      full[i][j] = totals[6 * kPlace[i / 3][j / 3] + kPlace[i % 3][j % 3]];
    }
  }
  if (columns != nullptr) {
    project(full, totals + 36, columns, num_parameters, upper, gradient);
    return cost;
  }
  int slot = 0;
  for (int p = 0; p < 9; ++p) {
    gradient[p] = totals[36 + p];
    for (int r = p; r < 9; ++r) upper[slot++] = full[p][r];
  }
  return cost;
}

}  // namespace tv
