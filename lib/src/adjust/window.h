// Bundle adjustment of a window of views. Derivations: docs/algorithms/window.md. Tests:
// test/unit/test_window.cc, test/unit/test_window_ceres.cc, test/api/test_window_api.c.
#pragma once

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/window.h"

namespace tv {

// How many bytes of arena one adjustment takes; reads the counts only.
size_t window_scratch_bytes(const tv_window& window);

// Where the adjustment begins.
struct WindowStart {
  const tvk_set* kernels;
  const double* planes = nullptr;  // two for each observation, as make_observation takes them
  double damping = 1e-4;           // of the first step, a share of the Hessian's diagonal
};

// The window has been checked. covariances, errors_px: as for tv_adjust_window; `result` is zeros.
// False, and nothing is written, where the cost at the start is not finite.
bool adjust_window(const tv_window& window, const tv_window_options& options,
                   const WindowStart& start, Arena& arena, double* covariances, float* errors_px,
                   tv_window_result* result);

}  // namespace tv
