// The bundle adjustment of a pair as it is given: the motion in units of its baseline, and back.
#pragma once

#include "pipeline/context.h"
#include "robust/bundle.h"

namespace tv {

// A motion whose t has unit length, and the length that it had.
struct Motion {
  Pose pose;
  double baseline;
};

// The motion of a pair that check_pair accepts. A baseline that is too long for a double is
// infinite.
Motion read_motion(const tv_camera_pair& pair);

// Adjusts the pair's motion, which is `motion` with a finite baseline, and the points, one for each
// match. All arguments are checked.
void adjust_pair(tv_context* context, const tv_pixel_pairs& pixels,
                 const tv_bundle_options& options, const Motion& motion, tv_camera_pair* pair,
                 tv_point* points, BundleOutcome* outcome);

}  // namespace tv
