// Matches that stand still: what keeps its pixel while the rest of the picture moves (on-screen
// text, the frame of goggles, a watermark, the drone's own legs) is no part of the scene.
// docs/algorithms/two_view.md, what stands still. Tests: test/property/test_still.cc.
#pragma once

#include "robust/two_view.h"

namespace tv {

// How far a match that stands still moves at most, in thresholds of its pixels, which are taken as
// at least one pixel: text does not move at all, legs vibrate by a pixel, and compression moves
// corners by a fraction of one.
inline constexpr double kStillThresholds = 2;

// Sets is_still[i] to 1 for each of the problem's matches that keeps its pixel, else to 0. Returns
// how many do; 0 where they need not be looked into: they are few, the rest does not move clear of
// them, or it fills less of the picture. The cameras have images of one size.
int find_still_matches(const TwoViewProblem& problem, uint8_t* is_still);

// Whether the outcome, which was estimated without the `num_still` matches of problem.is_still,
// shows that these are no part of the scene: its own matches are many and fill more of the picture,
// and most of the others lie where no point of the scene that stays at their pixel can be, at any
// distance.
bool contradicts_still(const TwoViewProblem& problem, const Matches& matches,
                       const TwoViewOutcome& outcome, int num_still);

}  // namespace tv
