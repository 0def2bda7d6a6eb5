// Two-view estimation behind the API boundary: its two halves, search (search.cc) and finish
// (finish.cc), and the data that they pass on.
#pragma once

#include "robust/covariance.h"
#include "robust/principal_point.h"
#include "robust/verdict.h"

namespace tv {

// An epipolar model of the pair, on rays.
struct EpipolarModel {
  bool found = false;
  bool has_pose = false;
  Pose pose;
  Mat3 M = Mat3::Zero();  // E = [t]x R or, without calibration, the fundamental matrix
};

// The result of search_two_view.
struct TwoViewModel {
  EpipolarModel epipolar;
  int num_iterations = 0;
};

// All that the entry point writes to the caller's result and evidence: models on rays, and the
// views in the canonical order that pipeline/two_view.cc chooses.
struct TwoViewOutcome {
  Evidence* evidence = nullptr;  // what the pair is judged by, with its kind; the caller's
  EpipolarModel epipolar;
  bool has_R = false, has_t = false, has_H = false, has_covariance = false,
       has_alternative_covariance = false;
  Mat3 H = Mat3::Zero();
  Pose alternative;
  double covariance[25] = {}, alternative_covariance[25] = {};
  // Models and poses refer to cameras whose principal points are shifted by this.
  double principal_point_shift_px[2] = {0, 0};
  double focal_scale = 0;  // of their focal lengths; 0 where they are as given
  double focal_sigma = 0;  // its relative standard deviation, refined or given
  double rms_error_px = 0;
  uint8_t* inlier = nullptr;  // one flag for each match, repeats included
};

// How many bytes of arena one estimate takes.
size_t two_view_scratch_bytes(int max_matches);
size_t search_bytes(int max_matches);  // the part of these bytes that the search takes

// What both halves read from the options. least_matches: the degrees of freedom of the solver's
// model; 5 for an upright pose, too, since its refinement frees all five.
int least_matches(int method);
GravityPrior gravity_of(const TwoViewProblem& problem);

// Runs the robust loop, which is the stage TV_STAGE_ESTIMATE.
void search_two_view(const TwoViewProblem& problem, const Matches& matches, Arena& arena,
                     TwoViewModel* model);

// Refinement on all inliers, rivals, covariance, evidence (TV_STAGE_REFINE). *outcome is given as
// TwoViewOutcome{} with its evidence, which is Evidence{}; outcome->inlier will lie in the arena.
// The rays of the matches move with the principal point, and rays and the problem's cameras with
// the focal length.
void finish_two_view(TwoViewProblem& problem, const TwoViewModel& model, Arena& arena,
                     Matches* matches, TwoViewOutcome* outcome);

}  // namespace tv
