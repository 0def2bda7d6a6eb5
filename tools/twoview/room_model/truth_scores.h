// How a room's surface compares with the true one.
#pragma once

#include <optional>
#include <string>

#include "base/matrix.h"

namespace cli {

// y = scale R x + t.
struct Placement {
  double scale = 1;
  Matrix3 R{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 t{0, 0, 0};
  Vector3 of(const Vector3& x) const;
};

// Shares, and medians in metres; a share of nothing and the median of nothing are empty.
struct TruthScores {
  std::optional<double> precision, precision_measured, precision_inferred;
  double recall = 0, f = 0;
  std::optional<double> accuracy_median, completeness_median;
};

struct RoomTruth {
  TruthScores placed, registered;
  Placement registration;     // truth_from_truth: what registered the surface after placing it
  double share_judged = 1;    // of the room's surface
  double share_of_truth = 0;  // that at least two keyframes could see
  std::string placed_by;
};

}  // namespace cli
