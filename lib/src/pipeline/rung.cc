#include "pipeline/rung.h"

#include <algorithm>
#include <cstring>

#include "match/align.h"
#include "match/appearance.h"
#include "match/join.h"
#include "match/match.h"
#include "match/witness.h"
#include "pipeline/extract.h"
#include "pipeline/pair_result.h"

namespace tv {
namespace {

// Matches the first keypoints of both views, so many of each; returns how many matches there are.
int32_t match_first(tv_context* context, const PairTask& task, const PairArrays& arrays,
                    const int32_t num_keypoints[2], tv_correspondence* matches) {
  StageTimer timer(context, TV_STAGE_MATCH);
  ArenaScope scope(context->arena);
  const tv_correspondence* found = nullptr;
  const int32_t count = match_descriptors(
      *context->kernels, features_of(arrays, 0, num_keypoints[0]),
      features_of(arrays, 1, num_keypoints[1]), task.match, context->arena, &found);
  std::copy(found, found + count, matches);
  return count;
}

void extract_and_match(tv_context* context, const PairTask& task, PairArrays& arrays,
                       Attempt* attempt) {
  for (int v = 0; v < 2; ++v) {
    RungKeypoints found = {arrays.keypoints[v], arrays.descriptors[v], arrays.tilts[v], 0};
    extract_rung(context, task.views[v].image, task.views[v].mask, task.features, attempt->rung,
                 &found);
    attempt->num_keypoints[v] = found.num;
  }
  attempt->num_found = match_first(context, task, arrays, attempt->num_keypoints, arrays.matches);
}

// Moves the keypoints of the matches by the pixels around them. A keypoint has at most one match.
// Matches of guided matching are not aligned.
void align_found(tv_context* context, const PairTask& task, int32_t num_matches,
                 PairArrays& arrays) {
  StageTimer timer(context, TV_STAGE_MATCH);
  ArenaScope scope(context->arena);
  uint8_t* const aligned = arena_alloc<uint8_t>(context->arena, static_cast<size_t>(num_matches));
  const tv_image images[2] = {task.views[0].image, task.views[1].image};
  align_matches(*context->kernels, images, static_cast<double>(task.features.keypoint_size),
                arrays.keypoints, arrays.matches, num_matches, aligned);
  for (int32_t k = 0; k < num_matches; ++k) arrays.aligned[arrays.matches[k].idx0] = aligned[k];
}

// The same as align_found on rungs with squeezed views, whose patches begin where their shapes
// map them; then one match a place is kept. *num_matches becomes the number of those.
void align_and_merge(tv_context* context, const PairTask& task, PairArrays& arrays,
                     int32_t* num_matches) {
  StageTimer timer(context, TV_STAGE_MATCH);
  for (int32_t k = 0; task.options.align_matches != 0 && k < *num_matches; ++k) {
    const tv_correspondence& m = arrays.matches[k];
    tv_keypoint* const pair[2] = {&arrays.keypoints[0][m.idx0], &arrays.keypoints[1][m.idx1]};
    double shapes[2][4];
    patch_shape(*pair[0], arrays.tilts[0][m.idx0], shapes[0]);
    patch_shape(*pair[1], arrays.tilts[1][m.idx1], shapes[1]);
    arrays.aligned[m.idx0] =
        align_keypoints(*context->kernels, task.views[0].image, task.views[1].image,
                        static_cast<double>(task.features.keypoint_size), pair[0], pair[1], shapes);
  }
  *num_matches = merge_places(arrays, context->arena, arrays.matches, *num_matches, arrays.matches,
                              *num_matches);
}

// Whether more keypoints match when one picture is mirrored; the same for exchanged views. On rung
// 0 the strongest are compared, on higher rungs all: there the strongest of the image as it is have
// few matches either way. docs/algorithms/two_view.md, mirrored pictures.
bool looks_mirrored(tv_context* context, const PairTask& task, const Attempt& attempt,
                    PairArrays& arrays) {
  constexpr int32_t kStrongest = 512;
  const int32_t most = attempt.rung == 0 ? kStrongest : context->most_keypoints;
  const int32_t strongest[2] = {std::min(attempt.num_keypoints[0], most),
                                std::min(attempt.num_keypoints[1], most)};
  int32_t count[2] = {attempt.num_found, 0};  // matches as they are, and mirrored
  for (int mirrored = 0; mirrored < 2; ++mirrored) {
    if (mirrored == 1 || attempt.rung == 0) {
      count[mirrored] = match_first(context, task, arrays, strongest, arrays.more_matches);
    }
    mirror_descriptors(arrays.descriptors[0], strongest[0]);
  }
  return count[1] > count[0];
}

// Adds what the descriptors are evidence for, and judges the attempt.
void judge_attempt(tv_context* context, const PairTask& task, PairArrays& arrays,
                   Attempt* attempt) {
  Evidence& evidence = attempt->estimate.evidence;
  const int32_t num_keypoints = std::min(attempt->num_keypoints[0], attempt->num_keypoints[1]);
  evidence.looks_repeated =
      looks_repeated(task.match, arrays.matches, arrays.inlier_mask, attempt->num_matches);
  // To match mirrored pictures takes time, and where something is against the pair already, it adds
  // nothing. Where a quarter of the keypoints match, the pictures are not mirrored. A focal length
  // that is not known is nothing against the pair.
  Evidence of_pair = evidence;
  of_pair.focal_sigma = 0;
  evidence.looks_mirrored = 4 * attempt->num_matches < num_keypoints &&
                            judge(of_pair).verdict == TV_VERDICT_OK &&
                            looks_mirrored(context, task, *attempt, arrays);
  write_judgement(judge(evidence), &attempt->estimate.view);
}

}  // namespace

int32_t merge_places(const PairArrays& arrays, Arena& arena, const tv_correspondence* first,
                     int32_t num_first, tv_correspondence* matches, int32_t num_matches) {
  constexpr float kBehind = 1e6f;  // no two variances differ by such a factor
  ArenaScope scope(arena);
  float* const variances = arena_alloc<float>(arena, static_cast<size_t>(num_matches));
  int32_t next = 0;
  for (int32_t k = 0; k < num_matches; ++k) {
    const tv_keypoint& a = arrays.keypoints[0][matches[k].idx0];
    const tv_keypoint& b = arrays.keypoints[1][matches[k].idx1];
    const bool is_first = next < num_first && first[next].idx0 == matches[k].idx0;
    next += is_first;
    const int factor = arrays.aligned[matches[k].idx0];
    const float of_alignment = static_cast<float>(factor == 0 ? kAlignedOne : factor) / kAlignedOne;
    variances[k] = (a.size * a.size + b.size * b.size) * (of_alignment * of_alignment) *
                   (is_first ? 1 : kBehind);
  }
  return keep_witnesses(arrays.keypoints, variances, matches, num_matches, arena);
}

// The stack is deepest here.
void estimate_from(tv_context* context, const PairTask& task, const tv_correspondence* matches,
                   int32_t num_matches, PairArrays& arrays, int32_t num_rungs, PairResult* result,
                   uint8_t* inlier_mask) {
  gather_pixels(matches, num_matches, task.features.keypoint_size, task.options.sigma_by_size,
                arrays);
  ArenaScope scope(context->arena);
  result->evidence = Evidence{};
  PairEstimate estimate{};
  estimate.problem.options = task.estimate;
  estimate.outcome.evidence = &result->evidence;
  // Each rung's estimate has its chance to agree by accident.
  int32_t& num_trials = estimate.problem.options.num_trials;
  num_trials = std::min(num_trials + num_rungs - 1, 10000);
  estimate_pair(context, task.views[0].camera, task.views[1].camera, arrays.pairs, &estimate);
  write_estimate(estimate, &result->view);
  write_inliers(estimate, inlier_mask);
}

void keep_pair(const tv_two_view& estimate, const PairTask& task, PairArrays& arrays) {
  if (!is_full_pose(estimate)) return;
  *arrays.pair = corrected_pair(estimate, *task.views[0].camera, *task.views[1].camera);
}

void run_rung(tv_context* context, const PairTask& task, PairArrays& arrays, Attempt* attempt) {
  std::memset(arrays.aligned, 0, static_cast<size_t>(context->most_keypoints));
  extract_and_match(context, task, arrays, attempt);
  attempt->num_matches = attempt->num_found;
  const bool has_tilts = tilts_of_rung(attempt->rung) > 1;
  if (has_tilts) align_and_merge(context, task, arrays, &attempt->num_matches);
  attempt->num_left_out =
      keep_best(arrays.matches, context->limits.max_matches, &attempt->num_matches);
  if (!has_tilts && task.options.align_matches != 0) {
    align_found(context, task, attempt->num_matches, arrays);
  }
  estimate_from(context, task, arrays.matches, attempt->num_matches, arrays, attempt->num_rungs,
                &attempt->estimate, arrays.inlier_mask);
  keep_pair(attempt->estimate.view, task, arrays);
  judge_attempt(context, task, arrays, attempt);
}

}  // namespace tv
