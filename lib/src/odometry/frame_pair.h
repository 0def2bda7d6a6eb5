// Pairs of frames or keyframes: the motion between the two by their own matches, independent of the
// map.
#pragma once

#include "odometry/odometry.h"
#include "twoview/match.h"
#include "twoview/two_view.h"

namespace tv {

struct Pair {
  const tv_correspondence* matches;
  int32_t num;
  uint8_t* is_inlier;  // of each match
  tv_two_view* view;
  tv_evidence* evidence;
};

// The keypoints as the matcher takes them.
tv_features as_features(const tv_keypoint* keypoints, const uint8_t* descriptors, int32_t num);

// All keypoints of a keyframe that has its descriptors; `keypoints` is room for them.
tv_features features_of(const Map& map, const MapKeyframe& keyframe, tv_keypoint* keypoints);

// Estimates the motion from matches of two sets of keypoints. The pair's arrays are of the
// odometry's scratch memory. False: there are too few matches.
bool estimate_pair(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                   const tv_correspondence* matches, int32_t num, Pair* pair);

// The largest standard deviation of the rotation about an axis, in radians, of a pose with this
// covariance of so many parameters, the first of which are the rotation vector; 0 of zeros.
double turn_sigma_of(const double* covariance, int num_parameters);

}  // namespace tv
