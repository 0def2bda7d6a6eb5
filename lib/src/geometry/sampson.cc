#include "geometry/sampson.h"

#include <cmath>

namespace tv {
namespace {

constexpr double kInfinity = __builtin_inf();
// The score of a model is first compared with the bound after this many blocks of matches, then
// after twice and four times as many, and so on.
constexpr int kFirstBlocks = 2;

struct Epipolar {
  Vec3 f0, f1;
  Vec3 line1, line0;    // the epipolar lines M f0 and M' f1
  double c, n;          // c = f1' M f0, n = |s0|^2 + |s1|^2: the residual is c / sqrt(n)
  double s0[2], s1[2];  // s0 = J0' M' f1, s1 = J1' M f0
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

// If the cost of all matches is `bound` and the first `num` of `all` are drawn at random without
// replacement, the cost of these is at most the returned sum with a probability of 98 per cent: the
// expected sum plus two standard deviations, for which the largest is taken that costs in [0, 1]
// with this mean can have.
int64_t bound_of_first(int64_t bound, int num, int all) {
  const double mean = static_cast<double>(bound) / (static_cast<double>(all) * kCostOne);
  if (mean >= 1) return INT64_MAX;
  const double left = 1 - static_cast<double>(num) / all;
  const double slack = 2 * std::sqrt(mean * (1 - mean) * num * left);
  return static_cast<int64_t>((mean * num + slack) * kCostOne);
}

}  // namespace

double sampson_sq(const RayPairs& pairs, int i, const Mat3& M) {
  Epipolar e;
  epipolar(pairs, i, M, &e);
  const double q = e.c * e.c / e.n;
  return q >= 0 ? q : kInfinity;
}

bool sampson_slopes(const RayPairs& pairs, int i, const Mat3& M, const double curvature[2][9],
                    const double sigmas[2], SampsonSlopes* slopes, SampsonViewSlopes* of_views) {
  Epipolar e;
  epipolar(pairs, i, M, &e);
  if (!(e.n > 0)) return false;
  const double inverse = 1 / std::sqrt(e.n), share = e.c / e.n;
  slopes->residual = e.c * inverse;
  // c / sqrt(n) has the slopes (d c - c / n (s0' d s0 + s1' d s1)) / sqrt(n), s0 = J0' M' f1 and s1
  // = J1' M f0. Its slopes by the entries of M are those of the form f1' M q0 + (q1 - f1)' M f0,
  // divided by sqrt(n).
  double q0[3], q1[3], along[2][3];
  const auto set_q = [&](int r) {
    double* const* J = pairs.jacobian[0] + 2 * r;
    q0[r] = e.f0[r] - share * (J[0][i] * e.s0[0] + J[1][i] * e.s0[1]);
    J = pairs.jacobian[1] + 2 * r;
    q1[r] = e.f1[r] - share * (J[0][i] * e.s1[0] + J[1][i] * e.s1[1]);
  };
  // M' q1, M q0: sqrt(n) times the slopes by ray 0 and by ray 1, here over the rays' sigmas.
  const auto set_slopes = [&](int r) {
    along[0][r] = ((M(0, r) * q1[0] + M(1, r) * q1[1]) + M(2, r) * q1[2]) / sigmas[0];
    along[1][r] = ((M(r, 0) * q0[0] + M(r, 1) * q0[1]) + M(r, 2) * q0[2]) / sigmas[1];
    const double rest = q1[r] - e.f1[r];
    double* const by_entry = slopes->by_entry + 3 * r;
    by_entry[0] = inverse * (e.f1[r] * q0[0] + rest * e.f0[0]);
    by_entry[1] = inverse * (e.f1[r] * q0[1] + rest * e.f0[1]);
    by_entry[2] = inverse * (e.f1[r] * q0[2] + rest * e.f0[2]);
  };
  set_q(0), set_q(1), set_q(2);  // gcc does not unroll loops at -O2
  set_slopes(0), set_slopes(1), set_slopes(2);
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
  if (of_views == nullptr) return true;
  for (int v = 0; v < 2; ++v) {
    const double *const s = v == 0 ? e.s0 : e.s1, *const line = (v == 0 ? e.line0 : e.line1).data();
    of_views->by_scale[v] = slopes->residual * (s[0] * s[0] + s[1] * s[1]) / e.n;
    for (int k = 0; k < 2; ++k) {
      double slope = 0;
      for (int r = 0; r < 3; ++r) {
        slope -= pairs.jacobian[v][2 * r + k][i] * along[v][r];
        if (curvature == nullptr) continue;
        const double* const bend = curvature[v] + 3 * r + k;
        slope += share * (bend[0] * s[0] + bend[1] * s[1]) * line[r];
      }
      of_views->by_view[v][k] = inverse * slope;
    }
  }
  return true;
}

void sampson_squares(const RayPairs& pairs, int first, int count, const Mat3& M, double* squares) {
  pairs.kernels->sampson_squares(kernel_arrays(pairs).p, nullptr, first, count, pairs.on_plane,
                                 kernel_model(M).m, squares);
}

void sampson_squares(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& M,
                     double* squares) {
  pairs.kernels->sampson_squares(kernel_arrays(pairs).p, indices, 0, count, pairs.on_plane,
                                 kernel_model(M).m, squares);
}

void pose_squares(const RayPairs& pairs, int first, int count, const Pose& pose, double scale_px,
                  double* squares) {
  const KernelArrays rays = kernel_arrays(pairs);
  const double* arrays[19];
  for (int k = 0; k < 18; ++k) arrays[k] = rays.p[k];
  arrays[18] = pairs.pixel_angle;
  double entries[21];
  write_matrix(essential_from_pose(pose), entries);
  write_matrix(pose.R, entries + 9);
  for (int k = 0; k < 3; ++k) entries[18 + k] = pose.t[k];
  pairs.kernels->pose_squares(arrays, first, count, pairs.on_plane, entries, scale_px, squares);
}

int64_t msac_cost_fast(const RayPairs& pairs, const Mat3& M, double threshold_px, int64_t bound) {
  float m[9];
  for (int k = 0; k < 9; ++k) m[k] = static_cast<float>(M.data()[k]);
  const double inverse = 1 / (threshold_px * threshold_px);
  const float inverse_sq = static_cast<float>(inverse < 1e37 ? inverse : 1e37);
  const int num_blocks = static_cast<int>(padded_to_blocks(pairs.num)) / kScoreBlock;
  // The kernel gives each entry of the padding the cost kCostOne.
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

}  // namespace tv
