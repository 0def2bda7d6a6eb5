#include "odometry/metric.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/essential.h"
#include "geometry/vector3.h"

namespace tv {
namespace {

constexpr double kLargestScaleSigma = 0.1;  // relative
// What the map's own scale may drift by, relative: added to the standard deviation.
constexpr double kScaleDrift = 0.007;
constexpr double kLeastChange = 0.01;    // of the scale, for which the map is rescaled
constexpr double kLargestTilt = 0.1;     // radians, added to three standard deviations
constexpr double kLargestMeasure = 1e7;  // metres, metres per second: above it, no sensor is right
constexpr double kDown[3] = {0, 0, 1};   // in an upright world

bool is_usable(double sigma) { return sigma >= 1 / kLargestMeasure && sigma <= kLargestMeasure; }

// The map's unit becomes `scale` of what it was.
void rescale(Odometry* odometry, double scale, Frame* frame) {
  Map& map = odometry->map;
  for (int32_t k = 0; k < map.num_keyframes; ++k) {
    MapKeyframe& keyframe = map.keyframes[k];
    if (keyframe.segment != odometry->segment) continue;
    for (double& t : keyframe.cam_from_world.t) t *= scale;
    keyframe.scale *= scale;
  }
  for (int32_t p = 0; p < map.end_points; ++p) {
    MapPoint& point = map.points[p];
    if (point.id < 0 || point.segment != odometry->segment) continue;
    for (double& x : point.position) x *= scale;
    for (float& x : point.seen_from) x = static_cast<float>(static_cast<double>(x) * scale);
  }
  for (double& t : frame->cam_from_world.t) t *= scale;
  for (double& t : odometry->motion.t) t *= scale;
  odometry->median_depth *= scale;
}

}  // namespace

void read_sensors(const tv_odometry_frame& input, Frame* frame) {
  const double sigmas[3] = {input.attitude_sigma_rad, input.height_sigma_m,
                            input.velocity_sigma_m_s};
  frame->sensors = Sensors{};
  Sensors* s = &frame->sensors;
  if (is_finite(sigmas[0]) && sigmas[0] > 0 && all_finite(input.world_from_cam, 9) &&
      is_rotation(input.world_from_cam)) {
    std::copy_n(input.world_from_cam, 9, s->world_from_cam);
    s->attitude_sigma_rad = std::min(std::max(sigmas[0], 1e-4), 3.0);
  }
  if (is_usable(sigmas[1]) && std::fabs(input.height_m) <= kLargestMeasure) {
    s->height_m = input.height_m;
    s->height_sigma_m = sigmas[1];
  }
  const double* v = input.velocity_m_s;
  if (is_usable(sigmas[2]) && all_finite(v, 3) && std::sqrt(dot(v, v)) <= kLargestMeasure) {
    std::copy_n(input.velocity_m_s, 3, s->velocity_m_s);
    s->velocity_sigma_m_s = sigmas[2];
  }
}

bool check_attitude(const Odometry& odometry, Frame* frame) {
  Sensors* s = &frame->sensors;
  if (!odometry.is_upright || s->attitude_sigma_rad == 0) return true;
  const double* R = frame->cam_from_world.R;
  const double here[3] = {R[2], R[5], R[8]};  // down in the camera's frame
  double across[3];
  cross(here, s->world_from_cam + 6, across);
  const double tilt = atan2(length_of(across), dot(here, s->world_from_cam + 6));
  if (tilt <= kLargestTilt + 3 * s->attitude_sigma_rad) return true;
  s->attitude_sigma_rad = 0;
  return false;
}

void add_travel(Odometry* odometry, const Frame& frame) {
  const double seconds = frame.time_s - odometry->previous.time_s;
  const Sensors& s = frame.sensors;
  if (s.velocity_sigma_m_s == 0) {
    odometry->travel_is_known = false;
    return;
  }
  const Rigid world_from_cam = inverse(frame.cam_from_world);
  for (int c = 0; c < 3; ++c) {
    odometry->travel_m[c] += seconds * dot(world_from_cam.R + 3 * c, s.velocity_m_s);
  }
  const double sigma = seconds * s.velocity_sigma_m_s;
  odometry->travel_variance += sigma * sigma;
}

void forget_travel(Odometry* odometry) {
  std::fill(odometry->travel_m, odometry->travel_m + 3, 0.0);
  odometry->travel_variance = 0;
  odometry->travel_is_known = true;
}

void forget_scale(Odometry* odometry) {
  odometry->scale_product = odometry->scale_square = 0;
  odometry->scale_evidence = odometry->scale_source = TV_SCALE_UNIT;
  odometry->scale_sigma = 0;
  forget_travel(odometry);
}

void measure_scale(Odometry* odometry, Frame* frame) {
  Map& map = odometry->map;
  if (map.num_keyframes < 2) return;
  MapKeyframe& newest = map.keyframes[map.num_keyframes - 1];
  const MapKeyframe& before = map.keyframes[map.num_keyframes - 2];
  newest.height_m = frame->sensors.height_m;
  newest.height_sigma_m = frame->sensors.height_sigma_m;
  double a[3], b[3], way[3];
  centre_of(before.cam_from_world, a);
  centre_of(newest.cam_from_world, b);
  for (int c = 0; c < 3; ++c) way[c] = b[c] - a[c];
  const bool follows = newest.segment == before.segment;
  if (follows && odometry->travel_is_known && odometry->travel_variance > 0) {
    // Least squares of travel = scale way, along each axis.
    odometry->scale_product += dot(odometry->travel_m, way) / odometry->travel_variance;
    odometry->scale_square += dot(way, way) / odometry->travel_variance;
    odometry->scale_evidence |= TV_SCALE_VELOCITY;
  }
  forget_travel(odometry);
  if (follows && odometry->is_upright && newest.height_sigma_m > 0 && before.height_sigma_m > 0) {
    const double variance = newest.height_sigma_m * newest.height_sigma_m +
                            before.height_sigma_m * before.height_sigma_m;
    const double climb = -dot(kDown, way);
    odometry->scale_product += (newest.height_m - before.height_m) * climb / variance;
    odometry->scale_square += climb * climb / variance;
    odometry->scale_evidence |= TV_SCALE_HEIGHT;
  }
  if (!(odometry->scale_square > 0)) return;
  const double scale = odometry->scale_product / odometry->scale_square;
  const double sigma = 1 / std::sqrt(odometry->scale_square);
  if (!(scale > 0) || !(sigma <= kLargestScaleSigma * scale)) return;
  odometry->scale_sigma = std::sqrt(sigma * sigma / (scale * scale) + kScaleDrift * kScaleDrift);
  const bool is_new = odometry->scale_source == TV_SCALE_UNIT;
  odometry->scale_source = odometry->scale_evidence;
  if (!is_new && std::fabs(scale - 1) < kLeastChange) return;
  rescale(odometry, scale, frame);
  odometry->scale_product *= scale;
  odometry->scale_square *= scale * scale;
}

}  // namespace tv
