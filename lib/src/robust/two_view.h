// Two-view estimation behind the API boundary: its two halves, search (search.cc) and finish
// (finish.cc), and what they hand on.
#pragma once

#include "robust/gravity.h"
#include "robust/matches.h"
#include "robust/verdict.h"

namespace tv {

// An epipolar model of the pair, on rays.
struct EpipolarModel {
  bool found = false;
  bool has_pose = false;
  Pose pose;
  Mat3 M = Mat3::Zero();  // E = [t]x R, or the uncalibrated matrix
};

// The model as the search leaves it and as refinement ends it.
struct TwoViewModel {
  EpipolarModel epipolar;
  int num_iterations = 0;
};

// All that the boundary packs. In canonical view order, on rays.
struct TwoViewOutcome {
  Evidence evidence;  // with the kind
  Judgement judgement;
  EpipolarModel epipolar;
  bool has_R = false, has_t = false, has_H = false, has_covariance = false,
       has_alternative_covariance = false;
  Mat3 H = Mat3::Zero();
  Pose alternative;
  double covariance[25] = {}, alternative_covariance[25] = {};
  int essential_inliers = -1, fundamental_inliers = -1, homography_inliers = -1,
      rotation_inliers = -1;
  double principal_point_shift_px[2] = {0, 0};  // taken into account in all that is here
  double rms_error_px = 0;
  uint8_t* inlier = nullptr;  // of all matches, repeats included
};

// The arena that one estimate takes.
size_t two_view_scratch_bytes(int max_matches);
size_t search_bytes(int max_matches);  // of it, the search

// What both halves read off the options. The size of a sample is the degrees of freedom of the
// model; an upright pose has three, but refinement frees all five.
int least_matches(int method);
GravityPrior gravity_of(const TwoViewProblem& problem);

// The robust loop (TV_STAGE_ESTIMATE).
void search_two_view(const TwoViewProblem& problem, const Matches& matches, Arena& arena,
                     TwoViewModel* model);

// Refinement on all inliers, rivals, verdict, covariance (TV_STAGE_REFINE). outcome->inlier lies in
// the arena. The rays of the matches move with the principal point.
void finish_two_view(const TwoViewProblem& problem, const TwoViewModel& model, Arena& arena,
                     Matches* matches, TwoViewOutcome* outcome);

}  // namespace tv
