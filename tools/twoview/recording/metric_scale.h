// The metric scale of a two-view reconstruction from a drone's sensors: the distance between the
// two camera positions, estimated by each sensor on its own, with its standard deviation. World: z
// down. Body: x forward, y right, z down (twoview_drivers/source.h).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "pair/result.h"

namespace cli {

// One instant of the log; what was not measured is empty.
struct FlightSample {
  double time_s = 0;
  // Counts the starts of the drone. Times and world frames of different runs are not comparable.
  uint32_t run = 0;
  Matrix3 world_from_body{};
  double attitude_sigma_rad = 0;
  std::optional<Vector3> velocity_m_s;  // body axes
  double velocity_sigma = 0;            // of each component, the same error throughout
  std::optional<double> altitude_m;     // above the ground below, up is positive
  double altitude_sigma = 0;
};
using FlightLog = std::vector<FlightSample>;  // by time

// Where the camera is in the body.
struct CameraMount {
  Matrix3 body_from_camera{0, 0, 1, 1, 0, 0, 0, 1, 0};  // looks forward
  Vector3 position{0, 0, 0};                            // metres, body axes
};

// The attitude at a time, between neighbours of one run at most max_gap_s apart; nothing elsewhere.
std::optional<FlightSample> sample_at(const FlightLog& log, double time_s, double max_gap_s);

// Body velocity, turned into the world and integrated (trapezoids) from time0 to time1, and the way
// of the camera about the body. Nothing where the log has a gap or the way is less than 3 sigma.
std::optional<MetricScale> scale_by_velocity(const FlightLog& log, double time0_s, double time1_s,
                                             const CameraMount& mount);

// The change of altitude over the vertical part of the unit vector from camera 0 to camera 1 in
// the world. Nothing where the change is less than 3 sigma, or an altitude is not known.
// direction_sigma_rad: of that vector.
std::optional<MetricScale> scale_by_altitude(const FlightLog& log, double time0_s, double time1_s,
                                             const Vector3& unit_way, double direction_sigma_rad,
                                             const CameraMount& mount);

// The altitude over the height above a floor that is seen: of the points (camera 0's frame, units
// of the baseline), the lowest level layer that holds enough of them. Nothing without such a layer.
std::optional<MetricScale> scale_by_floor(const FlightLog& log, double time0_s,
                                          const std::vector<Vector3>& points,
                                          const CameraMount& mount);

// The one with the least relative sigma, if that is at most 0.25.
std::optional<MetricScale> best_scale(const std::vector<std::optional<MetricScale>>& found);

}  // namespace cli
