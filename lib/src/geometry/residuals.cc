#include "geometry/residuals.h"

#include "base/math.h"

#include <cmath>
#include <cstring>

namespace tv {
namespace {

constexpr double kInfinity = __builtin_inf();
constexpr double kLargestQ = 1e300, kLogLargestQ = 690.8;  // beyond it, no slope

size_t padded(int max_matches) {
  return (static_cast<size_t>(max_matches) + kScoreBlock - 1) / kScoreBlock * kScoreBlock;
}

struct Epipolar {
  Vec3 f0, f1;
  Vec3 line1, line0;  // M f0, M' f1
  double c, n;        // f1' M f0, and the sum under the root
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

// (value, weight) of the loss at q = r^2 / scale^2; weight = d value / d q.
inline double robust(Loss kind, double q, double* weight) {
  if (kind == Loss::kTruncated) {
    *weight = q < 1 ? 1.0 : 0.0;
    return q < 1 ? q : 1.0;
  }
  *weight = 1 / (1 + q);
  return log(1 + q);
}

// The integer cost of a block of r^2 / T^2. Whole arrays through their bits, so that every step is
// a plain vector operation: read as unsigned integers, floats in [0, 1) are those below 1.0f's
// bits; a NaN or a negative rounding error is above and costs 1.
inline int32_t sum_of_costs(const float q[kScoreBlock]) {
  uint32_t bits[kScoreBlock];
  float capped[kScoreBlock];
  std::memcpy(bits, q, sizeof bits);
  constexpr uint32_t kOneBits = 0x3f800000u;
  for (int i = 0; i < kScoreBlock; ++i) bits[i] = bits[i] < kOneBits ? bits[i] : kOneBits;
  std::memcpy(capped, bits, sizeof bits);
  int32_t sum = 0;
  for (int i = 0; i < kScoreBlock; ++i) {
    sum += static_cast<int32_t>(capped[i] * static_cast<float>(kCostOne));
  }
  return sum;
}

// One block on the plane: kScoreBlock matches, a fixed trip count.
inline int32_t block_cost_plane(const RayPairs& p, int begin, const float m[9], float inverse_sq) {
  const float* x0 = p.fast[0] + begin;
  const float* y0 = p.fast[1] + begin;
  const float* x1 = p.fast[2] + begin;
  const float* y1 = p.fast[3] + begin;
  const float* a0 = p.fast[4] + begin;
  const float* b0 = p.fast[5] + begin;
  const float* c0 = p.fast[6] + begin;
  const float* a1 = p.fast[7] + begin;
  const float* b1 = p.fast[8] + begin;
  const float* c1 = p.fast[9] + begin;
  float q[kScoreBlock];
  for (int i = 0; i < kScoreBlock; ++i) {
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

inline int32_t block_cost_general(const RayPairs& p, int begin, const float m[9],
                                  float inverse_sq) {
  const float* const* f = p.fast;
  float q[kScoreBlock];
  for (int k = 0; k < kScoreBlock; ++k) {
    const int i = begin + k;
    float u[3], s[3];
    for (int r = 0; r < 3; ++r) {
      u[r] = (m[3 * r] * f[0][i] + m[3 * r + 1] * f[1][i]) + m[3 * r + 2] * f[2][i];
      s[r] = (m[r] * f[3][i] + m[3 + r] * f[4][i]) + m[6 + r] * f[5][i];
    }
    const float c = (f[3][i] * u[0] + f[4][i] * u[1]) + f[5][i] * u[2];
    float n = 0;
    for (int j = 0; j < 2; ++j) {
      const float g = (f[6 + j][i] * s[0] + f[8 + j][i] * s[1]) + f[10 + j][i] * s[2];
      const float h = (f[12 + j][i] * u[0] + f[14 + j][i] * u[1]) + f[16 + j][i] * u[2];
      n += g * g + h * h;
    }
    q[k] = c * c * inverse_sq / n;
  }
  return sum_of_costs(q);
}

}  // namespace

size_t ray_pairs_bytes(int max_matches) {
  return 19 * arena_bytes<double>(static_cast<size_t>(max_matches)) +
         18 * arena_bytes<float>(padded(max_matches));
}

RayPairs alloc_ray_pairs(Arena& arena, int max_matches, bool on_plane) {
  RayPairs pairs{};
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
  for (int k = 0; k < 3; ++k) pairs.ray[view][k][i] = ray[k];
  for (int k = 0; k < 6; ++k) pairs.jacobian[view][k][i] = jacobian(k / 2, k % 2);
}

namespace {

// |J|^2 is twice the squared angle of a pixel; lengths across the ray count, those along it do not.
double pixel_angle(const RayPairs& pairs, int i) {
  double sum = 0;
  for (int v = 0; v < 2; ++v) {
    const Vec3 ray = ray_of(pairs, v, i);
    const Mat32 J = jacobian_of(pairs, v, i);
    const double inverse_sq = 1 / ray.squaredNorm();
    for (int k = 0; k < 2; ++k) {
      const Vec3 column = J.col(k);
      const double along = column.dot(ray);
      sum += (column.squaredNorm() - along * along * inverse_sq) * inverse_sq;
    }
  }
  return std::sqrt(0.5 * sum);
}

}  // namespace

void finish_rays(RayPairs& pairs) {
  const int end = static_cast<int>(padded(pairs.num));
  for (int i = 0; i < pairs.num; ++i) {
    pairs.pixel_angle[i] = pixel_angle(pairs, i);
    for (int v = 0; v < 2; ++v) {
      const Mat32 J = jacobian_of(pairs, v, i);
      if (pairs.on_plane) {
        for (int k = 0; k < 2; ++k) {
          pairs.fast[2 * v + k][i] = static_cast<float>(pairs.ray[v][k][i]);
        }
        const double metric[3] = {J(0, 0) * J(0, 0) + J(0, 1) * J(0, 1),
                                  J(0, 0) * J(1, 0) + J(0, 1) * J(1, 1),
                                  J(1, 0) * J(1, 0) + J(1, 1) * J(1, 1)};
        for (int k = 0; k < 3; ++k) {
          pairs.fast[4 + 3 * v + k][i] = static_cast<float>(metric[k]);
        }
      } else {
        for (int k = 0; k < 3; ++k) {
          pairs.fast[3 * v + k][i] = static_cast<float>(pairs.ray[v][k][i]);
        }
        for (int k = 0; k < 6; ++k) {
          pairs.fast[6 + 6 * v + k][i] = static_cast<float>(pairs.jacobian[v][k][i]);
        }
      }
    }
  }
  for (int k = 0; k < (pairs.on_plane ? 10 : 18); ++k) {
    for (int i = pairs.num; i < end; ++i) pairs.fast[k][i] = 0;
  }
}

double sampson_sq(const RayPairs& pairs, int i, const Mat3& M) {
  Epipolar e;
  epipolar(pairs, i, M, &e);
  const double q = e.c * e.c / e.n;
  return q >= 0 ? q : kInfinity;
}

int64_t msac_cost_fast(const RayPairs& pairs, const Mat3& M, double threshold_px, int64_t bound) {
  float m[9];
  for (int k = 0; k < 9; ++k) m[k] = static_cast<float>(M(k / 3, k % 3));
  const double inverse = 1 / (threshold_px * threshold_px);
  const float inverse_sq = static_cast<float>(inverse < 1e37 ? inverse : 1e37);
  const int end = static_cast<int>(padded(pairs.num));
  // The padding costs kCostOne each.
  int64_t sum = -static_cast<int64_t>(end - pairs.num) * kCostOne;
  for (int begin = 0; begin < end; begin += kScoreBlock) {
    sum += pairs.on_plane ? block_cost_plane(pairs, begin, m, inverse_sq)
                          : block_cost_general(pairs, begin, m, inverse_sq);
    if (sum > bound) break;
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

template <int P>
double sampson_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                const Mat3& M, const Mat3 columns[P], const RobustLoss& loss,
                                double upper[P * (P + 1) / 2], double gradient[P]) {
  double D[9][P];
  for (int p = 0; p < P; ++p) {
    for (int k = 0; k < 9; ++k) D[k][p] = columns[p](k / 3, k % 3);
  }
  for (int k = 0; k < P * (P + 1) / 2; ++k) upper[k] = 0;
  for (int p = 0; p < P; ++p) gradient[p] = 0;
  const double inverse_sq = 1 / (loss.scale_px * loss.scale_px);
  double cost = 0;
  for (int k = 0; k < count; ++k) {
    const int i = indices ? indices[k] : k;
    Epipolar e;
    epipolar(pairs, i, M, &e);
    const double inverse_n = 1 / e.n;
    const double q = e.c * e.c * inverse_n * inverse_sq;
    if (!(q >= 0 && q < kLargestQ)) {
      cost += loss.kind == Loss::kTruncated ? 1.0 : kLogLargestQ;
      continue;
    }
    double weight;
    cost += robust(loss.kind, q, &weight);
    if (weight == 0) continue;
    // dr/dM_ij = (f1_i (f0_j - s g0_j) - s g1_i f0_j) / sqrt(n), s = c / n, g0 = J0 J0' M' f1,
    // g1 = J1 J1' M f0.
    const double s = e.c * inverse_n, inverse_root = std::sqrt(inverse_n);
    double u0[3], u1[3];
    for (int r = 0; r < 3; ++r) {
      double* const* J0 = pairs.jacobian[0] + 2 * r;
      double* const* J1 = pairs.jacobian[1] + 2 * r;
      const double g0 = J0[0][i] * e.s0[0] + J0[1][i] * e.s0[1];
      const double g1 = J1[0][i] * e.s1[0] + J1[1][i] * e.s1[1];
      u0[r] = (e.f0[r] - s * g0) * inverse_root;
      u1[r] = s * g1 * inverse_root;
    }
    double row[P];
    for (int p = 0; p < P; ++p) row[p] = 0;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const double entry = e.f1[a] * u0[b] - u1[a] * e.f0[b];
        for (int p = 0; p < P; ++p) row[p] += entry * D[3 * a + b][p];
      }
    }
    const double residual = e.c * inverse_root;
    int slot = 0;
    for (int p = 0; p < P; ++p) {
      const double weighted = weight * row[p];
      gradient[p] += weighted * residual;
      for (int r = p; r < P; ++r) upper[slot++] += weighted * row[r];
    }
  }
  return cost;
}

template double sampson_normal_equations<5>(const RayPairs&, const int32_t*, int, const Mat3&,
                                            const Mat3*, const RobustLoss&, double*, double*);
template double sampson_normal_equations<7>(const RayPairs&, const int32_t*, int, const Mat3&,
                                            const Mat3*, const RobustLoss&, double*, double*);

template <int P>
double transfer_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                 const Mat3& H, const Mat3* columns, const RobustLoss& loss,
                                 double upper[P * (P + 1) / 2], double gradient[P]) {
  for (int k = 0; k < P * (P + 1) / 2; ++k) upper[k] = 0;
  for (int p = 0; p < P; ++p) gradient[p] = 0;
  const double inverse_sq = 1 / (loss.scale_px * loss.scale_px);
  double cost = 0;
  for (int k = 0; k < count; ++k) {
    const int i = indices ? indices[k] : k;
    Transfer t;
    const bool valid = transfer(pairs, i, H, &t);
    const double q = valid ? weighted_sq(t) * inverse_sq : kInfinity;
    if (!(q >= 0 && q < kLargestQ)) {
      cost += loss.kind == Loss::kTruncated ? 1.0 : kLogLargestQ;
      continue;
    }
    double weight;
    cost += robust(loss.kind, q, &weight);
    if (weight == 0) continue;
    double row[2][P];
    for (int r = 0; r < 2; ++r) {
      for (int p = 0; p < P; ++p) {
        if (columns == nullptr) {
          row[r][p] = t.slope[r][p / 3] * t.f0[p % 3];
        } else {
          const Vec3 moved = columns[p] * Vec3(t.f0[0], t.f0[1], t.f0[2]);
          row[r][p] = (t.slope[r][0] * moved[0] + t.slope[r][1] * moved[1]) +
                      t.slope[r][2] * moved[2];
        }
      }
    }
    const double w00 = weight * t.weight[0], w01 = weight * t.weight[1],
                 w11 = weight * t.weight[2];
    int slot = 0;
    for (int p = 0; p < P; ++p) {
      const double first = w00 * row[0][p] + w01 * row[1][p];
      const double second = w01 * row[0][p] + w11 * row[1][p];
      gradient[p] += first * t.d[0] + second * t.d[1];
      for (int r = p; r < P; ++r) upper[slot++] += first * row[0][r] + second * row[1][r];
    }
  }
  return cost;
}

template double transfer_normal_equations<3>(const RayPairs&, const int32_t*, int, const Mat3&,
                                             const Mat3*, const RobustLoss&, double*, double*);
template double transfer_normal_equations<9>(const RayPairs&, const int32_t*, int, const Mat3&,
                                             const Mat3*, const RobustLoss&, double*, double*);

}  // namespace tv
