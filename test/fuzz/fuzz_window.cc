// Fuzzes tv_adjust_window with any small window: poses, points, observations, priors and options.
#include "fuzz.h"

namespace {

constexpr int kViews = 6, kPoints = 12, kObservations = 48, kPriors = 3;

struct Window {
  tv_window window;
  tv_camera cameras[2];
  tv_window_view views[kViews];
  double points[3 * kPoints];
  tv_observation observations[kObservations];
  tv_pose_prior pose_priors[kPriors];
  tv_gravity_prior gravity_priors[kPriors];
  tv_distance_prior distance_priors[kPriors];
};

// Values in their ranges; of every fourth window, at times any others.
struct Source {
  fuzz::Bytes& bytes;
  const bool strange = bytes.whole(0, 3) == 0;
  int32_t whole(int32_t low, int32_t high) { return bytes.whole(low, high); }
  double value(double low, double high) {
    return strange ? bytes.wild(low, high) : bytes.between(low, high);
  }
  int32_t index(int count) {
    if (count == 0 || (strange && whole(0, 63) == 0)) return bytes.raw<int8_t>();
    return whole(0, count - 1);
  }
};

// A rotation by up to 0.4 rad about an axis of the camera, at times any nine numbers.
void fill_pose(Source& from, double R[9], double t[3]) {
  const int axis = from.whole(0, 2), next = (axis + 1) % 3, last = (axis + 2) % 3;
  const double u = from.bytes.between(-0.2, 0.2), scale = 1 / (1 + u * u);
  std::memset(R, 0, 9 * sizeof *R);
  R[4 * axis] = 1;
  R[4 * next] = R[4 * last] = (1 - u * u) * scale;
  R[3 * next + last] = -2 * u * scale;
  R[3 * last + next] = 2 * u * scale;
  if (from.strange && from.whole(0, 15) == 0) R[from.whole(0, 8)] = from.value(-1, 1);
  for (int k = 0; k < 3; ++k) t[k] = from.value(-1, 1);
}

// Most observations are those of a point at its pixel, with some noise.
void fill_observation(Source& from, const Window& w, tv_observation* o) {
  o->idx_view = from.index(w.window.num_views);
  o->idx_point = from.index(w.window.num_points);
  const int kind = from.whole(0, 15);
  for (double& value : o->pixel) value = from.value(0, 640);
  o->sigma = kind == 15 ? static_cast<float>(from.value(0, 8)) : 0;
  o->reserved = 0;
  if (kind < 2 || o->idx_view < 0 || o->idx_view >= w.window.num_views || o->idx_point < 0 ||
      o->idx_point >= w.window.num_points) {
    return;
  }
  const tv_window_view& view = w.views[o->idx_view];
  if (view.idx_camera < 0 || view.idx_camera >= w.window.num_cameras) return;
  double x[3], pixel[2];
  for (int i = 0; i < 3; ++i) {
    x[i] = view.t[i];
    for (int k = 0; k < 3; ++k) x[i] += view.R[3 * i + k] * w.points[3 * o->idx_point + k];
  }
  if (tv_camera_project(&w.cameras[view.idx_camera], x, pixel, nullptr) != TV_OK) return;
  for (int k = 0; k < 2; ++k) o->pixel[k] = pixel[k] + from.bytes.between(-1, 1) * (kind % 4);
}

void fill_priors(Source& from, Window* w) {
  tv_window& window = w->window;
  window.num_pose_priors = from.whole(0, 7) == 0 ? from.whole(1, kPriors) : 0;
  window.num_gravity_priors = from.whole(0, 7) == 0 ? from.whole(1, kPriors) : 0;
  window.num_distance_priors = from.whole(0, 7) == 0 ? from.whole(1, kPriors) : 0;
  for (int k = 0; k < window.num_pose_priors; ++k) {
    tv_pose_prior& prior = w->pose_priors[k];
    prior.idx_view = from.index(window.num_views);
    fill_pose(from, prior.R, prior.t);
    for (int i = 0; i < 6; ++i) prior.information[7 * i] = from.value(0, 1e4);
    prior.information[1] = prior.information[6] = from.value(-10, 10);
  }
  for (int k = 0; k < window.num_gravity_priors; ++k) {
    tv_gravity_prior& prior = w->gravity_priors[k];
    prior.idx_view = from.index(window.num_views);
    for (double& value : prior.down) value = from.value(-1, 1);
    prior.sigma_rad = from.value(0, 0.2);
  }
  for (int k = 0; k < window.num_distance_priors; ++k) {
    tv_distance_prior& prior = w->distance_priors[k];
    prior.idx_view0 = from.index(window.num_views);
    prior.idx_view1 = from.index(window.num_views);
    prior.distance = from.value(0, 3);
    prior.sigma = from.value(0, 0.5);
  }
}

void fill(Source& from, Window* w) {
  std::memset(static_cast<void*>(w), 0, sizeof *w);
  tv_window& window = w->window;
  tv_window_init(&window);
  window.num_cameras = 2;
  window.cameras = w->cameras;
  window.num_views = from.whole(0, kViews);
  window.views = w->views;
  window.num_points = from.whole(0, kPoints);
  window.points = w->points;
  window.num_observations = from.whole(0, kObservations);
  window.observations = w->observations;
  window.pose_priors = w->pose_priors;
  window.gravity_priors = w->gravity_priors;
  window.distance_priors = w->distance_priors;
  for (tv_camera& camera : w->cameras) {
    camera = {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {}};
  }
  const int lens = from.whole(0, 7);
  if (lens == 0) w->cameras[1] = fuzz::camera(from.bytes);
  if (lens == 1) w->cameras[1].model = TV_CAMERA_KANNALA_BRANDT;
  for (int v = 0; v < window.num_views; ++v) {
    fill_pose(from, w->views[v].R, w->views[v].t);
    w->views[v].idx_camera = from.index(window.num_cameras);
    w->views[v].fixed = from.whole(0, 3) == 0;
  }
  for (int p = 0; p < window.num_points; ++p) {
    for (int k = 0; k < 3; ++k) w->points[3 * p + k] = from.value(-2, 2) + (k == 2 ? 5 : 0);
  }
  for (int k = 0; k < window.num_observations; ++k) {
    fill_observation(from, *w, &w->observations[k]);
  }
  fill_priors(from, w);
  for (int p = 0; p < window.num_points; ++p) {  // the start is off
    for (int k = 0; k < 3; ++k) w->points[3 * p + k] += from.value(-0.5, 0.5);
  }
}

struct Outputs {
  tv_status status;
  tv_window_view views[kViews];
  double points[3 * kPoints], covariances[36 * kViews];
  float errors_px[kObservations];
  tv_window_result result;
};

// Runs in exactly as much memory as the library asks for, full of one byte.
void run(const Window& given, const tv_window_options& options, size_t size_bytes, int byte,
         Outputs* out) {
  static Window w;
  std::memset(static_cast<void*>(out), 0, sizeof *out);
  w = given;
  w.window.views = out->views;
  w.window.points = out->points;
  std::memcpy(out->views, given.views, sizeof given.views);
  std::memcpy(out->points, given.points, sizeof given.points);
  tv_window_result_init(&out->result);
  void* memory = nullptr;
  FUZZ_REQUIRE(posix_memalign(&memory, TV_CONTEXT_ALIGNMENT, size_bytes) == 0);
  std::memset(memory, byte, size_bytes);
  out->status = tv_adjust_window(memory, size_bytes, &w.window, &options, out->covariances,
                                 out->errors_px, &out->result);
  std::free(memory);
}

void require_sound(const Window& w, const Outputs& out) {
  const tv_window_result& r = out.result;
  FUZZ_REQUIRE(r.final_cost <= r.initial_cost && r.final_cost >= 0);
  FUZZ_REQUIRE(std::isfinite(r.initial_rms_px) && std::isfinite(r.rms_px));
  FUZZ_REQUIRE(std::isfinite(r.noise_px) && r.noise_px >= 0);
  FUZZ_REQUIRE(r.num_observations + r.num_behind + r.num_invalid + r.num_single ==
               w.window.num_observations);
  FUZZ_REQUIRE(fuzz::all_finite(out.covariances, 36 * kViews));
  for (int v = 0; v < w.window.num_views; ++v) {
    FUZZ_REQUIRE(fuzz::all_finite(out.views[v].R, 9) && fuzz::all_finite(out.views[v].t, 3));
    for (int i = 0; i < 6; ++i) FUZZ_REQUIRE(out.covariances[36 * v + 7 * i] >= 0);
    if (w.views[v].fixed != 0) {
      FUZZ_REQUIRE(std::memcmp(&w.views[v], &out.views[v], sizeof w.views[v]) == 0);
    }
  }
  for (int k = 0; k < w.window.num_observations; ++k) {
    const float error = out.errors_px[k];
    FUZZ_REQUIRE(error == -1 || (error >= 0 && std::isfinite(error)));
    if (error >= 0) {
      FUZZ_REQUIRE(fuzz::all_finite(out.points + 3 * w.observations[k].idx_point, 3));
    }
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static Window w;
  static Outputs out[2];
  fuzz::Bytes bytes(data, size);
  tv_window_options options;
  tv_window_options_init(&options);
  options.loss = bytes.whole(0, 2);
  options.max_iterations = bytes.whole(0, 12);
  if (bytes.whole(0, 3) == 0) {
    options.loss_scale_px = bytes.wild(0, 10);
    options.noise_px = bytes.wild(0, 3);
    options.tolerance = bytes.wild(0, 0.1);
  }
  Source from{bytes};
  fill(from, &w);
  size_t size_bytes = 0;
  FUZZ_REQUIRE(tv_adjust_window_size(&w.window, &size_bytes) == TV_OK);
  for (int k = 0; k < 2; ++k) run(w, options, size_bytes, 255 * k, &out[k]);
  // What the memory held before does not matter.
  FUZZ_REQUIRE(std::memcmp(&out[0], &out[1], sizeof out[0]) == 0);
  if (out[0].status == TV_OK) {
    require_sound(w, out[0]);
  } else {
    FUZZ_REQUIRE(std::memcmp(w.views, out[0].views, sizeof w.views) == 0);
    FUZZ_REQUIRE(std::memcmp(w.points, out[0].points, sizeof w.points) == 0);
  }
  return 0;
}
