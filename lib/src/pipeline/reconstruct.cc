#include "pipeline/reconstruct.h"

#include <algorithm>

#include "geometry/essential.h"
#include "match/join.h"
#include "pipeline/bundle.h"
#include "pipeline/guided.h"
#include "pipeline/pair_result.h"
#include "robust/covariance.h"
#include "triangulation/triangulation.h"

namespace tv {
namespace {

// How many of the matches have a ratio that wrong ones seldom have.
int32_t num_certain(const PairArrays& arrays, int32_t num_matches) {
  constexpr float kCertain = 0.8f;
  int32_t certain = 0;
  for (int32_t k = 0; k < num_matches; ++k) certain += arrays.matches[k].ratio < kCertain;
  return certain;
}

// Whether more keypoints or views could give what this attempt lacks. docs/algorithms/effort.md has
// the measurements.
bool could_help(const PairArrays& arrays, const Attempt& attempt) {
  const tv_two_view& e = attempt.estimate.view;
  if (e.verdict == TV_VERDICT_OK || e.kind == TV_KIND_NO_MOTION || e.kind == TV_KIND_PANORAMIC) {
    return false;
  }
  // A blank picture has nothing to match in any view.
  constexpr int32_t kFewKeypoints = 16;
  if (std::min(attempt.num_keypoints[0], attempt.num_keypoints[1]) < kFewKeypoints) return false;
  if (e.kind == TV_KIND_DEGENERATE) {
    // On rung 0 nothing tells unrelated pictures from a wall at a slant. On rung 2 there are twelve
    // certain matches in 3 % of unrelated pairs, and the highest rung is for those that have them.
    constexpr int32_t kFewCertain = 12;
    return attempt.rung < 2 || num_certain(arrays, attempt.num_matches) >= kFewCertain;
  }
  return more_could_help(attempt.estimate);
}

// The rung to climb to after an attempt at `rung`. Rung 1 takes longer than rung 2 and finds less;
// it is climbed to where nothing higher is allowed.
int32_t next_rung(int32_t rung, int32_t max_effort) {
  return rung == 0 && max_effort >= 2 ? 2 : rung + 1;
}

// Runs one rung after another, as far as the options allow and a further one could help.
void climb(tv_context* context, const PairTask& task, PairArrays& arrays, Attempt* attempt) {
  const int32_t max_effort = task.options.max_effort;
  for (attempt->rung = task.options.effort;; attempt->rung = next_rung(attempt->rung, max_effort)) {
    const uint64_t start_ns = clock_ns(*context);
    uint64_t& rung_ns = attempt->rung_ns[attempt->num_rungs++];
    run_rung(context, task, arrays, attempt);
    rung_ns = clock_ns(*context) - start_ns;
    if (attempt->rung >= max_effort || !could_help(arrays, *attempt)) return;
  }
}

// Writes the matches along the epipolar lines of the attempt's estimate to arrays.more_matches.
// Returns how many there are.
int32_t find_guided(tv_context* context, const PairTask& task, const Attempt& attempt,
                    PairArrays& arrays) {
  ArenaScope scope(context->arena);
  tv_epipolar epipolar{&arrays.pair->camera0, &arrays.pair->camera1, {}};
  const double* const E = attempt.estimate.view.E;
  std::copy(E, E + 9, epipolar.matrix);
  const tv_correspondence* found = nullptr;
  const int32_t count =
      match_epipolar(context, epipolar, features_of(arrays, 0, attempt.num_keypoints[0]),
                     features_of(arrays, 1, attempt.num_keypoints[1]), task.guided, &found);
  std::copy(found, found + count, arrays.more_matches);
  return count;
}

// Matches again along the epipolar lines of the attempt's estimate, and estimates from all matches.
// If takes_guided_estimate accepts the second estimate, it becomes the attempt's, with its matches,
// their pixels and mask; else all stay. So does the attempt's judgement.
void match_along_lines(tv_context* context, const PairTask& task, PairArrays& arrays,
                       Attempt* attempt) {
  int32_t count = find_guided(context, task, *attempt, arrays);
  count = join_matches(arrays.matches, attempt->num_matches, context->arena,
                       context->most_keypoints, arrays.more_matches, count);
  if (count == attempt->num_matches) return;
  if (tilts_of_rung(attempt->rung) > 1) {
    count = merge_places(arrays, context->arena, arrays.matches, attempt->num_matches,
                         arrays.more_matches, count);
  }
  const int32_t left_out = keep_best(arrays.more_matches, context->limits.max_matches, &count);
  PairResult& again = *arrays.more_estimate;
  estimate_from(context, task, arrays.more_matches, count, arrays, attempt->num_rungs, &again,
                arrays.more_inlier_mask);
  write_judgement(judge(again.evidence), &again.view);
  if (!takes_guided_estimate(attempt->estimate.view, again.view)) {
    gather_pixels(arrays.matches, attempt->num_matches, task.features.keypoint_size,
                  task.options.sigma_by_size, arrays);
    return;
  }
  keep_judgement(attempt->estimate, &again);
  attempt->estimate = again;
  keep_pair(again.view, task, arrays);
  attempt->num_matches = count;
  attempt->num_left_out = left_out;
  std::copy(arrays.more_matches, arrays.more_matches + count, arrays.matches);
  std::copy(arrays.more_inlier_mask, arrays.more_inlier_mask + count, arrays.inlier_mask);
}

// Triangulates the inliers of a full pose; all other points are invalid.
void triangulate_inliers(tv_context* context, const PairTask& task, const Attempt& attempt,
                         PairArrays& arrays) {
  StageTimer timer(context, TV_STAGE_TRIANGULATE);
  const bool full_pose = is_full_pose(attempt.estimate.view);
  if (full_pose) {
    const Camera camera0 = prepare_camera(arrays.pair->camera0);
    const Camera camera1 = prepare_camera(arrays.pair->camera1);
    triangulate_points(static_cast<tv_triangulation>(task.options.triangulation),
                       prepare_triangulation(camera0, camera1, *arrays.pair), arrays.pairs.pixels0,
                       arrays.pairs.pixels1, static_cast<size_t>(attempt.num_matches),
                       arrays.points);
  }
  for (int32_t k = 0; k < attempt.num_matches; ++k) {
    if (full_pose && arrays.inlier_mask[k] != 0) continue;
    arrays.points[k] = tv_point{};
    arrays.points[k].status = TV_POINT_INVALID;
  }
}

void write_unit(const Mat3& m, double out[9]) { write_matrix(m.normalized(), out); }

// Adjusts pose and points together, and computes E and F anew. The covariance that was judged stays
// that of the pose: the adjustment's own is of independent noise and exact cameras.
void adjust(tv_context* context, const PairTask& task, PairArrays& arrays, tv_two_view* two_view) {
  tv_camera_pair& pair = *arrays.pair;
  BundleOutcome outcome;
  const Motion start = read_motion(pair);
  adjust_pair(context, arrays.pairs, task.bundle, start, &pair, arrays.points, &outcome);
  if (!outcome.moved) return;
  std::copy(pair.cam1_from_cam0_R, pair.cam1_from_cam0_R + 9, two_view->R);
  std::copy(pair.cam1_from_cam0_t, pair.cam1_from_cam0_t + 3, two_view->t);
  const Pose pose = {matrix_of(two_view->R), Vec3(two_view->t)};
  const Mat3 E = essential_from_pose(pose);
  write_unit(E, two_view->E);
  write_unit(inverse_intrinsics(intrinsics_of(pair.camera1)).transpose() * E *
                 inverse_intrinsics(intrinsics_of(pair.camera0)),
             two_view->F);
  if (!two_view->has_covariance) return;
  double judged[25];
  std::copy(two_view->covariance, two_view->covariance + 25, judged);
  carry_covariance(start.pose.t, pose.t, judged, two_view->covariance);
}

}  // namespace

bool more_could_help(const PairResult& pose) {
  const Evidence& evidence = pose.evidence;
  uint32_t of_cameras = TV_REASON_LOW_PARALLAX | TV_REASON_CAMERA_CONTRADICTED;
  if (evidence.misfit.direction_rad > 0) of_cameras |= TV_REASON_SECOND_MOTION;
  constexpr int32_t kEnoughPlaces = 20;
  return (pose.view.reasons & ~of_cameras) != 0 || least_places(evidence) < kEnoughPlaces;
}

int32_t reconstruct(tv_context* context, const PairTask& task, PairArrays* arrays,
                    Attempt* attempt) {
  ArenaScope scope(context->arena);
  *arrays = alloc_pair_arrays(context->limits, context->arena);
  climb(context, task, *arrays, attempt);
  tv_two_view& estimate = attempt->estimate.view;
  if (task.options.guided_matching != 0 && is_full_pose(estimate) && estimate.has_E != 0) {
    match_along_lines(context, task, *arrays, attempt);
  }
  triangulate_inliers(context, task, *attempt, *arrays);
  if (task.options.bundle_adjustment != 0 && is_full_pose(estimate)) {
    adjust(context, task, *arrays, &estimate);
  }
  int32_t num_points = 0;
  for (int32_t k = 0; k < attempt->num_matches; ++k) {
    num_points += arrays->points[k].status == TV_POINT_OK;
  }
  return num_points;
}

}  // namespace tv
