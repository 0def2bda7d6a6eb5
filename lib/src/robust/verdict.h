// The verdict and its reasons, from what was measured.
#pragma once

#include "robust/fit.h"

namespace tv {

void judge(Fit& f);

}  // namespace tv
