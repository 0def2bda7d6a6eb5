// The metric scale of a two-view reconstruction from a drone's sensors: the distance between the
// two camera positions, estimated by each sensor on its own, with its standard deviation. World: z
// down. Body: x forward, y right, z down (twoview_drivers/source.h).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "pair/result.h"

namespace cli {

// One instant of the log; a quantity that was not measured is empty.
struct FlightSample {
  double time_s = 0;
  // The number of the drone's start. Times and world frames of different runs are not comparable.
  uint32_t run = 0;
  Matrix3 world_from_body{};
  double attitude_sigma_rad = 0;
  std::optional<Vector3> velocity_m_s;  // in body axes
  double velocity_sigma = 0;            // m/s, of each component; all samples share one error
  std::optional<double> altitude_m;     // height above the ground below the drone
  double altitude_sigma = 0;
};
using FlightLog = std::vector<FlightSample>;  // samples sorted by time

// The pose of the camera in the frame of the drone's body.
struct CameraMount {
  Matrix3 body_from_camera{0, 0, 1, 1, 0, 0, 0, 1, 0};  // default: a camera that looks forward
  Vector3 position{0, 0, 0};                            // in body axes, metres
};

// The sample at a time between two samples of one run that are at most max_gap_s apart: attitude
// and velocity are interpolated, the altitude is that of the nearer sample. Empty if there are no
// such samples.
std::optional<FlightSample> sample_at(const FlightLog& log, double time_s, double max_gap_s);

// Scale by velocity: the body velocity is rotated to the world and integrated (trapezoids) from
// time0 to time1, and the motion of the camera relative to the body is added. With unit_way, the
// unit vector in the world from camera 0 to camera 1 as the pictures say, the baseline is the part
// along it, and what is missing to the whole way belongs to its sigma. Empty if the log has a gap
// of more than 0.25 s, a sample without velocity or two runs, or if the distance is at most 3
// sigma.
std::optional<MetricScale> scale_by_velocity(const FlightLog& log, double time0_s, double time1_s,
                                             const CameraMount& mount,
                                             const std::optional<Vector3>& unit_way = {});

// Scale by altitude: the camera's climb divided by the upward component of unit_way, the unit
// vector in the world from camera 0 to camera 1. direction_sigma_rad is the standard deviation of
// its direction. Empty if an altitude or attitude is unknown, if the instants belong to two runs,
// or if the climb is at most 3 sigma. Negative where the altitude sinks and the camera climbs: it
// contradicts all others.
std::optional<MetricScale> scale_by_altitude(const FlightLog& log, double time0_s, double time1_s,
                                             const Vector3& unit_way, double direction_sigma_rad,
                                             const CameraMount& mount);

// Scale by floor: the camera's measured height above the floor in metres, divided by its height
// above the floor in the cloud, which is in baselines. The floor is the lowest horizontal layer of
// the points (in camera 0's frame) that holds enough of them. Empty without such a layer, if the
// altitude or attitude at time0 is unknown, or if the measured height is at most 3 sigma.
std::optional<MetricScale> scale_by_floor(const FlightLog& log, double time0_s,
                                          const std::vector<Vector3>& points,
                                          const CameraMount& mount);

// Two sources that contradict each other by more than their sigmas: nobody knows which is wrong.
struct ContraryScales {
  MetricScale one, other;
};
// The first two of those whose relative sigma is at most 0.25, else empty.
std::optional<ContraryScales> contrary_scales(const std::vector<std::optional<MetricScale>>& found);

// The scale with the smallest relative sigma, if that is at most 0.25; empty otherwise, and where
// two sources contradict each other.
std::optional<MetricScale> best_scale(const std::vector<std::optional<MetricScale>>& found);

}  // namespace cli
