// The principal point is moved where many pairs of keyframes agree that it lies elsewhere.
// docs/algorithms/odometry.md, "The camera's principal point". Tests:
// test/unit/test_odometry_calibration.cc.
#pragma once

#include "odometry/odometry.h"
#include "twoview/two_view.h"

namespace tv {

// Adds the shift of the principal point that fits a pair's matches best, if they determine it.
void add_evidence(const tv_evidence& of_pair, double focal_px, CameraEvidence* evidence);

// Takes the pixel `to` as the principal point from now on, and turns the keyframes from this place
// of the map on, which were estimated with `from`, so that each sees its points where it saw them,
// to first order. Returns how they turn.
Rigid move_principal_point(Odometry* odometry, const double to[2], const double from[2],
                           int32_t first_keyframe);

// Moves the principal point where the evidence is strong enough, and begins the adjustment of the
// segment. `frame`, the last one, turns with the keyframes.
void correct_camera(Odometry* odometry, Frame* frame);

}  // namespace tv
