// Levenberg-Marquardt on the pose with the points eliminated (B. Triggs, P. McLauchlan, R. Hartley,
// A. Fitzgibbon, "Bundle adjustment - a modern synthesis", 2000). A match of two views leaves one
// residual when its point is eliminated, so the Schur complement is formed from this residual,
// without the products J'J and their cancellation (N. Demmel et al., "Square root bundle
// adjustment", CVPR 2021, in the smallest case).
#include "robust/bundle.h"

#include <cmath>
#include <limits>

#include "base/math.h"
#include "geometry/vector3.h"
#include "robust/bundle_point.h"
#include "robust/ldlt.h"
#include "robust/models.h"
#include "triangulation/triangulation.h"

namespace tv {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kMaxFloat = std::numeric_limits<float>::max();
constexpr double kMaxPixel = 1e6;
constexpr double kNearChange = 0.1;     // below this relative change of the cost, Newton takes over
constexpr double kSmallChange = 1e-10;  // below this relative change of the cost: converged
constexpr double kNoErrorSq = 1e-20;    // px^2 for each match; smaller errors count as none
constexpr double kFirstDamping = 1e-4, kMinDamping = 1e-10, kMaxDamping = 1e8;
// With more damping, a small change of the cost is no evidence for a minimum.
constexpr double kHonestDamping = 1.0;

// log(1 + x) with an error below 2 ulp for small x, too (W. Kahan).
double log_one_plus(double x) {
  const double u = 1.0 + x;
  return u == 1.0 ? x : log(u) * (x / (u - 1.0));
}

// The loss at the squared error s, and its first and second derivatives: rho, rho', rho''.
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

// The sums over the matches that one pass computes.
struct Sums {
  double cost, sum_sq;
  double gradient[5];
  // Upper triangles of two approximations of the Hessian.
  double upper[15];   // sum rho' a a': positive semidefinite
  double newton[15];  // sum (rho' + 2 rho'' r^2) a a': with the loss's second derivative
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

// The pose's step. With `newton`, the loss's own curvature makes the last steps quadratic. Far from
// the minimum, or where that matrix is indefinite, the step is that of reweighted least squares,
// which never overshoots the loss.
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

// The points and the buffers of one run of adjust_two_view.
struct Adjustment {
  const BundleProblem& problem;
  int num;         // number of points that take part
  int32_t* index;  // indices of the points that take part
  BundleMatch* now;
  BundleMatch* next;
};

bool is_usable(const Vec2& pixel) {
  return std::fabs(pixel[0]) <= kMaxPixel && std::fabs(pixel[1]) <= kMaxPixel;
}

void gather(Adjustment& adjustment, const BundleFrame& frame, double baseline,
            const tv_point* points) {
  const BundleProblem& problem = adjustment.problem;
  for (int32_t i = 0; i < problem.num; ++i) {
    const Vec2 pixel0 = pixel_of(problem, 0, i), pixel1 = pixel_of(problem, 1, i);
    BundlePoint point;
    if (is_usable(pixel0) && is_usable(pixel1) && read_point(points[i], baseline, &point) &&
        linearise(problem, frame, point, i, &adjustment.now[adjustment.num])) {
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

// The sums at the new pose, with all points moved along. False where a camera does not see one of
// them any more.
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
    const Elimination e = polish_point(problem, frame, i, match);
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
    const Pose pose = options.hold_pose != 0 ? out->pose : PoseModel{out->pose}.stepped(step).pose;
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
    // That no step lowers the cost, however short, also shows a minimum at the precision of
    // doubles.
    out->converged = small || damping > kMaxDamping;
    if (out->converged) break;
  }
}

// The covariance of the minimum (P. Huber, "Robust statistics", 1981, 7.6, his third): with psi =
// rho' r and p = 5 parameters,
//     K^2 (sum psi^2 / (n - p)) / (sum psi' / n) H^-1,  H = sum psi' a a',
//     K = 1 + p / n var(psi') / mean(psi')^2;
// for least squares it is the usual sigma^2 (sum a a')^-1. Wrong matches have a psi' of about 0, so
// with psi' inside H they add no information, wherever they lie.
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

// sigmas: those of the match, by which its errors become pixels of the images.
void write_point(const BundleFrame& frame, const BundleMatch& match, const double sigmas[2],
                 double baseline, tv_point* out) {
  const double* d = match.point.direction;
  const double rho = match.point.inverse_distance;
  double Rd[3], X1[3], across[3];
  rotate(frame.R, d, Rd);
  for (int i = 0; i < 3; ++i) X1[i] = Rd[i] + rho * frame.t[i];
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    across[i] = Rd[j] * X1[k] - Rd[k] * X1[j];
  }
  const double sine_sq = dot(across, across);
  // The rule of tv_triangulate: a point is infinite where its rays are parallel within rounding.
  bool infinite = !(sine_sq > kParallelSine * kParallelSine * dot(X1, X1)) && dot(Rd, X1) > 0.0;
  double position[3];
  for (int i = 0; i < 3; ++i) {
    position[i] = d[i] * (baseline / rho);
    if (!is_finite(position[i])) infinite = true;
  }
  *out = tv_point{};
  for (int i = 0; i < 3; ++i) out->position[i] = infinite ? d[i] : position[i];
  out->status = infinite ? TV_POINT_INFINITE : rho > 0.0 ? TV_POINT_OK : TV_POINT_BEHIND;
  out->angle_rad = static_cast<float>(atan2(std::sqrt(sine_sq), dot(Rd, X1)));
  double in_pixels = 0;
  for (int v = 0; v < 2; ++v) {
    const double* e = match.error[v];
    in_pixels += sigmas[v] * sigmas[v] * (e[0] * e[0] + e[1] * e[1]);
  }
  const double error = std::sqrt(0.5 * in_pixels);
  out->error_px = static_cast<float>(error < kMaxFloat ? error : kMaxFloat);
}

}  // namespace

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
    const int32_t i = adjustment.index[k];
    const double sigmas[2] = {sigma_of(problem, 0, i), sigma_of(problem, 1, i)};
    write_point(frame, adjustment.now[k], sigmas, baseline, &points[i]);
  }
}

}  // namespace tv
