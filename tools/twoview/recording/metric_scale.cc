#include "recording/metric_scale.h"

#include <algorithm>
#include <cmath>

#include "twoview_drivers/attitude.h"

namespace cli {
namespace {

// The longest gap in the flight log over which attitudes are interpolated and velocities
// integrated, seconds. Demo mode gives 15 samples a second.
constexpr double kMaxGapS = 0.25;
// Altitudes are averaged over this time before and after an instant.
constexpr double kAltitudeWindowS = 0.1;
constexpr double kLayer = 0.04;  // thickness of a floor as a share of its distance below the camera
constexpr size_t kLeastFloor = 20;    // least number of points of a floor
constexpr double kFloorShare = 0.05;  // least share of all points that a floor must hold
constexpr double kWorstShare = 0.25;
// Two sources contradict each other above the quantile 0.999 of chi squared of one degree of
// freedom.
constexpr double kContradicted = 10.83;

Vector3 plus(const Vector3& a, const Vector3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Vector3 times(double s, const Vector3& a) { return {s * a[0], s * a[1], s * a[2]}; }

// The quaternion w x y z of a rotation matrix.
void to_quaternion(const Matrix3& m, double q[4]) {
  const double trace = m[0] + m[4] + m[8];
  const double squares[4] = {1 + trace, 1 + 2 * m[0] - trace, 1 + 2 * m[4] - trace,
                             1 + 2 * m[8] - trace};
  const size_t largest = static_cast<size_t>(std::max_element(squares, squares + 4) - squares);
  const double s = 0.5 / std::sqrt(squares[largest]);
  const double x = m[7] - m[5], y = m[2] - m[6], z = m[3] - m[1];
  const double xy = m[1] + m[3], xz = m[2] + m[6], yz = m[5] + m[7];
  const double table[4][4] = {{squares[0], x, y, z},
                              {x, squares[1], xy, xz},
                              {y, xy, squares[2], yz},
                              {z, xz, yz, squares[3]}};
  for (size_t k = 0; k < 4; ++k) q[k] = table[largest][k] * s;
}

Matrix3 to_matrix(const double q[4]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

// Interpolates rotations by share in [0, 1] along the geodesic, with the drivers' slerp.
Matrix3 between(const Matrix3& a, const Matrix3& b, double share) {
  double qa[4], qb[4], q[4];
  to_quaternion(a, qa);
  to_quaternion(b, qb);
  tvs_slerp(qa, qb, share, q);
  return to_matrix(q);
}

// The mean of the altitudes near a time, and its standard deviation. All samples share one error,
// so averaging does not reduce it.
std::optional<std::pair<double, double>> altitude_at(const FlightLog& log, double time_s) {
  double sum = 0, sigma = 0;
  int count = 0;
  for (const FlightSample& sample : log) {
    if (std::abs(sample.time_s - time_s) > kAltitudeWindowS || !sample.altitude_m) continue;
    sum += *sample.altitude_m;
    sigma = std::max(sigma, sample.altitude_sigma);
    ++count;
  }
  if (count == 0) return {};
  return std::make_pair(sum / count, sigma);
}

bool is_usable(const std::optional<MetricScale>& scale) {
  return scale && scale->sigma_m <= kWorstShare * std::abs(scale->baseline_m);
}

double camera_height(const FlightSample& at, double altitude, const CameraMount& mount) {
  return altitude - applied(at.world_from_body, mount.position)[2];
}

}  // namespace

std::optional<FlightSample> sample_at(const FlightLog& log, double time_s, double max_gap_s) {
  const auto after = std::lower_bound(
      log.begin(), log.end(), time_s,
      [](const FlightSample& sample, double time) { return sample.time_s < time; });
  if (after == log.end()) return {};
  if (after->time_s == time_s) return *after;
  if (after == log.begin()) return {};
  const FlightSample &a = *(after - 1), &b = *after;
  const double gap = b.time_s - a.time_s;
  if (gap > max_gap_s || a.run != b.run) return {};
  const double share = (time_s - a.time_s) / gap;
  FlightSample at = share < 0.5 ? a : b;
  at.time_s = time_s;
  at.world_from_body = between(a.world_from_body, b.world_from_body, share);
  at.attitude_sigma_rad = std::max(a.attitude_sigma_rad, b.attitude_sigma_rad);
  at.velocity_m_s.reset();
  if (a.velocity_m_s && b.velocity_m_s)
    at.velocity_m_s = plus(times(1 - share, *a.velocity_m_s), times(share, *b.velocity_m_s));
  return at;
}

std::optional<MetricScale> scale_by_velocity(const FlightLog& log, double time0_s, double time1_s,
                                             const CameraMount& mount,
                                             const std::optional<Vector3>& unit_way) {
  const double from = std::min(time0_s, time1_s), to = std::max(time0_s, time1_s);
  const std::optional<FlightSample> first = sample_at(log, from, kMaxGapS);
  const std::optional<FlightSample> last = sample_at(log, to, kMaxGapS);
  if (!first || !last || first->run != last->run) return {};
  FlightLog part = {*first};
  for (const FlightSample& sample : log)
    if (sample.time_s > from && sample.time_s < to) part.push_back(sample);
  part.push_back(*last);
  Vector3 way = {0, 0, 0};
  double sigma = 0;
  for (size_t k = 0; k + 1 < part.size(); ++k) {
    const FlightSample &a = part[k], &b = part[k + 1];
    const double dt = b.time_s - a.time_s;
    if (!a.velocity_m_s || !b.velocity_m_s || dt > kMaxGapS) return {};
    const Vector3 va = applied(a.world_from_body, *a.velocity_m_s);
    const Vector3 vb = applied(b.world_from_body, *b.velocity_m_s);
    way = plus(way, times(0.5 * dt, plus(va, vb)));
    sigma = std::max(sigma, std::max(a.velocity_sigma, b.velocity_sigma));
  }
  way = plus(way, minus(applied(last->world_from_body, mount.position),
                        applied(first->world_from_body, mount.position)));
  MetricScale scale{"velocity", norm(way), sigma * (to - from)};
  if (!(scale.baseline_m > 3 * scale.sigma_m)) return {};
  if (unit_way) {
    // The measured way has another direction than that of the pictures. Its part along the
    // pictures' direction is taken as the baseline, and the difference of the two lengths as
    // uncertain.
    const double along = (time0_s <= time1_s ? 1 : -1) * dot(way, *unit_way);
    scale.sigma_m = std::hypot(scale.sigma_m, scale.baseline_m - along);
    scale.baseline_m = along;
  }
  return scale;
}

std::optional<MetricScale> scale_by_altitude(const FlightLog& log, double time0_s, double time1_s,
                                             const Vector3& unit_way, double direction_sigma_rad,
                                             const CameraMount& mount) {
  const auto altitude0 = altitude_at(log, time0_s), altitude1 = altitude_at(log, time1_s);
  const std::optional<FlightSample> at0 = sample_at(log, time0_s, kMaxGapS);
  const std::optional<FlightSample> at1 = sample_at(log, time1_s, kMaxGapS);
  if (!altitude0 || !altitude1 || !at0 || !at1 || at0->run != at1->run) return {};
  const double climb =
      camera_height(*at1, altitude1->first, mount) - camera_height(*at0, altitude0->first, mount);
  const double climb_sigma = std::hypot(altitude0->second, altitude1->second);
  const double up = -unit_way[2];
  if (!(std::abs(climb) > 3 * climb_sigma) || up == 0) return {};
  // An error of angle e in the direction changes its vertical component by e times its horizontal
  // component.
  const double level = std::sqrt(std::max(0.0, 1 - up * up));
  const double direction_sigma = std::hypot(direction_sigma_rad, at0->attitude_sigma_rad);
  const double baseline = climb / up;
  const double sigma = std::hypot(climb_sigma / up, baseline * direction_sigma * level / up);
  return MetricScale{"altitude", baseline, sigma};
}

std::optional<MetricScale> scale_by_floor(const FlightLog& log, double time0_s,
                                          const std::vector<Vector3>& points,
                                          const CameraMount& mount) {
  const auto altitude = altitude_at(log, time0_s);
  const std::optional<FlightSample> at = sample_at(log, time0_s, kMaxGapS);
  if (!altitude || !at) return {};
  const Matrix3 world_from_camera = product(at->world_from_body, mount.body_from_camera);
  struct Below {
    double depth, level_distance;
  };
  std::vector<Below> below;  // the points that lie below the camera
  for (const Vector3& point : points) {
    const Vector3 p = applied(world_from_camera, point);
    if (p[2] > 0) below.push_back({p[2], std::hypot(p[0], p[1])});
  }
  std::sort(below.begin(), below.end(),
            [](const Below& a, const Below& b) { return a.depth < b.depth; });
  const size_t least =
      std::max(kLeastFloor, static_cast<size_t>(kFloorShare * static_cast<double>(points.size())));
  // Searches upwards for the lowest layer that has enough points.
  for (size_t last = below.size(); last-- > 0;) {
    const double top = below[last].depth * (1 - kLayer);
    const auto first = std::lower_bound(below.begin(), below.end(), top,
                                        [](const Below& b, double d) { return b.depth < d; });
    const size_t begin = static_cast<size_t>(first - below.begin()), count = last + 1 - begin;
    if (count < least) continue;
    const double depth = below[begin + count / 2].depth;
    double far = 0, spread = 0;
    for (size_t k = begin; k <= last; ++k) {
      far += below[k].level_distance / static_cast<double>(count);
      spread += (below[k].depth - depth) * (below[k].depth - depth) / static_cast<double>(count);
    }
    const double height = camera_height(*at, altitude->first, mount);
    if (!(height > 3 * altitude->second)) return {};
    const double baseline = height / depth;
    // A tilt error of some angle moves the floor by that angle times its horizontal distance.
    const double tilt = at->attitude_sigma_rad * far / depth;
    const double scatter = std::sqrt(spread / static_cast<double>(count)) / depth;
    const double relative = std::hypot(std::hypot(altitude->second / height, tilt), scatter);
    return MetricScale{"floor", baseline, baseline * relative};
  }
  return {};
}

std::optional<ContraryScales> contrary_scales(
    const std::vector<std::optional<MetricScale>>& found) {
  for (size_t i = 0; i < found.size(); ++i) {
    for (size_t k = i + 1; k < found.size(); ++k) {
      if (!is_usable(found[i]) || !is_usable(found[k])) continue;
      const double difference = found[i]->baseline_m - found[k]->baseline_m;
      const double sigma = std::hypot(found[i]->sigma_m, found[k]->sigma_m);
      if (difference * difference > kContradicted * sigma * sigma)
        return ContraryScales{*found[i], *found[k]};
    }
  }
  return {};
}

std::optional<MetricScale> best_scale(const std::vector<std::optional<MetricScale>>& found) {
  if (contrary_scales(found)) return {};
  std::optional<MetricScale> best;
  for (const std::optional<MetricScale>& scale : found) {
    if (!is_usable(scale) || !(scale->baseline_m > 0)) continue;
    if (!best || scale->sigma_m * best->baseline_m < best->sigma_m * scale->baseline_m)
      best = scale;
  }
  return best;
}

}  // namespace cli
