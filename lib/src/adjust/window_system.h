// A window's observations in the order of its points, and one step of Levenberg-Marquardt: the
// points eliminated, the reduced camera system, and the points' own steps. Derivations:
// docs/algorithms/window.md. Tests: test/unit/test_window.cc, test/unit/test_window_ceres.cc.
#pragma once

#include "adjust/block_cholesky.h"
#include "adjust/window_observation.h"
#include "adjust/window_prior.h"
#include "geometry/vector3.h"

namespace tv {

// What a point leaves for its own step when it is eliminated: V + damping = L L'.
struct EliminatedPoint {
  double l10, l20, l21;
  double inverses[3];    // of L's diagonal; 0 where a pivot vanished
  double y[3];           // L^-1 gradient
  double across, along;  // the damping across the ray and along it
};

struct WindowPoint {
  int32_t idx;         // in the caller's array
  int32_t begin, end;  // its observations
  int32_t num_slots;   // how many adjusted views see it
  int32_t careful;     // for so many steps more, without the loss's curvature
  int32_t reserved;
  double cost, next_cost;  // its sum of rho
};

// In place of the number of a view's block: its pose stays; nothing sees it; not numbered yet.
inline constexpr int32_t kHeldView = -1, kAbsentView = -2, kUnnumberedView = -3;

// The arrays are taken from an arena afterwards.
struct Window {
  Window(const tv_window& window, const tv_window_options& its_options)
      : given(window), options(its_options) {}

  const tv_window& given;
  const tv_window_options& options;
  int num_points = 0, num_observations = 0;
  WindowObservation* observations;  // by point, view, and index
  // Place p + k, where p is the place of a point's first observation, holds the block of the k-th
  // adjusted view that sees the point.
  int32_t* slot_block;
  WindowPoint* points;
  double* position;  // 3 for each point that takes part
  double* next_position;
  WindowPose* pose;  // of each view
  WindowPose* next_pose;
  int32_t* block;  // of each view in the reduced system, or one of the values below
  int num_blocks = 0;
  Pair* Z;  // L^-1 W', 9 for each observation: a point's have three rows of its slots
  EliminatedPoint* eliminated;
  BlockMatrix system;
  // Points to the entries and to the diagonal of `system`, and has an array of its own for half the
  // gradient of the cost. The entries and the gradient are those after the points are eliminated,
  // the diagonal is the one before.
  tvk_reduced_system reduced;
  double* step;
};

// Writes the observations that can be used to window->observations, sorted by point and, within a
// point, by view; points that fewer than two views see are left out. Counts in the window's result
// what is left out. `planes`: two numbers for each observation, or null. `order` and `begin` are
// scratch: as many entries as there are observations, and one more than the larger of the numbers
// of views and of points.
void gather_points(Window* window, const Camera* cameras, const double* planes, int32_t* order,
                   int32_t* begin, tv_window_result* result);

// How the terms are weighed: for a step, or for the covariance.
struct Weighing {
  double damping;
  double prior_weight;
  LossCurvature curvature;
};

// Builds the reduced system at the present state, without the damping of the views, and
// `gradient`. Returns the sum of |y|^2 over the points.
double build_system(const Window& window, const Weighing& weighing);

// The sum of rho over the observations at the present state.
double observations_cost(const Window& window, double* sum_sq);

// What a step leads to, over all observations.
struct Moved {
  double cost, sum_sq;  // the sum of rho, and that of the squared residuals
  double damped;        // what the damping takes of the points' gain
};

// Moves the points by their own steps, given `step` and the views' next poses. False where a view
// does not see one of the points any more.
bool move_points(const Window& window, Moved* moved);

// The sum of the priors' terms at `pose`.
double priors_cost(const Window& window, const WindowPose* pose);

// Adds a prior's term to the reduced system; a view may be -1.
void add_term(const Window& window, double weight, const PriorTerm& term, int low, int high);

}  // namespace tv
