// Where up is, where no sensor says it.
#pragma once

#include <vector>

#include "base/matrix.h"

namespace cli {

// The direction in the world, of length 1, that cameras of these rotations (world_from_cam, x
// right, y down) were most probably held up in: people and vehicles keep the x axis level to a few
// degrees, whichever way the camera looks and however far it is tilted down, and the y axis points
// down within some tens of degrees. turn_deg: by how much a viewer turns the pictures clockwise.
Vector3 up_of_cameras(const std::vector<Matrix3>& world_from_cam, int turn_deg = 0);

}  // namespace cli
