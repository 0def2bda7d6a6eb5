#include "room_model/axes.h"

#include <algorithm>
#include <cmath>

namespace cli {
namespace {

// The share of the surface that is left out at each end of each axis: a few wrong pieces would
// otherwise make the room's size.
constexpr double kLeftOutShare = 0.01;

// Axes of which the third is up and the first two lie along the room's walls: rows of the rotation
// room_from_world.
Matrix3 room_axes(const RoomModel& model) {
  const Vector3& up = model.up;
  // Along the upright surfaces: four times their angle is the same for walls at right angles.
  Vector3 side = std::abs(up[0]) < 0.9 ? Vector3{1, 0, 0} : Vector3{0, 1, 0};
  const double along = dot(side, up);
  for (size_t k = 0; k < 3; ++k) side[k] -= along * up[k];
  const double length = norm(side);
  for (double& value : side) value /= length;
  const Vector3 other = cross(up, side);
  double cosine = 0, sine = 0;
  for (const tv_room_plane& plane : model.planes) {
    if (plane.kind != TV_ROOM_PLANE_UPRIGHT) continue;
    const Vector3 normal{plane.normal[0], plane.normal[1], plane.normal[2]};
    const double angle = 4 * std::atan2(dot(normal, other), dot(normal, side));
    cosine += plane.area * std::cos(angle);
    sine += plane.area * std::sin(angle);
  }
  const double turn = cosine == 0 && sine == 0 ? 0 : std::atan2(sine, cosine) / 4;
  Matrix3 axes;
  for (size_t k = 0; k < 3; ++k) {
    axes[k] = std::cos(turn) * side[k] + std::sin(turn) * other[k];
    axes[3 + k] = -std::sin(turn) * side[k] + std::cos(turn) * other[k];
    axes[6 + k] = up[k];
  }
  return axes;
}

// Where the central part of the surface begins and ends along an axis.
struct Range {
  double low = 0, high = 0;
};
Range range_along(const RoomModel& model, size_t axis) {
  std::vector<double> values;
  for (const tv_room_vertex& v : model.vertices) {
    double sum = 0;
    for (size_t k = 0; k < 3; ++k)
      sum += model.axes[3 * axis + k] * static_cast<double>(v.position[k]);
    values.push_back(sum);
  }
  if (values.empty()) return {};
  const auto at = [&values](double share) {
    const auto place = values.begin() +
                       static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), place, values.end());
    return *place;
  };
  const double low = at(kLeftOutShare);
  return {low, at(1 - kLeftOutShare)};
}

}  // namespace

void find_axes(RoomModel& model) {
  model.axes = room_axes(model);
  for (size_t axis = 0; axis < 3; ++axis) {
    const Range range = range_along(model, axis);
    model.size[axis] = range.high - range.low;
    if (axis == 2) model.floor = range.low;
  }
}

}  // namespace cli
