#include "odometry/view.h"

#include <algorithm>

#include "base/upright.h"

namespace cli {

MapView view_of(const Flight& flight, const std::vector<FlightKeyframe>& keyframes,
                int32_t segment) {
  constexpr double kLevel = 0.9994;  // cosine of 2 degrees, within which z points down
  const std::optional<Vector3> measured = flight.down(segment);
  if (measured && (*measured)[2] > kLevel) return {{0, 1, 0, 0, 0, 1, 1, 0, 0}, true};
  std::vector<Matrix3> held;
  for (const FlightKeyframe& key : keyframes) {
    if (key.keyframe.segment != segment) continue;
    held.emplace_back();
    std::copy_n(key.keyframe.world_from_cam_R, 9, held.back().begin());
  }
  if (held.empty()) return {};
  const Vector3 up = up_of_cameras(held, flight.turn_deg());
  const Vector3 down = measured.value_or(Vector3{-up[0], -up[1], -up[2]});
  // "Right" is to the right of where the first keyframe looks; where it looks straight down, it is
  // that camera's own right.
  const Matrix3& first = held.front();
  Vector3 right = cross(down, {first[2], first[5], first[8]});
  if (norm(right) < 0.1) right = cross(cross(down, {first[0], first[3], first[6]}), down);
  const double length = norm(right);
  for (double& value : right) value /= length;
  const Vector3 ahead = cross(right, down);
  return {{right[0], right[1], right[2], down[0], down[1], down[2], ahead[0], ahead[1], ahead[2]},
          measured.has_value()};
}

}  // namespace cli
