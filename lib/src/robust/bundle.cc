// Levenberg-Marquardt on the pose with the points eliminated (B. Triggs, P. McLauchlan, R. Hartley,
// A. Fitzgibbon, "Bundle adjustment - a modern synthesis", 2000). A match of two views leaves one
// residual when its point is gone, so the Schur complement is formed from that one, without the
// products J'J and their cancellation (N. Demmel et al., "Square root bundle adjustment", CVPR
// 2021, in the smallest case). Derivation: docs/algorithms/bundle.md; tests:
// test/unit/test_bundle.cc, test_bundle_ceres.cc.
#include "robust/bundle.h"

#include <cmath>
#include <limits>

#include "base/math.h"
#include "geometry/triangulation.h"
#include "robust/refine.h"

namespace tv {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMaxFloat = std::numeric_limits<float>::max();
constexpr double kMaxPixel = 1e6;
constexpr double kMaxInverseDistance = 1e6;
constexpr double kMaxPointStep = 0.5;  // of a direction, radians; of a point's distance to camera 1
constexpr double kGrowth = 2.0, kGrowthSq = 0.01;  // of a point's squared error in a step: no worry
constexpr int kMaxPolishes = 4;
constexpr int kMaxTrials = 30;          // of a point's own steps
constexpr double kSettledGain = 1e-6;   // of them that ends them
constexpr double kNearChange = 0.1;     // of the cost in a step, below which Newton takes over
constexpr double kSmallChange = 1e-10;  // of the cost: converged
constexpr double kNoErrorSq = 1e-20;    // px^2 a match: nothing is left to lower
constexpr double kFirstDamping = 1e-4, kMinDamping = 1e-10, kMaxDamping = 1e8;
constexpr double kHonestDamping = 1.0;  // above it, a small change says little

double dot3(const double a[3], const double b[3]) {
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}

double dot3(const double a[3], const Vec3& b) { return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]; }

void rotate(const Mat3& R, const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = (R(i, 0) * v[0] + R(i, 1) * v[1]) + R(i, 2) * v[2];
}

double length3(const double v[3]) { return std::sqrt(dot3(v, v)); }

bool is_finite(double x) { return x - x == 0.0; }

// log(1 + x) to the last bit but one for small x, too (W. Kahan).
double log_one_plus(double x) {
  const double u = 1.0 + x;
  return u == 1.0 ? x : log(u) * (x / (u - 1.0));
}

// rho, rho' and rho''.
struct LossAt {
  double value, weight, bend;
};

LossAt loss_at(const tv_bundle_options& options, double s) {
  const double c = options.loss_scale_px, c_sq = c * c;
  if (options.loss == TV_LOSS_HUBER && s > c_sq) {
    const double root = std::sqrt(s);
    const double weight = c / root;
    return {2.0 * c * root - c_sq, weight, -0.5 * weight / s};
  }
  if (options.loss == TV_LOSS_CAUCHY) {
    const double inverse = 1.0 / (1.0 + s / c_sq);
    return {c_sq * log_one_plus(s / c_sq), inverse, -inverse * inverse / c_sq};
  }
  return {s, 1.0, 0.0};
}

double error_sq(const BundleMatch& match) {
  const double(*e)[2] = match.error;
  return (e[0][0] * e[0][0] + e[0][1] * e[0][1]) + (e[1][0] * e[1][0] + e[1][1] * e[1][1]);
}

// What one pass over the matches adds up.
struct Sums {
  double cost, sum_sq;
  double gradient[5];
  double upper[15];   // of sum rho' a a': positive semidefinite
  double newton[15];  // of sum (rho' + 2 rho'' r^2) a a': the loss's own curvature
};

void add_match(const tv_bundle_options& options, const BundleMatch& match, const Elimination& e,
               Sums* sums) {
  const double s = error_sq(match);
  sums->sum_sq += s;
  sums->cost += loss_at(options, s).value;
  const double r_sq = e.r * e.r;
  const LossAt loss = loss_at(options, r_sq);
  const double bent = loss.weight + 2.0 * loss.bend * r_sq;
  int slot = 0;
  for (int i = 0; i < 5; ++i) {
    sums->gradient[i] += loss.weight * e.r * e.a[i];
    for (int j = i; j < 5; ++j, ++slot) {
      const double product = e.a[i] * e.a[j];
      sums->upper[slot] += loss.weight * product;
      sums->newton[slot] += bent * product;
    }
  }
}

// The pose's step. The loss's own curvature (Newton) makes the last steps quadratic; far from the
// end, or where it leaves the matrix indefinite, that of reweighted least squares, which never
// overshoots the loss.
bool solve_step(const Sums& sums, double damping, bool newton, double step[5]) {
  double largest = 0.0;
  for (int i = 0, slot = 0; i < 5; slot += 5 - i, ++i) {
    if (sums.upper[slot] > largest) largest = sums.upper[slot];
  }
  const double* matrices[2] = {sums.newton, sums.upper};
  for (int m = newton ? 0 : 1; m < 2; ++m) {
    double damped[15];
    for (int i = 0; i < 15; ++i) damped[i] = matrices[m][i];
    for (int i = 0, slot = 0; i < 5; slot += 5 - i, ++i) {
      damped[slot] += damping * (sums.upper[slot] + 1e-9 * largest);
    }
    if (solve_damped(5, damped, sums.gradient, 0.0, step)) return true;
  }
  return false;
}

Pose stepped(const Pose& pose, const BundleFrame& frame, const double step[5]) {
  Pose result;
  result.R = orthonormalised(rotation_step(Vec3(step[0], step[1], step[2])) * pose.R);
  result.t = (pose.t + step[3] * frame.b1 + step[4] * frame.b2).normalized();
  return result;
}

// How a point is to move when the pose moves by `step`: along the two of sphere_basis, and in
// inverse distance. The least squares of the linearised match; given y, the residual of image 0,
// min |y|^2 + (q + k.y)^2 is at y = -k q / (1 + |k|^2).
void linear_step(const BundleFrame& frame, const BundleMatch& match, const Elimination& e,
                 const double step[5], double move[3]) {
  const double rho = match.point.inverse_distance;
  double Rd[3], moved[3], g[2];
  rotate(frame.R, match.point.direction, Rd);
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const double slide = step[3] * frame.b1[i] + step[4] * frame.b2[i];
    moved[i] = (step[j] * Rd[k] - step[k] * Rd[j]) + rho * slide;
  }
  for (int i = 0; i < 2; ++i) g[i] = match.error[1][i] + dot3(match.jacobian1[i], moved);
  const double* e0 = match.error[0];
  const double q = (e.along[0] * g[1] - e.along[1] * g[0]) - (e.k[0] * e0[0] + e.k[1] * e0[1]);
  const double share = -q / (1.0 + (e.k[0] * e.k[0] + e.k[1] * e.k[1]));
  const double y[2] = {share * e.k[0] - e0[0], share * e.k[1] - e0[1]};
  for (int i = 0; i < 2; ++i) {
    move[i] = match.from_pixel0[i][0] * y[0] + match.from_pixel0[i][1] * y[1];
  }
  double left = 0.0;
  for (int i = 0; i < 2; ++i) {
    left += e.along[i] * (g[i] + (e.B[i][0] * move[0] + e.B[i][1] * move[1]));
  }
  move[2] = e.length > 0.0 ? -left / e.length : 0.0;
}

// The same, kept to where linearising says something: near the baseline the depth's own step has no
// bound.
void point_step(const BundleFrame& frame, const BundleMatch& match, const double step[5],
                double move[3]) {
  linear_step(frame, match, eliminate(frame, match), step, move);
  const double rho = match.point.inverse_distance;
  double X1[3];
  rotate(frame.R, match.point.direction, X1);
  for (int i = 0; i < 3; ++i) X1[i] += rho * frame.t[i];
  const double most = kMaxPointStep * length3(X1);
  const double turn = std::sqrt(move[0] * move[0] + move[1] * move[1]);
  double share = 1.0;
  if (!(turn <= kMaxPointStep)) share = kMaxPointStep / turn;
  if (!(share * std::fabs(move[2]) <= most)) share = most / std::fabs(move[2]);
  for (int i = 0; i < 3; ++i) move[i] *= share;
}

// The step is one of the homogeneous point (direction, inverse distance).
BundlePoint moved_point(const BundlePoint& point, const double move[3]) {
  double e1[3], e2[3];
  sphere_basis(point.direction, e1, e2);
  BundlePoint result;
  for (int i = 0; i < 3; ++i) {
    result.direction[i] = point.direction[i] + (move[0] * e1[i] + move[1] * e2[i]);
  }
  const double scale = 1.0 / length3(result.direction);
  for (int i = 0; i < 3; ++i) result.direction[i] *= scale;
  result.inverse_distance = (point.inverse_distance + move[2]) * scale;
  return result;
}

// The whole of one adjustment.
struct Adjustment {
  const BundleProblem& problem;
  int num;         // points that take part
  int32_t* index;  // which
  BundleMatch* now;
  BundleMatch* next;
};

Vec2 pixel_of(const BundleProblem& problem, int view, int32_t i) {
  return Vec2(problem.pixels[view][2 * i], problem.pixels[view][2 * i + 1]);
}

bool is_usable(const Vec2& pixel) {
  return std::fabs(pixel[0]) <= kMaxPixel && std::fabs(pixel[1]) <= kMaxPixel;
}

bool read_point(const tv_point& point, double baseline, BundlePoint* out) {
  if (point.status != TV_POINT_OK && point.status != TV_POINT_INFINITE) return false;
  double largest = 0.0;
  for (double x : point.position) {
    if (!is_finite(x)) return false;
    if (std::fabs(x) > largest) largest = std::fabs(x);
  }
  if (!(largest > 0.0)) return false;
  double scaled[3];
  for (int i = 0; i < 3; ++i) scaled[i] = point.position[i] / largest;
  const double length = length3(scaled);
  for (int i = 0; i < 3; ++i) out->direction[i] = scaled[i] / length;
  out->inverse_distance = point.status == TV_POINT_INFINITE ? 0.0 : baseline / largest / length;
  return out->inverse_distance <= kMaxInverseDistance;
}

void gather(Adjustment& adjustment, const BundleFrame& frame, double baseline,
            const tv_point* points) {
  const BundleProblem& problem = adjustment.problem;
  for (int32_t i = 0; i < problem.num; ++i) {
    const Vec2 pixel0 = pixel_of(problem, 0, i), pixel1 = pixel_of(problem, 1, i);
    BundlePoint point;
    if (is_usable(pixel0) && is_usable(pixel1) && read_point(points[i], baseline, &point) &&
        linearise(problem.camera, frame, point, pixel0, pixel1, &adjustment.now[adjustment.num])) {
      adjustment.index[adjustment.num++] = i;
    }
  }
}

Sums sum_up(const Adjustment& adjustment, const BundleFrame& frame) {
  Sums sums{};
  for (int k = 0; k < adjustment.num; ++k) {
    const BundleMatch& match = adjustment.now[k];
    add_match(adjustment.problem.options, match, eliminate(frame, match), &sums);
  }
  return sums;
}

// Solves V x = -g for a symmetric positive definite V (xx xy xz yy yz zz), by L D L'.
bool solve3(const double V[6], const double g[3], double x[3]) {
  if (!(V[0] > 0.0)) return false;
  const double l10 = V[1] / V[0], l20 = V[2] / V[0];
  const double d1 = V[3] - l10 * V[1];
  const double v21 = V[4] - l10 * V[2];
  if (!(d1 > 0.0)) return false;
  const double l21 = v21 / d1;
  const double d2 = (V[5] - l20 * V[2]) - l21 * v21;
  if (!(d2 > 0.0)) return false;
  const double y1 = -g[1] + l10 * g[0];
  const double y2 = (-g[2] + l20 * g[0]) - l21 * y1;
  x[2] = y2 / d2;
  x[1] = y1 / d1 - l21 * x[2];
  x[0] = (-g[0] / V[0] - l10 * x[1]) - l20 * x[2];
  return true;
}

// The damped step of a point alone.
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
  return solve3(V, g, move);
}

// Takes one point to its least error at a fixed pose, by Levenberg-Marquardt.
void settle(const BundleProblem& problem, const BundleFrame& frame, const Vec2& pixel0,
            const Vec2& pixel1, BundleMatch* match) {
  double damping = kFirstDamping;
  for (int trial = 0; trial < kMaxTrials && damping < kMaxDamping; ++trial) {
    double move[3];
    if (!damped_move(frame, *match, damping, move)) return;
    BundleMatch moved;
    const double before = error_sq(*match);
    if (linearise(problem.camera, frame, moved_point(match->point, move), pixel0, pixel1, &moved) &&
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

// The point's direction from its pixel in image 0, its distance where that ray comes nearest to the
// other; or `far`, at infinity between the two rays. False where this says nothing.
bool begin_anew(const BundleProblem& problem, const BundleFrame& frame, bool far,
                const Vec2& pixel0, const Vec2& pixel1, BundleMatch* match) {
  Vec3 ray0, ray1;
  if (!unproject(problem.camera[0], pixel0, &ray0, nullptr) ||
      !unproject(problem.camera[1], pixel1, &ray1, nullptr)) {
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
    const double length = length3(point.direction);
    for (double& x : point.direction) x /= length;
    return length > 0.0 && linearise(problem.camera, frame, point, pixel0, pixel1, match);
  }
  // With u the ray in camera 1's frame and n = u x ray1: rho = n.n / ((ray1 x t).n).
  const Vec3 u(turned[0], turned[1], turned[2]);
  const Vec3 n = u.cross(ray1), m = ray1.cross(frame.t);
  const double across = m[0] * n[0] + m[1] * n[1] + m[2] * n[2];
  point.inverse_distance = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / across;
  return std::fabs(point.inverse_distance) <= kMaxInverseDistance &&
         linearise(problem.camera, frame, point, pixel0, pixel1, match);
}

// One point's trial at a new pose. Its linearised answer to the pose's step is nearly always good.
// Where it is not, or a camera loses sight of the point, it settles anew: from where it was, and
// should that not help, from its rays. `careful`: any growth of the error is no good.
bool try_point(const BundleProblem& problem, const BundleFrame& old_frame, const BundleFrame& frame,
               const double step[5], bool careful, const BundleMatch& match, int32_t i,
               BundleMatch* out) {
  const Vec2 pixel0 = pixel_of(problem, 0, i), pixel1 = pixel_of(problem, 1, i);
  const double before = error_sq(match);
  double move[3];
  point_step(old_frame, match, step, move);
  const bool seen =
      linearise(problem.camera, frame, moved_point(match.point, move), pixel0, pixel1, out);
  const double after = error_sq(*out);
  if (seen && after <= (careful ? before : kGrowth * before + kGrowthSq)) return true;
  BundleMatch other;
  bool found = seen;
  for (int from = 0; from < 3; ++from) {
    const bool starts = from == 0
                            ? linearise(problem.camera, frame, match.point, pixel0, pixel1, &other)
                            : begin_anew(problem, frame, from == 2, pixel0, pixel1, &other);
    if (!starts) continue;
    settle(problem, frame, pixel0, pixel1, &other);
    if (!found || error_sq(other) < error_sq(*out)) *out = other;
    found = true;
    if (error_sq(*out) <= kGrowth * before + kGrowthSq) break;
  }
  return found;
}

// What is left for the point to gain is about |error|^2 - r^2: next to nothing for a good match,
// for the projections are nearly linear over its few pixels. A wrong match's point goes on until it
// is there, lest all others wait for it.
Elimination polish(const BundleProblem& problem, const BundleFrame& frame, int32_t i,
                   BundleMatch* match) {
  Elimination e = eliminate(frame, *match);
  for (int polishes = 0; polishes < kMaxPolishes; ++polishes) {
    const double before = error_sq(*match);
    if (!(before - e.r * e.r > kSettledGain * before)) break;
    const double no_step[5] = {};
    double move[3];
    BundleMatch moved;
    point_step(frame, *match, no_step, move);
    if (!linearise(problem.camera, frame, moved_point(match->point, move), pixel_of(problem, 0, i),
                   pixel_of(problem, 1, i), &moved) ||
        !(error_sq(moved) < before)) {
      break;
    }
    *match = moved;
    e = eliminate(frame, moved);
  }
  return e;
}

// False where a camera loses sight of a point.
bool try_step(Adjustment& adjustment, const BundleFrame& old_frame, const BundleFrame& frame,
              const double step[5], bool careful, Sums* sums) {
  const BundleProblem& problem = adjustment.problem;
  *sums = Sums{};
  for (int k = 0; k < adjustment.num; ++k) {
    const int32_t i = adjustment.index[k];
    BundleMatch* match = &adjustment.next[k];
    if (!try_point(problem, old_frame, frame, step, careful, adjustment.now[k], i, match)) {
      return false;
    }
    const Elimination e = polish(problem, frame, i, match);
    add_match(problem.options, *match, e, sums);
  }
  return is_finite(sums->cost);
}

void minimise(Adjustment& adjustment, BundleFrame* frame, Sums* sums, BundleOutcome* out) {
  const tv_bundle_options& options = adjustment.problem.options;
  const double no_error = kNoErrorSq * adjustment.num;
  double damping = kFirstDamping;
  bool careful = options.hold_pose != 0, newton = false;
  while (out->num_iterations < options.max_iterations) {
    out->converged = sums->sum_sq <= no_error;
    double step[5] = {};
    if (out->converged || (options.hold_pose == 0 && !solve_step(*sums, damping, newton, step)))
      break;
    ++out->num_iterations;
    const Pose pose = options.hold_pose != 0 ? out->pose : stepped(out->pose, *frame, step);
    const BundleFrame new_frame = bundle_frame(pose);
    Sums new_sums;
    const bool seen = try_step(adjustment, *frame, new_frame, step, careful, &new_sums);
    const double change = std::fabs(new_sums.cost - sums->cost);
    const bool small = seen && change <= kSmallChange * sums->cost && damping <= kHonestDamping;
    if (seen && new_sums.cost < sums->cost) {
      BundleMatch* before = adjustment.now;
      adjustment.now = adjustment.next;
      adjustment.next = before;
      newton = change < kNearChange * sums->cost;
      out->pose = pose;
      out->moved = options.hold_pose == 0;
      *frame = new_frame;
      *sums = new_sums;
      damping = damping * 0.1 > kMinDamping ? damping * 0.1 : kMinDamping;
      careful = options.hold_pose != 0;
    } else {
      damping *= options.hold_pose != 0 ? kInfinity : 10.0;
      careful = damping > kHonestDamping;
      newton = false;
    }
    // No step lowers the cost, however short: a minimum, too, as far as doubles go.
    out->converged = small || damping > kMaxDamping;
    if (out->converged) break;
  }
}

// The covariance of the minimum (P. Huber, "Robust statistics", 1981, 7.6, his third): with psi =
// rho' r and p = 5 parameters,
//     K^2 (sum psi^2 / (n - p)) / (sum psi' / n) H^-1,  H = sum psi' a a',
//     K = 1 + p / n var(psi') / mean(psi')^2;
// the usual sigma^2 (sum a a')^-1 for least squares. With psi' inside of H, the wrong matches, for
// which it is about 0, tell nothing, wherever they lie.
void measure_covariance(const Adjustment& adjustment, const BundleFrame& frame, const Sums& sums,
                        BundleOutcome* out) {
  const int n = adjustment.num;
  double inverse[25];
  if (n <= 5 || !invert_symmetric(5, sums.newton, inverse)) return;
  double psi_sq = 0.0, slope = 0.0, slope_sq = 0.0;
  for (int k = 0; k < n; ++k) {
    const double r = eliminate(frame, adjustment.now[k]).r;
    const LossAt loss = loss_at(adjustment.problem.options, r * r);
    const double bent = loss.weight + 2.0 * loss.bend * (r * r);
    psi_sq += loss.weight * loss.weight * (r * r);
    slope += bent;
    slope_sq += bent * bent;
  }
  if (!(slope > 0.0)) return;
  const double K = 1.0 + 5.0 / n * (n * slope_sq / (slope * slope) - 1.0);
  const double variance = K * K * (psi_sq / (n - 5)) * (n / slope);
  for (int i = 0; i < 25; ++i) {
    out->covariance[i] = variance * inverse[i];
    if (!is_finite(out->covariance[i])) return;
  }
  out->noise_px = std::sqrt(variance * (n / slope));
  out->has_covariance = true;
}

void write_point(const BundleFrame& frame, const BundleMatch& match, double baseline,
                 tv_point* out) {
  const double* d = match.point.direction;
  const double rho = match.point.inverse_distance;
  double Rd[3], X1[3], across[3];
  rotate(frame.R, d, Rd);
  for (int i = 0; i < 3; ++i) X1[i] = Rd[i] + rho * frame.t[i];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    across[i] = Rd[j] * X1[k] - Rd[k] * X1[j];
  }
  const double sine_sq = dot3(across, across);
  // As tv_triangulate says it: rays that are parallel as far as a double can tell.
  bool infinite = !(sine_sq > kParallelSine * kParallelSine * dot3(X1, X1)) && dot3(Rd, X1) > 0.0;
  double position[3];
  for (int i = 0; i < 3; ++i) {
    position[i] = d[i] * (baseline / rho);
    if (!is_finite(position[i])) infinite = true;
  }
  *out = tv_point{};
  for (int i = 0; i < 3; ++i) out->position[i] = infinite ? d[i] : position[i];
  out->status = infinite ? TV_POINT_INFINITE : rho > 0.0 ? TV_POINT_OK : TV_POINT_BEHIND;
  out->angle_rad = static_cast<float>(atan2(std::sqrt(sine_sq), dot3(Rd, X1)));
  const double error = std::sqrt(0.5 * error_sq(match));
  out->error_px = static_cast<float>(error < kMaxFloat ? error : kMaxFloat);
}

}  // namespace

BundleFrame bundle_frame(const Pose& pose) {
  BundleFrame frame;
  frame.R = pose.R;
  frame.t = pose.t;
  tangent_basis(pose.t, &frame.b1, &frame.b2);
  return frame;
}

// T. Duff et al., "Building an orthonormal basis, revisited", JCGT 2017.
void sphere_basis(const double d[3], double e1[3], double e2[3]) {
  const double sign = d[2] < 0.0 ? -1.0 : 1.0;
  const double a = -1.0 / (sign + d[2]);
  const double b = d[0] * d[1] * a;
  e1[0] = 1.0 + sign * d[0] * d[0] * a;
  e1[1] = sign * b;
  e1[2] = -sign * d[0];
  e2[0] = b;
  e2[1] = sign + d[1] * d[1] * a;
  e2[2] = -d[1];
}

bool linearise(const Camera cameras[2], const BundleFrame& frame, const BundlePoint& point,
               const Vec2& pixel0, const Vec2& pixel1, BundleMatch* match) {
  const double* d = point.direction;
  double X1[3];
  rotate(frame.R, d, X1);
  for (int i = 0; i < 3; ++i) X1[i] += point.inverse_distance * frame.t[i];
  Vec2 seen0, seen1;
  Mat23 J0, J1;
  if (!project(cameras[0], Vec3(d[0], d[1], d[2]), &seen0, &J0) ||
      !project(cameras[1], Vec3(X1[0], X1[1], X1[2]), &seen1, &J1)) {
    return false;
  }
  double e1[3], e2[3], A[2][2];
  sphere_basis(d, e1, e2);
  for (int i = 0; i < 2; ++i) {
    const double row[3] = {J0(i, 0), J0(i, 1), J0(i, 2)};
    A[i][0] = dot3(row, e1);
    A[i][1] = dot3(row, e2);
  }
  const double inverse = 1.0 / (A[0][0] * A[1][1] - A[0][1] * A[1][0]);
  if (!is_finite(inverse)) return false;
  match->point = point;
  match->from_pixel0[0][0] = A[1][1] * inverse;
  match->from_pixel0[0][1] = -A[0][1] * inverse;
  match->from_pixel0[1][0] = -A[1][0] * inverse;
  match->from_pixel0[1][1] = A[0][0] * inverse;
  for (int i = 0; i < 2; ++i) {
    match->error[0][i] = seen0[i] - pixel0[i];
    match->error[1][i] = seen1[i] - pixel1[i];
    for (int j = 0; j < 3; ++j) match->jacobian1[i][j] = J1(i, j);
  }
  return true;
}

Elimination eliminate(const BundleFrame& frame, const BundleMatch& match) {
  Elimination e;
  const double* d = match.point.direction;
  double e1[3], e2[3], Re1[3], Re2[3], Rd[3];
  sphere_basis(d, e1, e2);
  rotate(frame.R, d, Rd);
  rotate(frame.R, e1, Re1);
  rotate(frame.R, e2, Re2);
  double c[2];
  for (int i = 0; i < 2; ++i) {
    const double* row = match.jacobian1[i];
    e.B[i][0] = dot3(row, Re1);
    e.B[i][1] = dot3(row, Re2);
    c[i] = dot3(row, frame.t);
  }
  e.length = std::sqrt(c[0] * c[0] + c[1] * c[1]);
  if (!(e.length > 0.0)) {  // on the baseline: any direction of the error is one along it
    e.r = e.along[0] = e.along[1] = e.k[0] = e.k[1] = 0.0;
    for (double& a : e.a) a = 0.0;
    return e;
  }
  e.along[0] = c[0] / e.length;
  e.along[1] = c[1] / e.length;
  // What moves across `along` (unit n) does not depend on the depth: n.e1 + m.step, m = B'n; with
  // image 0's residual y = e0 + A step that is q + k.y, k = A^-T m and q = n.e1 - k.e0. Its least
  // square together with |y|^2 is q^2 / (1 + |k|^2).
  const double n[2] = {-e.along[1], e.along[0]};
  const double m[2] = {n[0] * e.B[0][0] + n[1] * e.B[1][0], n[0] * e.B[0][1] + n[1] * e.B[1][1]};
  for (int i = 0; i < 2; ++i) {
    e.k[i] = m[0] * match.from_pixel0[0][i] + m[1] * match.from_pixel0[1][i];
  }
  const double scale = 1.0 / std::sqrt(1.0 + (e.k[0] * e.k[0] + e.k[1] * e.k[1]));
  const double* e0 = match.error[0];
  const double* e1_px = match.error[1];
  e.r = scale * ((n[0] * e1_px[0] + n[1] * e1_px[1]) - (e.k[0] * e0[0] + e.k[1] * e0[1]));
  double j[3];
  for (int i = 0; i < 3; ++i) {
    j[i] = scale * (n[0] * match.jacobian1[0][i] + n[1] * match.jacobian1[1][i]);
  }
  for (int i = 0; i < 3; ++i) {
    const int u = (i + 1) % 3, v = (i + 2) % 3;
    e.a[i] = Rd[u] * j[v] - Rd[v] * j[u];
  }
  e.a[3] = match.point.inverse_distance * dot3(j, frame.b1);
  e.a[4] = match.point.inverse_distance * dot3(j, frame.b2);
  return e;
}

bool point_covariance(const Camera cameras[2], const BundleFrame& frame, double baseline,
                      const double* pose_covariance, double noise_px, const tv_point& point,
                      double covariance[9]) {
  for (int i = 0; i < 9; ++i) covariance[i] = 0.0;
  BundlePoint at;
  BundleMatch match;
  if (point.status != TV_POINT_OK || !read_point(point, baseline, &at) ||
      !linearise(cameras, frame, at, Vec2(0, 0), Vec2(0, 0), &match)) {
    return false;
  }
  const Elimination e = eliminate(frame, match);
  if (!(e.length > 0.0)) return false;
  // Columns: how (direction step, inverse distance) answers to a pixel of each of the four
  // coordinates' noise, then to the pose's five parameters.
  double answer[3][9];
  for (int c = 0; c < 9; ++c) {
    double noise[4] = {}, parameter[5] = {};
    (c < 4 ? noise[c] : parameter[c - 4]) = 1.0;
    double move[3];
    match.error[0][0] = -noise[0];
    match.error[0][1] = -noise[1];
    match.error[1][0] = -noise[2];
    match.error[1][1] = -noise[3];
    linear_step(frame, match, e, parameter, move);
    for (int r = 0; r < 3; ++r) answer[r][c] = move[r];
  }
  double parameters[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      double sum = 0.0;
      for (int c = 0; c < 4; ++c) sum += answer[i][c] * answer[j][c];
      sum *= noise_px * noise_px;
      for (int u = 0; pose_covariance != nullptr && u < 5; ++u) {
        for (int v = 0; v < 5; ++v) {
          sum += answer[i][4 + u] * pose_covariance[5 * u + v] * answer[j][4 + v];
        }
      }
      parameters[i][j] = parameters[j][i] = sum;
    }
  }
  // position = baseline direction / rho.
  const double* d = at.direction;
  const double distance = baseline / at.inverse_distance;
  double basis[3][3];
  sphere_basis(d, basis[0], basis[1]);
  for (int i = 0; i < 3; ++i) {
    basis[0][i] *= distance;
    basis[1][i] *= distance;
    basis[2][i] = -d[i] * (distance / at.inverse_distance);
  }
  double result[9];
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      double sum = 0.0;
      for (int u = 0; u < 3; ++u) {
        for (int v = 0; v < 3; ++v) sum += basis[u][i] * parameters[u][v] * basis[v][j];
      }
      if (!is_finite(sum)) return false;
      result[3 * i + j] = result[3 * j + i] = sum;
    }
  }
  for (int i = 0; i < 9; ++i) covariance[i] = result[i];
  return true;
}

size_t bundle_scratch_bytes(int max_points) {
  const size_t n = static_cast<size_t>(max_points);
  return arena_bytes<int32_t>(n) + 2 * arena_bytes<BundleMatch>(n);
}

void adjust_two_view(const BundleProblem& problem, const Pose& start, double baseline, Arena& arena,
                     tv_point* points, BundleOutcome* outcome) {
  const size_t n = static_cast<size_t>(problem.num);
  ArenaScope scope(arena);
  int32_t* index = arena_alloc<int32_t>(arena, n);
  BundleMatch* now = arena_alloc<BundleMatch>(arena, n);
  Adjustment adjustment{problem, 0, index, now, arena_alloc<BundleMatch>(arena, n)};
  *outcome = BundleOutcome{};
  outcome->pose = start;
  BundleFrame frame = bundle_frame(start);
  gather(adjustment, frame, baseline, points);
  outcome->num_points = adjustment.num;
  Sums sums = sum_up(adjustment, frame);
  outcome->initial_cost = sums.cost;
  outcome->initial_sum_sq = sums.sum_sq;
  minimise(adjustment, &frame, &sums, outcome);
  outcome->final_cost = sums.cost;
  outcome->final_sum_sq = sums.sum_sq;
  if (problem.options.hold_pose == 0) measure_covariance(adjustment, frame, sums, outcome);
  for (int k = 0; k < adjustment.num; ++k) {
    write_point(frame, adjustment.now[k], baseline, &points[adjustment.index[k]]);
  }
}

}  // namespace tv
