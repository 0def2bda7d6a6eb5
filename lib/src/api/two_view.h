// The options and the evidence of two-view estimation, which are tv_reconstruct's, too.
#pragma once

#include "robust/pair_evidence.h"
#include "twoview/two_view.h"

namespace tv {

// Copies the options (or the defaults for null) after checking them, with TV_SOLVER_AUTO resolved.
// calibrated: whether there are cameras.
tv_status read_estimate_options(const tv_estimate_options* options, bool calibrated,
                                tv_estimate_options* checked);

// Writes the evidence where it was asked for: nothing, for null.
void pack_evidence(const Evidence& evidence, tv_evidence* written);

}  // namespace tv
