// What many pairs of one camera say together about its principal point. One pair proves little:
// wrong matches and repeated structure shift it, too, but each time to another place.
#pragma once

#include <optional>
#include <vector>

#include "twoview/twoview.h"

namespace cli {

// The test of the principal point by one pair (tv_evidence.principal_point_chi2).
struct ShiftEvidence {
  tv_camera camera;  // of both views
  double chi2, asked_px[2];
};

// The pair's test of the principal point; empty where both views are not of one camera or the test
// was not made.
std::optional<ShiftEvidence> shift_evidence(const tv_evidence& of_pair, const tv_camera& camera);

struct CameraAdvice {
  tv_camera camera;
  int num_pairs = 0;   // pairs of this camera with evidence
  int num_asking = 0;  // those that contradict the principal point at a significance of 0.001
  double asked_px[2] = {0, 0};  // the median of the shifts of these, in x and in y
  double deviation_px = 0;      // the median of their distances from it
  // At least eight pairs, more than half of which contradict the principal point, and deviation_px
  // is below half the length of asked_px.
  bool calibrate_again = false;
};

// One entry a camera, in the order in which the cameras first occur.
std::vector<CameraAdvice> advise(const std::vector<ShiftEvidence>& pairs);

}  // namespace cli
