// The options of two-view estimation, which tv_reconstruct reads, too.
#pragma once

#include "twoview/two_view.h"

namespace tv {

// Copies the options (or the defaults for null) after checking them, with TV_SOLVER_AUTO resolved.
// calibrated: whether there are cameras.
tv_status read_estimate_options(const tv_estimate_options* options, bool calibrated,
                                tv_estimate_options* checked);

}  // namespace tv
