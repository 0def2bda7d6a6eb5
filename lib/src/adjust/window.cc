#include "adjust/window.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "adjust/window_system.h"
#include "base/math.h"
#include "geometry/vector3.h"

namespace tv {
namespace {

constexpr double kNearChange = 0.1;  // below this relative change, the loss's curvature counts
constexpr double kLeastKept = 0.03;
constexpr double kLargestFactor = 0.9;  // of two gains that follow each other
constexpr double kNoErrorSq = 1e-20;    // px^2 for each observation; smaller errors count as none
constexpr double kMinDamping = 1e-12, kMaxDamping = 1e8;
// With more damping, a small change of the cost is no evidence for a minimum.
constexpr double kHonestDamping = 1e-2;
// A view's parameter that no term depends on is damped as if it had this share of the largest entry
// of its group, rotation or translation.
constexpr double kLeastEntry = 1e-9;
constexpr double kHeld = 1e9;  // how much larger an entry becomes where a parameter is held
constexpr double kVanished = 1e-14, kUndetermined = 1e-12;

size_t count_of(int num) { return static_cast<size_t>(num); }

// An observation's squared residual at the present state.
double error_sq_at(const Window& window, const WindowObservation& o, const double X[3]) {
  double x[3];
  Residual r{};
  transform(window.pose[o.view], X, x);
  residual_at(o, x, &r);
  return norm_sq(r);
}

// ---- the views that are adjusted ----

// Numbers the blocks of the views that are adjusted: those that take part and are not held.
void choose_views(Window* window, tv_window_result* result) {
  const tv_window& given = window->given;
  int32_t* block = window->block;
  std::fill(block, block + given.num_views, kAbsentView);
  for (int k = 0; k < window->num_observations; ++k)
    block[window->observations[k].view] = kUnnumberedView;
  for (int k = 0; k < given.num_pose_priors; ++k)
    block[given.pose_priors[k].idx_view] = kUnnumberedView;
  for (int k = 0; k < given.num_gravity_priors; ++k) {
    block[given.gravity_priors[k].idx_view] = kUnnumberedView;
  }
  for (int k = 0; k < given.num_distance_priors; ++k) {
    block[given.distance_priors[k].idx_view0] = kUnnumberedView;
    block[given.distance_priors[k].idx_view1] = kUnnumberedView;
  }
  int num_fixed = 0;
  for (int v = 0; v < given.num_views; ++v) {
    num_fixed += block[v] == kUnnumberedView && given.views[v].fixed != 0;
  }
  result->held_first_view =
      num_fixed == 0 && given.num_pose_priors == 0 && given.num_gravity_priors == 0;
  result->scale_is_free = given.num_distance_priors == 0 && num_fixed + given.num_pose_priors < 2;
  bool hold = result->held_first_view != 0;
  for (int v = 0; v < given.num_views; ++v) {
    if (block[v] == kAbsentView) continue;
    block[v] = given.views[v].fixed != 0 || hold ? kHeldView : window->num_blocks++;
    hold = false;
  }
  for (int p = 0; p < window->num_points; ++p) {
    WindowPoint* point = &window->points[p];
    for (int k = point->begin; k < point->end; ++k) {
      WindowObservation* o = &window->observations[k];
      o->slot = 0;
      if (block[o->view] < 0) continue;
      const bool same = k > point->begin && o[-1].view == o->view;
      if (!same) window->slot_block[point->begin + point->num_slots++] = block[o->view];
      o->slot = point->num_slots - 1;
    }
  }
}

// ---- Levenberg-Marquardt ----

// Damps the views' entries, and solves for their steps. Returns what the step gains of the reduced
// gradient, and adds to *damped.
double solve_views(const Window& window, double damping, double* damped) {
  const BlockMatrix& A = window.system;
  const int size = kBlock * window.num_blocks;
  for (int group = 0; group < size; group += 3) {
    double largest = 0.0;
    for (int i = group; i < group + 3; ++i) largest = std::max(largest, A.diagonal[i]);
    for (int i = group; i < group + 3; ++i) {
      A.diagonal[i] = std::max(A.diagonal[i], kLeastEntry * largest);
      *diagonal_at(A, i) += damping * A.diagonal[i];
      window.step[i] = -window.reduced.gradient[i];
    }
  }
  factorise(A, kVanished);
  solve_lower(A, 0, window.step);
  double gain = 0.0;
  for (int i = 0; i < size; ++i) gain += window.step[i] * window.step[i];
  solve_upper(A, window.step);
  for (int i = 0; i < size; ++i) {
    *damped += damping * A.diagonal[i] * window.step[i] * window.step[i];
  }
  return gain;
}

void step_views(const Window& window) {
  for (int v = 0; v < window.given.num_views; ++v) {
    const int block = window.block[v];
    window.next_pose[v] =
        block < 0 ? window.pose[v] : stepped(window.pose[v], window.step + kBlock * block);
  }
}

void minimise(Window* window, double damping, double prior_weight, double cost, double* sum_sq,
              tv_window_result* result) {
  const tv_window_options& options = window->options;
  const double no_error = kNoErrorSq * window->num_observations;
  double growth = 2.0, previous = 0.0;
  double kept = 1.0;  // of the curvature in the direction of a residual, least squares'
  result->final_cost = cost;
  while (result->num_iterations < options.max_iterations && result->converged == 0) {
    if (cost <= no_error) {
      result->converged = 1;
      break;
    }
    double damped = 0.0;
    Moved moved;
    double gain = build_system(*window, {damping, prior_weight, {1.0 - kept, false}});
    gain += solve_views(*window, damping, &damped);
    ++result->num_iterations;
    step_views(*window);
    const bool seen = move_points(*window, &moved);
    const double next_cost =
        seen ? moved.cost + prior_weight * priors_cost(*window, window->next_pose) : cost;
    damped += moved.damped;
    const double change = std::fabs(cost - next_cost);
    // What is left to gain if the gains go on falling by the last factor: those that were made or
    // predicted, whichever are larger. Not where damping shortens the steps.
    const double larger = std::max(change, gain + damped);
    const double factor =
        previous > 0.0 ? std::min(larger / previous, kLargestFactor) : kLargestFactor;
    const bool small = seen && damping <= kHonestDamping &&
                       larger * factor <= options.tolerance * cost * (1.0 - factor);
    if (seen && next_cost < cost) {
      std::swap(window->position, window->next_position);
      std::swap(window->pose, window->next_pose);
      for (int p = 0; p < window->num_points; ++p) {
        window->points[p].cost = window->points[p].next_cost;
      }
      const double ratio = change / (gain + damped), excess = 2.0 * ratio - 1.0;
      if (change < kNearChange * cost && ratio > 1.0) kept = std::max(0.5 * kept, kLeastKept);
      if (ratio < 0.25) kept = std::min(2.0 * kept, 1.0);
      damping *= std::max(0.1, 1.0 - excess * excess * excess);
      damping = std::max(damping, kMinDamping);
      growth = 2.0;
      cost = next_cost;
      *sum_sq = moved.sum_sq;
      previous = larger;
    } else {
      damping *= growth;
      growth *= 2.0;
      kept = std::min(4.0 * kept, 1.0);
    }
    // That no step lowers the cost, however short, also shows a minimum at the precision of
    // doubles.
    result->converged = small || damping > kMaxDamping;
  }
  result->final_cost = cost;
}

// ---- the covariance ----

// The variance of an observation along one axis (P. Huber, "Robust statistics", 1981, 7.6, his
// third), for residuals of two dimensions: psi' is its mean over all directions. *scale: what the
// inverse of sum psi' J'J is multiplied by. False where the residuals are too few.
bool measure_noise(const Window& window, int num_parameters, double* variance, double* scale) {
  const double n = 2.0 * window.num_observations;
  double psi_sq = 0.0, slope = 0.0, slope_sq = 0.0;
  for (int p = 0; p < window.num_points; ++p) {
    const WindowPoint& point = window.points[p];
    for (int k = point.begin; k < point.end; ++k) {
      const WindowObservation& o = window.observations[k];
      const double s = error_sq_at(window, o, window.position + 3 * count_of(p));
      const LossSlope loss = slope_of(window.options, s);
      const double bent = loss.weight * (1.0 + 0.5 * loss.bend);
      psi_sq += loss.weight * loss.weight * s;
      slope += 2.0 * bent;
      slope_sq += 2.0 * bent * bent;
    }
  }
  if (!(n > num_parameters) || !(slope > 0.0)) return false;
  const double K = 1.0 + num_parameters / n * (n * slope_sq / (slope * slope) - 1.0);
  *scale = K * K * (psi_sq / (n - num_parameters)) * (n / slope);
  *variance = *scale * (n / slope);
  return true;
}

// The view that the covariances are relative to: the first one that is held, else one with a prior
// of its pose, else the first one that takes part; -1 where there is none.
int reference_view(const Window& window) {
  int first = -1;
  for (int v = window.given.num_views - 1; v >= 0; --v) {
    if (window.block[v] >= 0) first = v;
  }
  if (window.given.num_pose_priors > 0) first = window.given.pose_priors[0].idx_view;
  for (int v = window.given.num_views - 1; v >= 0; --v) {
    if (window.block[v] == kHeldView) first = v;
  }
  return first;
}

// Holds what the window does not determine: the reference's pose, and the distance from it to the
// farthest view.
void hold_free_parameters(const Window& window, bool scale_is_free) {
  const BlockMatrix& A = window.system;
  const int reference = reference_view(window);
  if (reference < 0) return;
  const double* from = window.pose[reference].centre;
  if (scale_is_free) {
    int farthest = -1;
    tv_distance_prior prior{reference, -1, 0.0, 1.0};
    for (int v = 0; v < window.given.num_views; ++v) {
      if (window.block[v] < 0 || v == reference) continue;
      double across[3];
      for (int i = 0; i < 3; ++i) across[i] = window.pose[v].centre[i] - from[i];
      const double distance = length_of(across);
      if (distance > prior.distance) farthest = v, prior.distance = distance;
    }
    if (farthest >= 0) {
      PriorTerm term;
      const int low = std::min(reference, farthest), high = std::max(reference, farthest);
      distance_term(prior, window.pose[low], window.pose[high], &term);
      const double* entries = A.diagonal + kBlock * window.block[farthest];
      add_term(window, kHeld * std::max(std::max(entries[3], entries[4]), entries[5]), term, low,
               high);
    }
  }
  if (window.block[reference] < 0 || window.given.num_pose_priors > 0) return;
  for (int i = 0; i < kBlock; ++i) {
    const int row = kBlock * window.block[reference] + i;
    const double more = kHeld * A.diagonal[row];
    A.diagonal[row] += more;
    *diagonal_at(A, row) += more;
  }
}

// The 6x6 blocks of the inverse's diagonal: of A = L L', sum over k of (L^-1)_ki (L^-1)_kj.
void write_covariances(const Window& window, int held, double scale, double* covariances) {
  const BlockMatrix& A = window.system;
  const int size = kBlock * window.num_blocks;
  double* columns = A.panel;  // scratch: the panel has room for six columns
  for (int v = 0; v < window.given.num_views; ++v) {
    const int block = window.block[v];
    if (block < 0 || v == held) continue;
    for (int c = 0; c < kBlock; ++c) {
      double* column = columns + c * size;
      std::fill(column, column + size, 0.0);
      column[kBlock * block + c] = 1.0;
      solve_lower(A, block, column);
      for (int r = 0; r <= c; ++r) {
        double sum = 0.0;
        for (int k = kBlock * block; k < size; ++k) sum += columns[r * size + k] * column[k];
        double* out = covariances + 36 * count_of(v);
        out[kBlock * r + c] = out[kBlock * c + r] = scale * sum;
      }
    }
  }
}

void measure_covariances(const Window& window, double* covariances, tv_window_result* result) {
  const tv_window& given = window.given;
  std::fill(covariances, covariances + 36 * count_of(given.num_views), 0.0);
  const int num_parameters = kBlock * window.num_blocks + 3 * window.num_points -
                             result->scale_is_free - 6 * given.num_pose_priors -
                             2 * given.num_gravity_priors - given.num_distance_priors;
  double variance, scale;
  if (window.num_blocks == 0 ||
      !measure_noise(window, std::max(num_parameters, 0), &variance, &scale)) {
    return;
  }
  result->noise_px = std::sqrt(variance);
  build_system(window, {0.0, scale, {0.0, true}});
  hold_free_parameters(window, result->scale_is_free != 0);
  if (!(scale > 0.0) || factorise(window.system, kUndetermined) > 0) return;
  const bool is_held = given.num_pose_priors == 0;
  write_covariances(window, is_held ? reference_view(window) : -1, scale, covariances);
  result->has_covariance = 1;
}

// ---- the results ----

double rms(double sum_sq, int num) { return num > 0 ? std::sqrt(sum_sq / (2.0 * num)) : 0.0; }

void write_results(const Window& window, float* errors_px) {
  const tv_window& given = window.given;
  for (int v = 0; v < given.num_views; ++v) {
    if (window.block[v] < 0) continue;
    const WindowPose& pose = window.pose[v];
    std::memcpy(given.views[v].R, pose.R, sizeof pose.R);
    std::memcpy(given.views[v].t, pose.t, sizeof pose.t);
  }
  if (errors_px != nullptr) std::fill(errors_px, errors_px + given.num_observations, -1.0f);
  for (int p = 0; p < window.num_points; ++p) {
    const WindowPoint& point = window.points[p];
    const double* X = window.position + 3 * count_of(p);
    std::memcpy(given.points + 3 * count_of(point.idx), X, 3 * sizeof(double));
    for (int k = point.begin; errors_px != nullptr && k < point.end; ++k) {
      const WindowObservation& o = window.observations[k];
      const float sigma = given.observations[o.idx].sigma;
      const float error = static_cast<float>(std::sqrt(error_sq_at(window, o, X)));
      errors_px[o.idx] = error * (sigma == 0.0f ? 1.0f : sigma);
    }
  }
}

// What the gathering of the points needs.
struct Gathering {
  Camera* cameras;
  int32_t *order, *begin;
};

// The arrays of a window of which every view is adjusted.
Gathering take_arrays(const tvk_odometry_table* kernels, Arena& arena, Window* window) {
  const tv_window& given = window->given;
  const size_t views = count_of(given.num_views), points = count_of(given.num_points);
  const size_t observations = count_of(given.num_observations);
  window->pose = arena_alloc<WindowPose>(arena, views);
  window->next_pose = arena_alloc<WindowPose>(arena, views);
  window->block = arena_alloc<int32_t>(arena, views);
  window->observations = arena_alloc<WindowObservation>(arena, observations);
  window->slot_block = arena_alloc<int32_t>(arena, observations);
  window->Z = arena_alloc<Pair>(arena, 3 * kBlockPairs * observations);
  window->points = arena_alloc<WindowPoint>(arena, points);
  window->position = arena_alloc<double>(arena, 3 * points);
  window->next_position = arena_alloc<double>(arena, 3 * points);
  window->eliminated = arena_alloc<EliminatedPoint>(arena, points);
  window->system = block_matrix(given.num_views, kernels, arena);
  window->reduced = {window->system.entries, window->system.diagonal,
                     arena_alloc<double>(arena, kBlock * views)};
  window->step = arena_alloc<double>(arena, kBlock * views);
  Gathering gathering;
  gathering.cameras = arena_alloc<Camera>(arena, count_of(given.num_cameras));
  gathering.order = arena_alloc<int32_t>(arena, observations);
  gathering.begin = arena_alloc<int32_t>(arena, std::max(views, points) + 1);
  return gathering;
}

}  // namespace

size_t window_scratch_bytes(const tv_window& given) {
  Arena arena = measuring_arena();
  Window window(given, {});
  take_arrays(nullptr, arena, &window);
  return arena.used_bytes;
}

bool adjust_window(const tv_window& given, const tv_window_options& options,
                   const WindowStart& start, Arena& arena, double* covariances, float* errors_px,
                   tv_window_result* result) {
  Window window(given, options);
  const Gathering gathering = take_arrays(tvk_odometry_of(start.kernels), arena, &window);
  for (int v = 0; v < given.num_views; ++v) {
    std::memcpy(window.pose[v].R, given.views[v].R, sizeof window.pose[v].R);
    std::memcpy(window.pose[v].t, given.views[v].t, sizeof window.pose[v].t);
    set_centre(&window.pose[v]);
  }
  for (int k = 0; k < given.num_cameras; ++k) {
    gathering.cameras[k] = prepare_camera(given.cameras[k]);
  }
  gather_points(&window, gathering.cameras, start.planes, gathering.order, gathering.begin, result);
  choose_views(&window, result);
  window.system.num_blocks = window.num_blocks;
  result->num_views = window.num_blocks;
  result->num_points = window.num_points;
  result->num_observations = window.num_observations;
  const double prior_weight = options.noise_px * options.noise_px;
  double sum_sq;
  result->initial_cost =
      observations_cost(window, &sum_sq) + prior_weight * priors_cost(window, window.pose);
  if (!is_finite(result->initial_cost)) return false;
  result->initial_rms_px = rms(sum_sq, window.num_observations);
  minimise(&window, start.damping, prior_weight, result->initial_cost, &sum_sq, result);
  result->rms_px = rms(sum_sq, window.num_observations);
  if (covariances != nullptr) measure_covariances(window, covariances, result);
  write_results(window, errors_px);
  return true;
}

}  // namespace tv
