// Checks of two-view estimation that tv_reconstruct shares.
#pragma once

#include "twoview/two_view.h"

namespace tv {

// Copies the options (or the defaults for null) after checking them, with TV_SOLVER_AUTO resolved.
// calibrated: whether there are cameras.
tv_status read_estimate_options(const tv_estimate_options* options, bool calibrated,
                                tv_estimate_options* checked);

// Checks two cameras, which may both be null.
tv_status check_cameras(const tv_camera* camera0, const tv_camera* camera1);

}  // namespace tv
