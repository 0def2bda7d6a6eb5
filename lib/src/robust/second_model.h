// A second model for the matches that the pair's model does not explain: a second motion, or the
// same scene matched one period off. Formula: docs/algorithms/two_view.md, second model and
// lattice. Tests: test/property/test_verdict_property.cc.
#pragma once

#include "robust/estimators.h"

namespace tv {

struct SecondModel {
  bool found = false;
  Pose pose;
  int num_inliers = 0;
};

size_t second_model_bytes(int max_matches);

// Searches the unique matches that the first model does not explain (explained[i] is 0) for a pose
// of their own. The caller also marks those matches as explained that are just outside the first
// model's threshold. A second model is found when it is meaningful among these matches (chance.h)
// and has at least kSecondShare times num_first inliers.
inline constexpr double kSecondShare = 0.15;
SecondModel find_second_model(const Matches& matches, const uint8_t* explained, int num_first,
                              double threshold_px, uint64_t seed, Arena& arena);

}  // namespace tv
