// Measures what the verdict is decided from (Evidence in pair_evidence.h), once the kind and the
// pose are known: inliers and their residuals, coverage, parallax, lines of points, a second model,
// lattices.
#pragma once

#include "robust/fit.h"

namespace tv {

// Writes outcome.evidence, but for `kind` and `has_alternative`, which are known before, and
// outcome.rms_error_px.
void measure_evidence(Fit& f, Arena& arena);

size_t evidence_bytes(int max_matches);

}  // namespace tv
