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

// The attitude at a time, interpolated between samples of one run that are at most max_gap_s apart;
// empty if there are none.
std::optional<FlightSample> sample_at(const FlightLog& log, double time_s, double max_gap_s);

// Scale by velocity: the body velocity is rotated to the world and integrated (trapezoids) from
// time0 to time1, and the motion of the camera relative to the body is added. Empty if the log has
// a gap or the distance is less than 3 sigma.
std::optional<MetricScale> scale_by_velocity(const FlightLog& log, double time0_s, double time1_s,
                                             const CameraMount& mount);

// Scale by altitude: the change of altitude divided by the vertical component of the unit vector
// from camera 0 to camera 1 in the world. Empty if the change is less than 3 sigma or an altitude
// is unknown. direction_sigma_rad is the standard deviation of that unit vector.
std::optional<MetricScale> scale_by_altitude(const FlightLog& log, double time0_s, double time1_s,
                                             const Vector3& unit_way, double direction_sigma_rad,
                                             const CameraMount& mount);

// Scale by floor: the measured altitude divided by the height of the camera above the floor in the
// cloud, in baselines. The floor is the lowest horizontal layer of the points (in camera 0's frame)
// that holds enough of them; empty without such a layer.
std::optional<MetricScale> scale_by_floor(const FlightLog& log, double time0_s,
                                          const std::vector<Vector3>& points,
                                          const CameraMount& mount);

// The scale with the smallest relative sigma, if that is at most 0.25; otherwise empty.
std::optional<MetricScale> best_scale(const std::vector<std::optional<MetricScale>>& found);

}  // namespace cli
