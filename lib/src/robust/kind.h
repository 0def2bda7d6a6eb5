// The kind of a pair: which of the epipolar model and its rivals explains the matches.
#pragma once

#include "robust/fit.h"
#include "robust/rivals.h"

namespace tv {

// A rival determines the kind only if it explains more than this share of the epipolar model's
// inliers, or of all matches where there is no epipolar model.
inline constexpr double kRivalShare = 0.7, kRivalShareAlone = 0.5;

// Chooses the kind of the pair. sample_size is that of the solver that found the epipolar model.
tv_kind choose_kind(Fit& f, const Rivals& rivals, int sample_size);

}  // namespace tv
