// Bundle adjustment of the keyframes around one of them.
#pragma once

#include "odometry/odometry.h"

namespace tv {

size_t adjust_bytes(const tv_odometry_options& options);

// Adjusts a keyframe, those that share most points with it, and their points; then forgets the
// observations that do not fit, and removes the points that fewer than two keyframes see.
void adjust_around(Odometry* odometry, int32_t keyframe, int32_t max_iterations);

// Estimates the covariance of a keyframe's pose relative to the keyframe before it. False: they do
// not determine it.
bool estimate_covariance(Odometry* odometry, int32_t keyframe, double covariance[36]);

// How many points each keyframe shares with one of them, which itself has 2^30; 0 for keyframes of
// other segments.
void count_shared(Odometry* odometry, int32_t keyframe, int32_t* shared);

// The indices of at most `count` of `num` numbers, the largest first, none below `least`; the later
// of equal ones first. Returns how many.
int32_t largest(const int32_t* numbers, int32_t num, int32_t least, int32_t count, int32_t* chosen);

}  // namespace tv
