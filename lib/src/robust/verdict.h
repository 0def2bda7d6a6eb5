// The verdict and its reasons: what was measured of a pair, and what is decided from it. Verdict
// and reasons are decided only here, and only from Evidence. They are the same when the views are
// exchanged. docs/decisions/0007-verdict-and-covariance.md.
#pragma once

#include "robust/pair_evidence.h"

namespace tv {

struct Judgement {
  tv_verdict verdict = TV_VERDICT_REFUSED;
  uint32_t reasons = 0;
  double probability_wrong = 1;
};

Judgement judge(const Evidence& evidence);

// The coverage that is reported and judged: the larger of the two views'.
double coverage_of(const Evidence& evidence);

// Gives an estimate a reason that its matches do not show, only their descriptors:
// TV_REASON_LOW_INLIER_RATIO where the pictures match better when one of them is mirrored,
// TV_REASON_REPEATED_STRUCTURE where most inliers have a second place that looks the same.
void doubt(tv_reason reason, tv_two_view* estimate);

// Whether the estimate with the matches of guided matching replaces the first one. Where it does,
// it is given the first one's verdict, reasons and tests of the cameras.
bool takes_guided_estimate(const tv_two_view& first, tv_two_view* again);

}  // namespace tv
