#include "adjust/window_system.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace tv {
namespace {

constexpr double kVanished = 1e-14;  // a pivot at most this share of its entry counts as zero
// A point moves at most to ten times its distance in one step, and not beyond kFarthest times the
// distance from the first view that sees it to another one. From there infinity looks the same to
// within 0.001 px for a focal length of 1000 px. Ten times farther the elimination, in doubles,
// would take the depth for undetermined, and the point could not come back.
constexpr double kLeastShare = 0.1;
constexpr double kFarthest = 1e6;
// The curvature along the ray, as a share of that across it, below which a point may be so far.
constexpr double kHardlyKnown = 1e-10;
// A point whose cost grows by more than this, beyond that of an error of the loss's scale, is
// settled alone, and takes so many steps without the loss's curvature.
constexpr double kGrowth = 1.2;
constexpr int kCarefulSteps = 2;
constexpr int kSettleSteps = 10;
constexpr double kSettleDamping = 1e-3, kSettled = 0.999;

// The sums over a point's observations, as the kernel add_observation adds them: V = sum Jp'Jp
// (xx xy xz yy yz zz) and half the gradient.
struct PointSums {
  double V[6], gradient[3];
};

// Adds an observation to the point's sums, and to the terms of its view unless `block` is negative.
void add_observation(const Window& window, const LossCurvature& curvature, const WindowPose& pose,
                     const WindowObservation& o, const double X[3], PointSums* sums, int block,
                     double* columns, int pitch) {
  LinearObservation linear;
  transform(pose, X, linear.x);
  linearise(window.options, curvature, o, &linear);
  window.system.kernels->add_observation(
      reinterpret_cast<const double*>(&o), pose.R, reinterpret_cast<const double*>(&linear),
      reinterpret_cast<double*>(sums), &window.reduced, block, columns, pitch);
}

// The vector from the first view that sees the point to the point.
void ray_of(const Window& window, const WindowPose* pose, const WindowPoint& point,
            const double X[3], double ray[3]) {
  const double* centre = pose[window.observations[point.begin].view].centre;
  for (int i = 0; i < 3; ++i) ray[i] = X[i] - centre[i];
}

double distance_sq(const double a[3], const double b[3]) {
  const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return dot(d, d);
}

// The squared distance from the first view that sees the point up to which the point may go:
// kFarthest times the longest baseline to another view that sees it, squared. The search ends at
// the first baseline that allows more than enough_sq, which is mostly that of the last view.
double farthest_sq(const Window& window, const WindowPose* pose, const WindowPoint& point,
                   double enough_sq) {
  const WindowObservation* observations = window.observations;
  const double* centre = pose[observations[point.begin].view].centre;
  double largest_sq = 0.0;
  for (int k = point.end - 1; k > point.begin && largest_sq <= enough_sq; --k) {
    const double baseline_sq = distance_sq(pose[observations[k].view].centre, centre);
    largest_sq = std::max(largest_sq, kFarthest * kFarthest * baseline_sq);
  }
  return largest_sq;
}

// Moves a point back towards the first view that sees it, if it is too far away and farther than
// before, when its squared distance was before_sq.
void keep_near(const Window& window, const WindowPose* pose, const WindowPoint& point,
               double before_sq, double X[3]) {
  double ray[3];
  ray_of(window, pose, point, X, ray);
  const double now_sq = length_sq_of(ray);
  if (now_sq <= before_sq) return;
  const double limit_sq = std::max(before_sq, farthest_sq(window, pose, point, now_sq));
  if (now_sq <= limit_sq) return;
  const double less = std::sqrt(limit_sq / now_sq) - 1.0;
  for (int i = 0; i < 3; ++i) X[i] += less * ray[i];
}

// Whether a point is as far away as it may go: its squared distance is at least nine tenths of the
// largest one.
bool is_far(const Window& window, const WindowPose* pose, const WindowPoint& point,
            const double ray[3]) {
  const double ray_sq = length_sq_of(ray);
  return ray_sq > 0.9 * farthest_sq(window, pose, point, 2.0 * ray_sq);
}

// V = L L' and y, as far as the pivots do not vanish beside the entries of the diagonal before.
void factorise(const PointSums& sums, const double diagonal[3], EliminatedPoint* out) {
  const double *V = sums.V, *g = sums.gradient;
  const auto inverse_of = [](double pivot, double entry) {
    return pivot > kVanished * entry ? 1.0 / std::sqrt(pivot) : 0.0;
  };
  double* inverses = out->inverses;
  inverses[0] = inverse_of(V[0], diagonal[0]);
  out->l10 = V[1] * inverses[0];
  out->l20 = V[2] * inverses[0];
  inverses[1] = inverse_of(V[3] - out->l10 * out->l10, diagonal[1]);
  out->l21 = (V[4] - out->l20 * out->l10) * inverses[1];
  inverses[2] = inverse_of((V[5] - out->l20 * out->l20) - out->l21 * out->l21, diagonal[2]);
  out->y[0] = g[0] * inverses[0];
  out->y[1] = (g[1] - out->l10 * out->y[0]) * inverses[1];
  out->y[2] = ((g[2] - out->l20 * out->y[0]) - out->l21 * out->y[1]) * inverses[2];
}

// V grows by `across` in each direction across the ray and by `along` in that of the ray.
void damp(const double ray[3], double scale, double across, double along, PointSums* sums) {
  const double more = (along - across) * scale;
  for (int i = 0, slot = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j, ++slot) {
      sums->V[slot] += more * ray[i] * ray[j] + (i == j ? across : 0.0);
    }
  }
}

// -L'^-1 y
void solve_point(const EliminatedPoint& e, const double y[3], double step[3]) {
  step[2] = -y[2] * e.inverses[2];
  step[1] = (-y[1] - e.l21 * step[2]) * e.inverses[1];
  step[0] = ((-y[0] - e.l10 * step[1]) - e.l20 * step[2]) * e.inverses[0];
}

// V + damping = L L', with the same damping for all directions across the ray, and that of its own
// for the direction along it: depths are often known a thousand times less well.
void eliminate(const Window& window, const WindowPose* pose, const WindowPoint& point,
               const double ray[3], double damping, PointSums* sums, EliminatedPoint* out) {
  const double* V = sums->V;
  const double length_sq = length_sq_of(ray);
  const double scale = length_sq > 0.0 ? 1.0 / length_sq : 0.0;
  const double Vr[3] = {(V[0] * ray[0] + V[1] * ray[1]) + V[2] * ray[2],
                        (V[1] * ray[0] + V[3] * ray[1]) + V[4] * ray[2],
                        (V[2] * ray[0] + V[4] * ray[1]) + V[5] * ray[2]};
  const double trace = (V[0] + V[3]) + V[5];
  const double along = std::min(std::max(dot(ray, Vr) * scale, 0.0), trace);
  const double diagonal[3] = {V[0], V[3], V[5]};
  out->across = damping * (0.5 * (trace - along));
  out->along = damping * along;
  damp(ray, scale, out->across, out->along, sums);
  factorise(*sums, diagonal, out);
  // The depth of a point that is far away and would move farther is held, so that the predicted
  // gain does not contain the gain of that move.
  if (!(damping > 0.0 && along < kHardlyKnown * trace && is_far(window, pose, point, ray))) return;
  double step[3];
  solve_point(*out, out->y, step);
  if (!(dot(step, ray) > 0.0)) return;
  damp(ray, scale, 0.0, trace, sums);
  out->along += trace;
  factorise(*sums, diagonal, out);
}

// Z = L^-1 W' in place of W', and its part of the reduced gradient.
void reduce_columns(const Window& window, const EliminatedPoint& of, const WindowPoint& point,
                    Pair* Z) {
  const EliminatedPoint e = of;  // stays in registers while Z is written
  const int pitch = kBlockPairs * point.num_slots;
  for (int k = 0; k < point.num_slots; ++k) {
    Pair* g = reinterpret_cast<Pair*>(window.reduced.gradient +
                                      kBlock * window.slot_block[point.begin + k]);
    for (int c = 0; c < kBlockPairs; ++c, ++Z, ++g) {
      const Pair z0 = Z[0] * e.inverses[0];
      const Pair z1 = (Z[pitch] - e.l10 * z0) * e.inverses[1];
      const Pair z2 = ((Z[2 * pitch] - e.l20 * z0) - e.l21 * z1) * e.inverses[2];
      Z[0] = z0, Z[pitch] = z1, Z[2 * pitch] = z2;
      *g -= (z0 * e.y[0] + z1 * e.y[1]) + z2 * e.y[2];
    }
  }
}

double add_point(const Window& window, const Weighing& weighing, int p) {
  WindowPoint& point = window.points[p];
  const BlockMatrix& A = window.system;
  const int32_t* blocks = window.slot_block + point.begin;
  const double* X = window.position + 3 * p;
  const int pitch = kBlock * point.num_slots;
  PointSums sums{};
  LossCurvature curvature = weighing.curvature;
  if (point.careful > 0) {
    --point.careful;
    curvature.bend = 0.0;
  }
  // Z is cleared long before its entries are added to, because the CPU cannot forward entries that
  // were just stored one by one to the load of a whole vector.
  Pair* Z = window.Z + 3 * kBlockPairs * point.begin;
  double* columns = reinterpret_cast<double*>(Z);
  std::memset(columns, 0, sizeof(double) * 3 * static_cast<size_t>(pitch));
  for (int k = point.begin; k < point.end; ++k) {
    const WindowObservation& o = window.observations[k];
    add_observation(window, curvature, window.pose[o.view], o, X, &sums, window.block[o.view],
                    columns + kBlock * o.slot, pitch);
  }
  double ray[3];
  ray_of(window, window.pose, point, X, ray);
  EliminatedPoint& e = window.eliminated[p];
  eliminate(window, window.pose, point, ray, weighing.damping, &sums, &e);
  reduce_columns(window, e, point, Z);
  A.kernels->subtract_products(A.entries, columns, pitch, blocks, point.num_slots);
  return dot(e.y, e.y);
}

// The sum of the priors' costs. With a weight, also adds their terms to the system.
double visit_priors(const Window& window, const WindowPose* pose, const double* weight) {
  const tv_window& given = window.given;
  PriorTerm term;
  double sum = 0.0;
  const auto use = [&](int low, int high) {
    sum += term.cost;
    if (weight != nullptr) add_term(window, *weight, term, low, high);
  };
  for (int k = 0; k < given.num_pose_priors; ++k) {
    const tv_pose_prior& prior = given.pose_priors[k];
    pose_term(prior, pose[prior.idx_view], &term);
    use(prior.idx_view, -1);
  }
  for (int k = 0; k < given.num_gravity_priors; ++k) {
    const tv_gravity_prior& prior = given.gravity_priors[k];
    gravity_term(prior, given.world_down, pose[prior.idx_view], &term);
    use(prior.idx_view, -1);
  }
  for (int k = 0; k < given.num_distance_priors; ++k) {
    const tv_distance_prior& prior = given.distance_priors[k];
    const int32_t low = std::min(prior.idx_view0, prior.idx_view1);
    const int32_t high = std::max(prior.idx_view0, prior.idx_view1);
    distance_term(prior, pose[low], pose[high], &term);
    use(low, high);
  }
  return sum;
}

// Writes the point's sum of rho and that of its squared residuals. False where a view does not see
// it.
bool see_point(const Window& window, const WindowPose* pose, const WindowPoint& point,
               const double X[3], double* cost, double* sum_sq) {
  LossSum sum(window.options);
  double squares = 0.0;
  for (int k = point.begin; k < point.end; ++k) {
    const WindowObservation& o = window.observations[k];
    double x[3];
    Residual r{};
    transform(pose[o.view], X, x);
    if (!residual_at(o, x, &r)) return false;
    const double s = norm_sq(r);
    squares += s;
    sum.add(s);
  }
  *cost = sum.value();
  *sum_sq = squares;
  return true;
}

}  // namespace

void add_term(const Window& window, double weight, const PriorTerm& term, int low, int high) {
  const int views[2] = {low, high};
  for (int a = 0; a < 2; ++a) {
    const int row = views[a] < 0 ? -1 : window.block[views[a]];
    if (row < 0) continue;
    for (int i = 0; i < kBlock; ++i) {
      window.reduced.gradient[kBlock * row + i] += weight * term.gradient[a][i];
      window.system.diagonal[kBlock * row + i] += weight * term.H[a][a][kBlock * i + i];
    }
    for (int b = 0; b <= a; ++b) {
      const int column = window.block[views[b]];
      if (column < 0) continue;
      double* block = block_at(window.system, row, column);
      for (int i = 0; i < kBlock; ++i) {
        for (int j = 0; j < kBlock; ++j) {
          block[i * row_entries(row) + j] += weight * term.H[a][b][kBlock * i + j];
        }
      }
    }
  }
}

double build_system(const Window& window, const Weighing& weighing) {
  const size_t bytes = sizeof(double) * static_cast<size_t>(kBlock * window.num_blocks);
  std::memset(window.reduced.entries, 0, sizeof(double) * block_entries(window.num_blocks));
  std::memset(window.reduced.diagonal, 0, bytes);
  std::memset(window.reduced.gradient, 0, bytes);
  visit_priors(window, window.pose, &weighing.prior_weight);
  double sum = 0.0;
  for (int p = 0; p < window.num_points; ++p) sum += add_point(window, weighing, p);
  return sum;
}

double observations_cost(const Window& window, double* sum_sq) {
  double cost = 0.0, of_point;
  *sum_sq = 0.0;
  for (int p = 0; p < window.num_points; ++p) {
    WindowPoint& point = window.points[p];
    see_point(window, window.pose, point, window.position + 3 * p, &point.cost, &of_point);
    *sum_sq += of_point;
    cost += point.cost;
  }
  return cost;
}

double priors_cost(const Window& window, const WindowPose* pose) {
  return visit_priors(window, pose, nullptr);
}

namespace {

// The point's step where y = L^-1 gradient, with the views' part. To first order it is that of
// least cost; to higher orders it is a step of the inverse distance from the first view.
void step_of(const EliminatedPoint& e, const double y[3], const double ray[3], double step[3],
             double* damped) {
  solve_point(e, y, step);
  const double ray_sq = length_sq_of(ray), inward = dot(ray, step);
  const double share = ray_sq > 0.0 ? inward / ray_sq : 0.0;
  const double along_sq = share * inward;
  *damped += e.across * (dot(step, step) - along_sq) + e.along * along_sq;
  const double factor = 1.0 / std::max(1.0 - share, kLeastShare);
  for (int i = 0; i < 3; ++i) step[i] *= factor;
}

void joint_step(const Window& window, int p, double next[3], double* damped) {
  const WindowPoint& point = window.points[p];
  const EliminatedPoint& e = window.eliminated[p];
  const double* X = window.position + 3 * p;
  double y[3] = {e.y[0], e.y[1], e.y[2]}, ray[3], step[3];
  const double* Z = reinterpret_cast<const double*>(window.Z + 3 * kBlockPairs * point.begin);
  for (int k = 0; k < point.num_slots; ++k, Z += kBlock) {
    const double* of_view = window.step + kBlock * window.slot_block[point.begin + k];
    for (int m = 0; m < 3; ++m) {
      const double* z = Z + kBlock * point.num_slots * m;
      y[m] += (z[0] * of_view[0] + z[1] * of_view[1] + z[2] * of_view[2]) +
              (z[3] * of_view[3] + z[4] * of_view[4] + z[5] * of_view[5]);
    }
  }
  ray_of(window, window.pose, point, X, ray);
  step_of(e, y, ray, step, damped);
  for (int i = 0; i < 3; ++i) next[i] = X[i] + step[i];
  keep_near(window, window.next_pose, point, length_sq_of(ray), next);
}

// Lowers the cost of a point alone at the next poses, from X. False where a view does not see X.
bool settle(const Window& window, WindowPoint* point, double X[3], double* sum_sq) {
  double damping = kSettleDamping;
  if (!see_point(window, window.next_pose, *point, X, &point->next_cost, sum_sq)) return false;
  for (int i = 0; i < kSettleSteps; ++i) {
    PointSums sums{};
    for (int k = point->begin; k < point->end; ++k) {
      const WindowObservation& o = window.observations[k];
      add_observation(window, {0.0, false}, window.next_pose[o.view], o, X, &sums, kHeldView,
                      nullptr, 0);
    }
    EliminatedPoint e;
    double ray[3], step[3], next[3], cost, next_sum_sq, damped = 0.0;
    ray_of(window, window.next_pose, *point, X, ray);
    eliminate(window, window.next_pose, *point, ray, damping, &sums, &e);
    step_of(e, e.y, ray, step, &damped);
    for (int c = 0; c < 3; ++c) next[c] = X[c] + step[c];
    keep_near(window, window.next_pose, *point, length_sq_of(ray), next);
    const bool seen = see_point(window, window.next_pose, *point, next, &cost, &next_sum_sq);
    const bool lower = seen && cost < point->next_cost;
    const bool enough = lower && cost > point->next_cost * kSettled;
    damping *= lower ? 0.1 : 10.0;
    if (lower) {
      point->next_cost = cost;
      *sum_sq = next_sum_sq;
      for (int c = 0; c < 3; ++c) X[c] = next[c];
    }
    if (enough) break;
  }
  return true;
}

}  // namespace

bool move_points(const Window& window, Moved* moved) {
  const double scale = window.options.loss_scale_px;
  *moved = Moved{};
  for (int p = 0; p < window.num_points; ++p) {
    WindowPoint& point = window.points[p];
    const double* X = window.position + 3 * p;
    double* next = window.next_position + 3 * p;
    double sum_sq = 0.0;
    joint_step(window, p, next, &moved->damped);
    if (!see_point(window, window.next_pose, point, next, &point.next_cost, &sum_sq) ||
        point.next_cost > kGrowth * (point.cost + scale * scale)) {
      for (int i = 0; i < 3; ++i) next[i] = X[i];
      point.careful = kCarefulSteps;
      if (!settle(window, &point, next, &sum_sq)) return false;
    }
    moved->cost += point.next_cost;
    moved->sum_sq += sum_sq;
  }
  return true;
}

}  // namespace tv
