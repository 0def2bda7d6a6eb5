// The entry points of the window's bundle adjustment: they validate, call adjust/window.h, and
// write the result.
#include "twoview/window.h"

#include <cmath>

#include "adjust/window.h"
#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "geometry/essential.h"
#include "geometry/vector3.h"

namespace tv {
namespace {

constexpr tv_window make_default_window() {
  tv_window window{};
  window.struct_size = sizeof(tv_window);
  window.world_down[1] = 1.0;
  return window;
}

constexpr tv_window kDefaultWindow = make_default_window();
constexpr tv_window_options kDefaultOptions = {
    sizeof(tv_window_options), TV_LOSS_CAUCHY, 2.0, 1.0, 1e-6, 50, 0};
constexpr double kLargest = 1e9, kLeastScale = 1e-6;
constexpr int32_t kMaxPriors = 4 * TV_WINDOW_MAX_VIEWS;

bool within_open(double value, double low, double high) { return value > low && value <= high; }

tv_status read_window_options(const tv_window_options* given, tv_window_options* options) {
  *options = kDefaultOptions;
  const tv_status status = read_sized(given, options);
  if (status != TV_OK) return status;
  const double numbers[] = {options->loss_scale_px, options->noise_px, options->tolerance};
  if (!all_finite(numbers, 3)) return TV_ERR_NOT_FINITE;
  const bool valid = within(options->loss, TV_LOSS_NONE, TV_LOSS_CAUCHY) &&
                     options->loss_scale_px >= kLeastScale && options->loss_scale_px <= kLargest &&
                     within_open(options->noise_px, 0.0, kLargest) && options->tolerance >= 0.0 &&
                     options->tolerance <= 0.1 && within(options->max_iterations, 0, 1000) &&
                     options->reserved == 0;
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status read_counts(const tv_window* given, tv_window* window) {
  if (given == nullptr) return TV_ERR_NULL;
  *window = kDefaultWindow;
  const tv_status status = read_sized(given, window);
  if (status != TV_OK) return status;
  const bool valid = within(window->num_cameras, 0, TV_WINDOW_MAX_VIEWS) &&
                     within(window->num_views, 0, TV_WINDOW_MAX_VIEWS) &&
                     within(window->num_points, 0, TV_WINDOW_MAX_POINTS) &&
                     within(window->num_observations, 0, TV_WINDOW_MAX_OBSERVATIONS) &&
                     within(window->num_pose_priors, 0, kMaxPriors) &&
                     within(window->num_gravity_priors, 0, kMaxPriors) &&
                     within(window->num_distance_priors, 0, kMaxPriors);
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

bool is_index(int32_t idx, int32_t count) {
  return static_cast<uint32_t>(idx) < static_cast<uint32_t>(count);  // count is not negative
}

// Whether a direction has a length whose square is neither 0 nor infinite.
bool is_direction(const double v[3]) {
  const double length_sq = tv::length_sq_of(v);
  return length_sq > 1e-200 && length_sq < 1e200;
}

// Whether a matrix is symmetric, and no 2x2 minor of its diagonal is negative.
bool is_information(const double M[36]) {
  for (int i = 0; i < 6; ++i) {
    if (!(M[7 * i] >= 0.0)) return false;
    for (int j = 0; j < i; ++j) {
      const double bound = std::sqrt(M[7 * i]) * std::sqrt(M[7 * j]) * (1.0 + 1e-9);
      if (!(std::fabs(M[6 * i + j]) <= bound) ||
          !(std::fabs(M[6 * i + j] - M[6 * j + i]) <= 1e-9 * bound)) {
        return false;
      }
    }
  }
  return true;
}

tv_status check_pose(const double R[9], const double t[3]) {
  if (!all_finite(R, 9) || !all_finite(t, 3)) return TV_ERR_NOT_FINITE;
  return is_rotation(R) ? TV_OK : TV_ERR_ARGUMENT;
}

tv_status check_views(const tv_window& window) {
  for (int32_t k = 0; k < window.num_cameras; ++k) {
    if (tv_camera_check(&window.cameras[k]) != TV_OK) return TV_ERR_CAMERA;
  }
  for (int32_t k = 0; k < window.num_views; ++k) {
    const tv_window_view& view = window.views[k];
    if (!is_index(view.idx_camera, window.num_cameras) || !within(view.fixed, 0, 1)) {
      return TV_ERR_ARGUMENT;
    }
    const tv_status status = check_pose(view.R, view.t);
    if (status != TV_OK) return status;
  }
  return TV_OK;
}

tv_status check_observations(const tv_window& window) {
  for (int32_t k = 0; k < window.num_observations; ++k) {
    const tv_observation& o = window.observations[k];
    if (!is_finite(static_cast<double>(o.sigma))) return TV_ERR_NOT_FINITE;
    if (!is_index(o.idx_view, window.num_views) || !is_index(o.idx_point, window.num_points) ||
        !(o.sigma == 0.0f || within(o.sigma, kLeastSigma, kLargestSigma)) || o.reserved != 0) {
      return TV_ERR_ARGUMENT;
    }
  }
  return TV_OK;
}

tv_status check_priors(const tv_window& window) {
  for (int32_t k = 0; k < window.num_pose_priors; ++k) {
    const tv_pose_prior& prior = window.pose_priors[k];
    if (!all_finite(prior.information, 36)) return TV_ERR_NOT_FINITE;
    const tv_status status = check_pose(prior.R, prior.t);
    if (status != TV_OK) return status;
    if (!is_index(prior.idx_view, window.num_views) || prior.reserved != 0 ||
        !is_information(prior.information)) {
      return TV_ERR_ARGUMENT;
    }
  }
  if (window.num_gravity_priors > 0) {
    if (!all_finite(window.world_down, 3)) return TV_ERR_NOT_FINITE;
    if (!is_direction(window.world_down)) return TV_ERR_ARGUMENT;
  }
  for (int32_t k = 0; k < window.num_gravity_priors; ++k) {
    const tv_gravity_prior& prior = window.gravity_priors[k];
    if (!all_finite(prior.down, 3) || !is_finite(prior.sigma_rad)) return TV_ERR_NOT_FINITE;
    if (!is_index(prior.idx_view, window.num_views) || prior.reserved != 0 ||
        !is_direction(prior.down) || !(prior.sigma_rad >= 1e-6 && prior.sigma_rad <= 10.0)) {
      return TV_ERR_ARGUMENT;
    }
  }
  for (int32_t k = 0; k < window.num_distance_priors; ++k) {
    const tv_distance_prior& prior = window.distance_priors[k];
    if (!is_finite(prior.distance) || !is_finite(prior.sigma)) return TV_ERR_NOT_FINITE;
    if (!is_index(prior.idx_view0, window.num_views) ||
        !is_index(prior.idx_view1, window.num_views) || prior.idx_view0 == prior.idx_view1 ||
        !(prior.distance >= 0.0) || !(prior.sigma > 0.0)) {
      return TV_ERR_ARGUMENT;
    }
  }
  return TV_OK;
}

template <typename Element>
Bytes bytes_of(const Element* array, int32_t count) {
  return {array, static_cast<size_t>(count) * sizeof(Element)};
}

}  // namespace
}  // namespace tv

void tv_window_init_sized(tv_window* window, size_t struct_size) {
  tv::init_sized(window, struct_size, &tv::kDefaultWindow, sizeof tv::kDefaultWindow);
}

void tv_window_options_init_sized(tv_window_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaultOptions, sizeof tv::kDefaultOptions);
}

void tv_window_result_init_sized(tv_window_result* result, size_t struct_size) {
  tv::init_zeros(result, struct_size);
}

tv_status tv_adjust_window_size(const tv_window* window, size_t* size_bytes) {
  tv_window read;
  const tv_status status = tv::read_counts(window, &read);
  if (status != TV_OK) return status;
  if (size_bytes == nullptr) return TV_ERR_NULL;
  *size_bytes = tv::window_scratch_bytes(read);
  return TV_OK;
}

tv_status tv_adjust_window(void* memory, size_t size_bytes, const tv_window* window,
                           const tv_window_options* options, double* covariances, float* errors_px,
                           tv_window_result* result) {
  tv_window w;
  tv_status status = tv::read_counts(window, &w);
  if (status == TV_OK && result != nullptr) status = tv::check_sized(result);
  if (status != TV_OK) return status;
  const size_t needed = tv::window_scratch_bytes(w);
  const tv::Bytes arrays[13] = {tv::bytes_of(covariances, 36 * w.num_views),
                                tv::bytes_of(errors_px, w.num_observations),
                                {result, result != nullptr ? result->struct_size : 0},
                                {memory, needed},  // from here on: null only where it is empty
                                tv::bytes_of(w.views, w.num_views),
                                tv::bytes_of(w.points, 3 * w.num_points),
                                tv::bytes_of(w.cameras, w.num_cameras),  // no output from here on
                                tv::bytes_of(w.observations, w.num_observations),
                                tv::bytes_of(w.pose_priors, w.num_pose_priors),
                                tv::bytes_of(w.gravity_priors, w.num_gravity_priors),
                                tv::bytes_of(w.distance_priors, w.num_distance_priors),
                                {window, window->struct_size},
                                {options, options != nullptr ? options->struct_size : 0}};
  for (const tv::Bytes* array = arrays + 3; array < arrays + 13; ++array) {
    if (array->data == nullptr && array->size > 0) return TV_ERR_NULL;
  }
  tv_window_options read;
  status = tv::read_window_options(options, &read);
  if (status == TV_OK) status = tv::check_views(w);
  if (status == TV_OK) status = tv::check_observations(w);
  if (status == TV_OK) status = tv::check_priors(w);
  if (status != TV_OK) return status;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < needed) return TV_ERR_MEMORY;
  if (tv::outputs_overlap(arrays, 6, 13)) return TV_ERR_OVERLAP;
  tv::Arena arena = tv::arena_over(memory, needed);
  tv_window_result packed{};
  if (!tv::adjust_window(w, read, {tvk_select(TV_KERNELS_AUTO)}, arena, covariances, errors_px,
                         &packed)) {
    return TV_ERR_NOT_FINITE;
  }
  if (result != nullptr) tv::write_sized(packed, result);
  return TV_OK;
}
