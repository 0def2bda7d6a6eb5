// The search for an absolute pose: the robust loop with the solver for three points, and whether
// what it found is more than chance. docs/algorithms/absolute_pose.md. Tests:
// test/unit/test_absolute_pose.cc.
#pragma once

#include "pose/sightings.h"
#include "twoview/absolute_pose.h"

namespace tv {

struct AbsolutePoseSearch {
  bool found = false;
  Pose pose;  // of the points as Sightings has them
  int num_iterations = 0;
};

// progressive: the matches are in the order of their ratios, and the first ones are sampled first.
// Takes an int32_t a match from the arena.
void search_absolute_pose(const Sightings& sightings, const tv_absolute_pose_options& options,
                          bool progressive, Arena& arena, AbsolutePoseSearch* search);

// Writes the indices of the different matches within limit_px of a pose, and returns how many.
int near_sightings(const Sightings& sightings, const Pose& pose, double limit_px, int32_t* indices);

// Whether a pose has more inliers than chance explains: of the different matches, num_inliers are
// within the threshold.
bool is_meaningful(const SightingInput& input, const Sightings& sightings, const Pose& pose,
                   int num_inliers, const tv_absolute_pose_options& options);

}  // namespace tv
