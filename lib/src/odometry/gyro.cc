#include "odometry/gyro.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/essential.h"

namespace tv {
namespace {

// How the offset of the rates wanders, per root of a second: a gyro warms up by about a degree per
// second in a minute.
constexpr double kBiasWalk = 0.002;
constexpr double kLargestTurnSigma = 0.1;  // radians, of a turn that says something
constexpr double kFrameTurnSigma = 0.001;  // of a tracked frame's attitude, in radians, at least
constexpr double kLargestSwing = 0.05;     // radians, added to three standard deviations

Mat3 turn_by(const Vec3& vector) {
  const double angle = std::sqrt(vector.dot(vector));
  return angle > 0 ? rotation_about(vector / angle, angle) : Mat3(Mat3::Identity());
}

Vec3 rate_at(const tv_gyro_sample* two, double time_s) {
  const double share = (time_s - two[0].time_s) / (two[1].time_s - two[0].time_s);
  Vec3 rate;
  for (int c = 0; c < 3; ++c) {
    rate[c] = two[0].rate_rad_s[c] + share * (two[1].rate_rad_s[c] - two[0].rate_rad_s[c]);
  }
  return rate;
}

// Of a rotation by a small angle: its vector.
Vec3 vector_of(const double R[9]) {
  const Vec3 sine(R[7] - R[5], R[2] - R[6], R[3] - R[1]);
  const double length = std::sqrt(sine.dot(sine));
  if (!(length > 0)) return Vec3::Zero();
  return sine * (atan2(length, R[0] + R[4] + R[8] - 1) / length);
}

}  // namespace

Mat3 integrated(const tv_gyro_sample* samples, int32_t num, double sigma_rad_s, double begin_s,
                double end_s, double* sigma_rad) {
  Mat3 turn = Mat3::Identity();
  // The weight of each sample in the sum of the rates times seconds; its square counts.
  double sum_sq = 0, carried = 0;
  for (int32_t k = 0; k + 1 < num; ++k) {
    const tv_gyro_sample* two = samples + k;
    const double from = std::max(begin_s, two[0].time_s), to = std::min(end_s, two[1].time_s);
    if (!(from < to)) continue;
    const double seconds = to - from;
    const Vec3 rate0 = rate_at(two, from), rate1 = rate_at(two, to);
    const Vec3 vector = seconds / 2 * (rate0 + rate1) + seconds * seconds / 12 * rate0.cross(rate1);
    turn = orthonormal_product(turn, turn_by(vector));
    const double late = ((from + to) / 2 - two[0].time_s) / (two[1].time_s - two[0].time_s);
    const double own = carried + seconds * (1 - late);
    sum_sq += own * own;
    carried = seconds * late;
  }
  *sigma_rad = sigma_rad_s * std::sqrt(sum_sq + carried * carried);
  return turn;
}

double held_sigma(const Gyro& gyro) {
  return std::sqrt(gyro.turn_variance + gyro.seconds * gyro.seconds * gyro.bias_variance);
}

void hold_turn(Odometry* odometry, const tv_odometry_frame& input, const Frame& frame) {
  Gyro* gyro = &odometry->gyro;
  const Frame& previous = odometry->previous;
  const double* velocity = frame.sensors.velocity_m_s;
  const double sigma = input.turn_sigma_rad, seconds = frame.time_s - odometry->last_time_s;
  const bool is_known = odometry->tracking.state == TrackingState::kTracked;
  gyro->is_held = sigma > 0 && sigma <= kLargestTurnSigma && seconds > 0 &&
                  is_rotation(input.previous_from_cam) && (is_known || gyro->is_held);
  if (!gyro->is_held) return;
  if (is_known) {
    gyro->cam_from_world = previous.cam_from_world;
    gyro->turn_variance = gyro->seconds = 0;
  }
  gyro->seconds += seconds;
  gyro->turn_variance += sigma * sigma;
  gyro->bias_variance += seconds * kBiasWalk * kBiasWalk;
  const Vec3 drift(gyro->bias[0], gyro->bias[1], gyro->bias[2]);
  Rigid turn = kIdentity;
  write_matrix(
      orthonormal_product(turn_by(seconds * drift), matrix_of(input.previous_from_cam).transpose()),
      turn.R);
  // The way: by the velocities in metres, or as it was from the last frame to the one before.
  double back[3];
  if (frame.sensors.velocity_sigma_m_s > 0 && odometry->scale.source != TV_SCALE_UNIT) {
    for (int c = 0; c < 3; ++c) turn.t[c] = -seconds * velocity[c];
  } else if (odometry->has_motion && odometry->motion_s > 0) {
    rotate_back(odometry->motion.R, odometry->motion.t, back);
    const double factor = std::min(seconds / odometry->motion_s, 3.0);
    for (int r = 0; r < 3; ++r) turn.t[r] = factor * dot(turn.R + 3 * r, back);
  }
  gyro->cam_from_world = orthonormalised(compose(turn, gyro->cam_from_world));
}

void measure_bias(Odometry* odometry, const Frame& frame) {
  Gyro* gyro = &odometry->gyro;
  if (!gyro->is_held || !(gyro->seconds > 0)) return;
  // The rest of the turn, on the axes of the newest camera.
  const Rigid rest = motion_between(gyro->cam_from_world, frame.cam_from_world);
  const Vec3 vector = vector_of(rest.R);
  const double sigma_sq = gyro->turn_variance + 2 * kFrameTurnSigma * kFrameTurnSigma +
                          2 * odometry->turn_sigma * odometry->turn_sigma;
  const double seconds = gyro->seconds;
  const double gain =
      gyro->bias_variance * seconds / (gyro->bias_variance * seconds * seconds + sigma_sq);
  // A frame that was tracked wrongly, or whose times are, is no evidence.
  const double most = 3 * std::sqrt(gyro->bias_variance * seconds * seconds + sigma_sq);
  if (vector.dot(vector) > 3 * most * most) return;
  for (int c = 0; c < 3; ++c) gyro->bias[c] += gain * vector[c];
  gyro->bias_variance *= 1 - gain * seconds;
}

bool agrees_with_held(const Gyro& gyro, const Rigid& cam_from_world) {
  return !gyro.is_held ||
         turn_between(gyro.cam_from_world, cam_from_world) <= kLargestSwing + 3 * held_sigma(gyro);
}

}  // namespace tv
