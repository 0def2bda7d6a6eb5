// What the verdict is decided from is measured here: the inliers and their residuals, the parallax,
// a second model, a lattice.
#pragma once

#include "robust/fit.h"

namespace tv {

void measure_pose(Fit& f);
void measure_inliers(Fit& f);
void look_for_second_model(Fit& f, Arena& arena);

}  // namespace tv
