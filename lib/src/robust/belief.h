// How probable it is that a full pose is wrong, as a logistic model of the evidence. Its
// coefficients are fitted on real pairs by scripts/belief --fit; the attempts and their figures are
// in docs/decisions/0007-verdict-and-covariance.md. Tests: test/unit/test_verdict.cc,
// test/property/test_verdict_statistics.cc.
#pragma once

#include "robust/pair_evidence.h"

namespace tv {

// A pose that is believed ("ok") is wrong with at most this probability.
inline constexpr double kMostProbabilityWrong = 0.18;

struct Belief {
  double probability_wrong;
  // The reasons (bits of tv_reason) of the evidence that raises the probability most: of the kind
  // of evidence that adds most to its logit, compared with a usual right pose, and of every other
  // that adds at least half as much.
  uint32_t raised_by;
};

// Of a full pose, calibrated or planar. The probability never falls when the agreement or the
// number of places falls, or when the noise or the region's shift rises.
Belief belief_of(const Evidence& evidence);

}  // namespace tv
