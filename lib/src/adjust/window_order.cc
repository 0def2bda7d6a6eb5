// The observations of a window in the order of its points, as far as they can be used. It is
// compiled for speed, unlike the rest of window.cc.
#include <algorithm>
#include <cstring>

#include "adjust/window_system.h"
#include "base/math.h"

namespace tv {
namespace {

size_t count_of(int num) { return static_cast<size_t>(num); }

// Sorts 0 .. num - 1, or `from` where it is not null, by a member, stably. `begin` has num_keys + 1
// entries: in the end, begin[k] is where key k ends.
void counting_sort(const tv_window& given, int32_t tv_observation::*key, int num_keys,
                   const int32_t* from, int32_t* begin, int32_t* to) {
  const tv_observation* observations = given.observations;
  std::fill(begin, begin + num_keys + 1, 0);
  for (int i = 0; i < given.num_observations; ++i) ++begin[observations[i].*key + 1];
  for (int k = 0; k < num_keys; ++k) begin[k + 1] += begin[k];
  for (int i = 0; i < given.num_observations; ++i) {
    const int32_t idx = from == nullptr ? i : from[i];
    to[begin[observations[idx].*key]++] = idx;
  }
}

// Appends the observations [first, last) of a point in `order`, as far as they can be used. Returns
// from how many views they are.
int append_observations(Window* window, const Camera* cameras, const double* planes,
                        const int32_t* order, int first, int last, tv_window_result* result) {
  const tv_window& given = window->given;
  int num_views = 0, previous = -1;
  for (int k = first; k < last; ++k) {
    const tv_observation& from = given.observations[order[k]];
    const double* X = given.points + 3 * count_of(from.idx_point);
    WindowObservation o{};
    o.view = from.idx_view;
    o.idx = order[k];
    const Camera& camera = cameras[given.views[o.view].idx_camera];
    const double* plane = planes != nullptr ? planes + 2 * count_of(o.idx) : nullptr;
    if (!all_finite(X, 3) || !make_observation(camera, from, plane, &o)) {
      ++result->num_invalid;
      continue;
    }
    double x[3];
    Residual r{};
    transform(window->pose[o.view], X, x);
    if (!residual_at(o, x, &r)) {
      ++result->num_behind;
      continue;
    }
    num_views += o.view != previous;
    previous = o.view;
    window->observations[window->num_observations++] = o;
  }
  return num_views;
}

}  // namespace

void gather_points(Window* window, const Camera* cameras, const double* planes, int32_t* order,
                   int32_t* begin, tv_window_result* result) {
  const tv_window& given = window->given;
  counting_sort(given, &tv_observation::idx_view, given.num_views, nullptr, begin,
                window->slot_block);
  counting_sort(given, &tv_observation::idx_point, given.num_points, window->slot_block, begin,
                order);
  int last = 0;
  for (int32_t p = 0; p < given.num_points; ++p) {
    const int first = last;
    last = begin[p];
    const int start = window->num_observations;
    const int num_views = append_observations(window, cameras, planes, order, first, last, result);
    if (num_views < 2) {
      result->num_single += window->num_observations - start;
      window->num_observations = start;
      continue;
    }
    WindowPoint point{};
    point.idx = p;
    point.begin = start;
    point.end = window->num_observations;
    window->points[window->num_points] = point;
    std::memcpy(window->position + 3 * count_of(window->num_points), given.points + 3 * count_of(p),
                3 * sizeof(double));
    ++window->num_points;
  }
}

}  // namespace tv
