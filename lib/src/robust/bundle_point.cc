#include "robust/bundle_point.h"

#include <cmath>

#include "geometry/vector3.h"
#include "robust/ldlt.h"

namespace tv {
namespace {

constexpr double kMaxPointStep = 0.5;  // of a direction, radians; of a point's distance to camera 1
// A step of the pose may make a point's squared error grow to kGrowth times itself plus kGrowthSq,
// px^2; beyond that the point's error is minimised at the new pose.
constexpr double kGrowth = 2.0, kGrowthSq = 0.01;
constexpr int kMaxPolishes = 4;
constexpr int kMaxTrials = 30;         // most steps of one point at a fixed pose
constexpr double kSettledGain = 1e-6;  // a smaller relative gain ends the steps
constexpr double kFirstDamping = 1e-4, kMaxDamping = 1e8;

// The step of linear_step, shortened to where the linearisation holds: near the baseline the step
// of the depth has no bound.
void point_step(const BundleFrame& frame, const BundleMatch& match, const double step[5],
                double move[3]) {
  linear_step(frame, match, eliminate(frame, match), step, move);
  const double rho = match.point.inverse_distance;
  double X1[3];
  rotate(frame.R, match.point.direction, X1);
  for (int i = 0; i < 3; ++i) X1[i] += rho * frame.t[i];
  const double most = kMaxPointStep * length_of(X1);
  const double turn = std::sqrt(move[0] * move[0] + move[1] * move[1]);
  double share = 1.0;
  if (!(turn <= kMaxPointStep)) share = kMaxPointStep / turn;
  if (!(share * std::fabs(move[2]) <= most)) share = most / std::fabs(move[2]);
  for (int i = 0; i < 3; ++i) move[i] *= share;
}

// One damped step of the point at a fixed pose. False when the point is not determined.
bool damped_move(const BundleFrame& frame, const BundleMatch& match, double damping,
                 double move[3]) {
  const double(*T)[2] = match.from_pixel0;
  const double det = T[0][0] * T[1][1] - T[0][1] * T[1][0];
  const Elimination e = eliminate(frame, match);
  const double J[4][3] = {{T[1][1] / det, -T[0][1] / det, 0.0},
                          {-T[1][0] / det, T[0][0] / det, 0.0},
                          {e.B[0][0], e.B[0][1], e.along[0] * e.length},
                          {e.B[1][0], e.B[1][1], e.along[1] * e.length}};
  double V[6] = {}, g[3] = {};
  for (int row = 0; row < 4; ++row) {
    int slot = 0;
    for (int i = 0; i < 3; ++i) {
      g[i] += J[row][i] * match.error[row / 2][row % 2];
      for (int j = i; j < 3; ++j) V[slot++] += J[row][i] * J[row][j];
    }
  }
  const double largest = V[0] > V[3] ? V[0] : V[3];
  V[0] += damping * V[0];
  V[3] += damping * V[3];
  V[5] += damping * (V[5] + 1e-6 * largest);
  return solve_symmetric3(V, g, move);
}

// Brings one point to its least error at a fixed pose, by Levenberg-Marquardt.
void settle(const BundleProblem& problem, const BundleFrame& frame, int32_t i, BundleMatch* match) {
  double damping = kFirstDamping;
  for (int trial = 0; trial < kMaxTrials && damping < kMaxDamping; ++trial) {
    double move[3];
    if (!damped_move(frame, *match, damping, move)) return;
    BundleMatch moved;
    const double before = error_sq(*match);
    if (linearise(problem, frame, moved_point(match->point, move), i, &moved) &&
        error_sq(moved) < before) {
      const double gain = before - error_sq(moved);
      *match = moved;
      if (gain <= kSettledGain * before) return;
      damping *= 0.1;
    } else {
      damping *= 10.0;
    }
  }
}

// A start for the point from the match's rays alone: its direction from its pixel in image 0, its
// distance where that ray is nearest to the other one; or, with `far`, at infinity between the two
// rays. False where this gives no point that both cameras see.
bool begin_anew(const BundleProblem& problem, const BundleFrame& frame, bool far, int32_t index,
                BundleMatch* match) {
  Vec3 ray0, ray1;
  if (!unproject(problem.camera[0], pixel_of(problem, 0, index), &ray0, nullptr) ||
      !unproject(problem.camera[1], pixel_of(problem, 1, index), &ray1, nullptr)) {
    return false;
  }
  BundlePoint point{{ray0[0], ray0[1], ray0[2]}, 0.0};
  double turned[3];
  rotate(frame.R, point.direction, turned);
  if (far) {
    double back[3];
    for (int i = 0; i < 3; ++i) back[i] = turned[i] + ray1[i];
    for (int i = 0; i < 3; ++i) {
      point.direction[i] =
          (frame.R(0, i) * back[0] + frame.R(1, i) * back[1]) + frame.R(2, i) * back[2];
    }
    const double length = length_of(point.direction);
    for (double& x : point.direction) x /= length;
    return length > 0.0 && linearise(problem, frame, point, index, match);
  }
  // With u the ray in camera 1's frame and n = u x ray1: rho = n.n / ((ray1 x t).n).
  const Vec3 u(turned[0], turned[1], turned[2]);
  const Vec3 n = u.cross(ray1), m = ray1.cross(frame.t);
  const double across = m[0] * n[0] + m[1] * n[1] + m[2] * n[2];
  point.inverse_distance = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / across;
  return std::fabs(point.inverse_distance) <= kMaxInverseDistance &&
         linearise(problem, frame, point, index, match);
}

}  // namespace

bool try_point(const BundleProblem& problem, const BundleFrame& old_frame, const BundleFrame& frame,
               const double step[5], bool careful, const BundleMatch& match, int32_t i,
               BundleMatch* out) {
  const double before = error_sq(match);
  double move[3];
  point_step(old_frame, match, step, move);
  const bool seen = linearise(problem, frame, moved_point(match.point, move), i, out);
  const double after = error_sq(*out);
  if (seen && after <= (careful ? before : kGrowth * before + kGrowthSq)) return true;
  BundleMatch other;
  bool found = seen;
  for (int from = 0; from < 3; ++from) {
    const bool starts = from == 0 ? linearise(problem, frame, match.point, i, &other)
                                  : begin_anew(problem, frame, from == 2, i, &other);
    if (!starts) continue;
    settle(problem, frame, i, &other);
    if (!found || error_sq(other) < error_sq(*out)) *out = other;
    found = true;
    if (error_sq(*out) <= kGrowth * before + kGrowthSq) break;
  }
  return found;
}

Elimination polish_point(const BundleProblem& problem, const BundleFrame& frame, int32_t i,
                         BundleMatch* match) {
  Elimination e = eliminate(frame, *match);
  for (int polishes = 0; polishes < kMaxPolishes; ++polishes) {
    const double before = error_sq(*match);
    if (!(before - e.r * e.r > kSettledGain * before)) break;
    const double no_step[5] = {};
    double move[3];
    BundleMatch moved;
    point_step(frame, *match, no_step, move);
    if (!linearise(problem, frame, moved_point(match->point, move), i, &moved) ||
        !(error_sq(moved) < before)) {
      break;
    }
    *match = moved;
    e = eliminate(frame, moved);
  }
  return e;
}

}  // namespace tv
