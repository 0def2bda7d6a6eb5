// A caller's matches, made ready for the robust loop: rays, sorted, repeated ones last.
#pragma once

#include "base/arena.h"
#include "geometry/residuals.h"
#include "twoview/two_view.h"

namespace tv {

struct TwoViewProblem {
  bool calibrated;
  Camera camera[2];         // calibrated only
  const double* pixels[2];  // num x 2
  const float* ratios;      // or null
  int num;
  tv_estimate_options options;
  const tvk_table* kernels;  // null: those of the base ISA
};

struct Matches {
  RayPairs pairs = {};  // all usable matches; the first num_unique take part in the search
  int num_unique = 0;
  int32_t* order = nullptr;  // pairs' k-th match is the caller's order[k]
  Mat3 intrinsics[2];  // pixels (undistorted) to rays' plane: K of the view, or, uncalibrated, the
                       // similarity that normalises its points
  double area_px = 1;      // of image 1, or, uncalibrated, of the box around its points
};

size_t matches_bytes(int max_matches);

// Drops what is not finite or outside the lens model, sorts by (ratio, coordinates), puts repeated
// matches last: five times the same match is one witness, not five.
void prepare_matches(const TwoViewProblem& problem, Arena& arena, Matches* matches);

}  // namespace tv
