// Where up is: as a vehicle's attitudes say it, or as the cameras were held.
#pragma once

#include <optional>
#include <vector>

#include "base/matrix.h"

namespace cli {

// The direction in the world, of length 1, that cameras of these rotations (world_from_cam, x
// right, y down) were most probably held up in: people and vehicles keep the x axis level to a few
// degrees, whichever way the camera looks and however far it is tilted down, and the y axis points
// down within some tens of degrees. turn_deg: by how much a viewer turns the pictures clockwise.
Vector3 up_of_cameras(const std::vector<Matrix3>& world_from_cam, int turn_deg = 0);

// The direction down in a world, from cameras that have a pose in it and an attitude in a world
// whose z axis points down: a map that begins before the first attitude is not upright, whatever
// comes later.
class DownSum {
 public:
  // Both rotations are of the same camera: in the world in question, and in the upright one.
  void add(const Matrix3& world_from_cam, const Matrix3& upright_from_cam);
  // Of length 1; null where nothing was added, or what was added contradicts itself.
  std::optional<Vector3> down() const;

 private:
  Vector3 sum_{0, 0, 0};
  double count_ = 0;
};

}  // namespace cli
