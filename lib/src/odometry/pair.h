// Two frames or keyframes by themselves: what their own matches say of the motion between them,
// without the map.
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
};

// How many bytes of scratch a pair takes.
size_t pair_bytes(const tv_odometry_options& options);

// The keypoints as the matcher takes them.
tv_features as_features(const tv_keypoint* keypoints, const uint8_t* descriptors, int32_t num);

// Estimates the motion from matches of two sets of keypoints. The pair's arrays are of the
// odometry's scratch memory. False: there are too few matches.
bool estimate_pair(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                   const tv_correspondence* matches, int32_t num, Pair* pair);

// What pairs of keyframes say of the map.
enum class MapCheck {
  kUnknown,      // the pairs do not determine their motion
  kAgrees,       // a pair that is beyond doubt turned as the map says
  kOnePlane,     // most pairs see one plane, which two motions explain
  kContradicts,  // two pairs that are beyond doubt turned otherwise
};

// Counts the pairs of a keyframe with others, as long as they are needed.
struct MapVote {
  int32_t num_pairs, num_agree, num_disagree, num_planar;
};

// Estimates a pair and adds what it says of its keyframes' relative pose cam1_from_cam0.
void add_vote(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
              const tv_correspondence* matches, int32_t num, const Rigid& cam1_from_cam0,
              MapVote* vote);

// Whether another pair may change the result.
bool needs_vote(const MapVote& vote);
MapCheck result_of(const MapVote& vote);

}  // namespace tv
