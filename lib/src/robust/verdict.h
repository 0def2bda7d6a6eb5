// The one judge: what is decided from what was measured of a pose. Verdict and reasons of a pair
// and of a camera before known points are decided only here, once all evidence is complete, and
// nothing changes them afterwards. Those of a pair are the same when the views are exchanged.
// docs/decisions/0007-verdict-and-covariance.md.
#pragma once

#include "robust/pair_evidence.h"

namespace tv {

struct Judgement {
  tv_verdict verdict = TV_VERDICT_REFUSED;
  uint32_t reasons = 0;
  double probability_wrong = 1;
};

Judgement judge(const Evidence& evidence);
// Of an absolute pose; there is no probability for it: 0 with a pose, else 1.
Judgement judge(const AbsoluteEvidence& evidence);

// The coverage that is reported and judged: the larger of the two views'.
double coverage_of(const Evidence& evidence);

// How many places hold an inlier, in the view where fewer do.
int least_places(const Evidence& evidence);

// Whether the geometry of the estimate with the matches of guided matching replaces that of the
// first one. Each has the verdict that it has by itself; that of the first one, and the measures
// that it is from, stay.
bool takes_guided_estimate(const tv_two_view& first, const tv_two_view& again);

}  // namespace tv
