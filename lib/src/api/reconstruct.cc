// The entry point tv_reconstruct: it calls the other stages in a row, on one rung of effort after
// another, and keeps the results of the last rung at the front of the arena. The merging of guided
// matches and the choice of the best matches are here, too. docs/algorithms/effort.md.
#include "twoview/reconstruct.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "api/camera_pair.h"
#include "api/scratch.h"
#include "api/sized.h"
#include "api/two_view.h"
#include "api/validate.h"
#include "api/within.h"
#include "feature/sigmas.h"
#include "feature/tilts.h"
#include "geometry/essential.h"
#include "match/align.h"
#include "match/rank.h"
#include "match/witness.h"
#include "pipeline/extract.h"
#include "pipeline/pair_result.h"
#include "robust/verdict.h"
#include "triangulation/triangulation.h"
#include "twoview/bundle.h"

namespace tv {
namespace {

// The arrays of one reconstruction, at the front of the arena.
struct Results {
  tv_keypoint* keypoints[2];
  uint8_t* descriptors[2];
  uint8_t* tilts[2];
  double* pixels[2];
  tv_correspondence* matches;
  float* ratios;
  float* sigmas[2];
  uint8_t* inlier_mask;
  tv_point* points;
  tv_correspondence* more_matches;  // the matches of tv_match and of guided matching together
  uint8_t* more_inlier_mask;
  tv_two_view* more_estimate;  // the estimate from both together
  // Of each keypoint of view 0, the byte of tv_align_matches of its match, or 0. It lies where
  // `points` lies, and is valid until there are points.
  uint8_t* aligned;
  // The cameras and the motion of the present estimate; set for full poses only.
  tv_camera_pair* pair;
  tv_pixel_pairs pairs;  // of the present matches; with sigmas where sigma_by_size is not 0
  float keypoint_size;   // the size of a keypoint whose sigma is 1
  double sigma_by_size;  // the option
};

Results alloc_results(Arena& arena, const tv_limits& limits) {
  const size_t n = static_cast<size_t>(most_keypoints(limits));
  const size_t m = static_cast<size_t>(most_chosen_matches(limits));
  Results r;
  for (int v = 0; v < 2; ++v) {
    r.keypoints[v] = arena_alloc<tv_keypoint>(arena, n);
    r.descriptors[v] = arena_alloc<uint8_t>(arena, n * TV_DESCRIPTOR_BYTES);
    r.tilts[v] = limits.max_effort < 2 ? nullptr : arena_alloc<uint8_t>(arena, n);
    r.pixels[v] = arena_alloc<double>(arena, 2 * m);
    r.sigmas[v] = arena_alloc<float>(arena, m);
  }
  r.matches = arena_alloc<tv_correspondence>(arena, n);
  r.ratios = arena_alloc<float>(arena, m);
  r.inlier_mask = arena_alloc<uint8_t>(arena, m);
  r.points = arena_alloc<tv_point>(arena, m);
  r.more_matches = arena_alloc<tv_correspondence>(arena, n);
  r.more_inlier_mask = arena_alloc<uint8_t>(arena, m);
  r.pair = arena_alloc<tv_camera_pair>(arena, 1);
  r.more_estimate = arena_alloc<tv_two_view>(arena, 1);
  // A rung has at most 6.5 times max_keypoints, and there are at least max_keypoints points.
  static_assert(sizeof(tv_point) >= 7 * sizeof *r.aligned, "the points' memory is large enough");
  r.aligned = reinterpret_cast<uint8_t*>(r.points);
  return r;
}

// Writes the pixels, ratios and sigmas of the matches, and r.pairs.
void gather_pixels(Results& r, const tv_correspondence* matches, int32_t num_matches) {
  r.pairs = {sizeof r.pairs, num_matches, r.pixels[0], r.pixels[1], r.ratios, nullptr, nullptr};
  if (r.sigma_by_size != 0) {
    r.pairs.sigmas0 = r.sigmas[0];
    r.pairs.sigmas1 = r.sigmas[1];
  }
  KeypointSigmas sigmas(r.keypoint_size, r.sigma_by_size);
  for (int32_t k = 0; k < num_matches; ++k) {
    const tv_correspondence& m = matches[k];
    const tv_keypoint& a = r.keypoints[0][m.idx0];
    const tv_keypoint& b = r.keypoints[1][m.idx1];
    r.pixels[0][2 * k] = a.x;
    r.pixels[0][2 * k + 1] = a.y;
    r.pixels[1][2 * k] = b.x;
    r.pixels[1][2 * k + 1] = b.y;
    r.ratios[k] = m.ratio;
    if (r.pairs.sigmas0 == nullptr) continue;
    r.sigmas[0][k] = sigmas.of(a);
    r.sigmas[1][k] = sigmas.of(b);
    const int factor = r.aligned[m.idx0];
    if (factor == 0) continue;
    for (float* of_view : r.sigmas) of_view[k] *= static_cast<float>(factor) / kAlignedOne;
  }
}

// The views and the options of one call, as they were read.
struct Task {
  tv_view views[2];
  tv_reconstruct_options options;
  tv_estimate_options estimate;
};

// One rung of effort, and what it found; the arrays are in Results.
struct Attempt {
  int32_t rung;
  int32_t num_rungs;                 // how many were run, this one included
  uint64_t rung_ns[kMaxEffort + 1];  // the time of each
  int32_t num_keypoints[2];
  int32_t num_found;  // matches of tv_match
  int32_t num_matches, num_left_out;
  tv_two_view estimate;  // without its judgement, which is written with the results
  Evidence evidence;     // of the latest estimate
  Judgement judgement;   // of the rung
};

// Moves the keypoints of the matches by the pixels around them. A keypoint has at most one match.
// Matches of guided matching are not aligned. It is called before the estimate, whose inlier mask
// serves as scratch.
void align_found(tv_context* context, const tv_view views[2], int32_t num_matches, Results& r) {
  StageTimer timer(context, TV_STAGE_MATCH);
  uint8_t* const aligned = r.inlier_mask;
  const tv_image images[2] = {views[0].image, views[1].image};
  align_matches(*context->kernels, images, static_cast<double>(r.keypoint_size), r.keypoints,
                r.matches, num_matches, aligned);
  for (int32_t k = 0; k < num_matches; ++k) r.aligned[r.matches[k].idx0] = aligned[k];
}

// Keeps one match a place of those that squeezed views found several times: the most precise one,
// as its alignment and the sizes of its keypoints say; and before all others those of `aligned`,
// which are among `matches`, both by ascending idx0. Returns how many are left.
int32_t merge_places(const Results& r, Arena& arena, const tv_correspondence* aligned,
                     int32_t num_aligned, tv_correspondence* matches, int32_t num_matches) {
  constexpr float kBehind = 1e6f;  // no two variances differ by such a factor
  ArenaScope scope(arena);
  float* const variances = arena_alloc<float>(arena, static_cast<size_t>(num_matches));
  int32_t next = 0;
  for (int32_t k = 0; k < num_matches; ++k) {
    const tv_keypoint& a = r.keypoints[0][matches[k].idx0];
    const tv_keypoint& b = r.keypoints[1][matches[k].idx1];
    const bool is_aligned = next < num_aligned && aligned[next].idx0 == matches[k].idx0;
    next += is_aligned;
    const int factor = r.aligned[matches[k].idx0];
    const float of_alignment = static_cast<float>(factor == 0 ? kAlignedOne : factor) / kAlignedOne;
    variances[k] = (a.size * a.size + b.size * b.size) * (of_alignment * of_alignment) *
                   (is_aligned ? 1 : kBehind);
  }
  return keep_witnesses(r.keypoints, variances, matches, num_matches, arena);
}

// The same as align_found on rungs with squeezed views, whose patches begin where their shapes
// map them; then one match a place is kept. *num_matches becomes the number of those.
__attribute__((noinline)) void align_and_merge(tv_context* context, const Task& task, Results& r,
                                               int32_t* num_matches) {
  StageTimer timer(context, TV_STAGE_MATCH);
  for (int32_t k = 0; task.options.align_matches != 0 && k < *num_matches; ++k) {
    const tv_correspondence& m = r.matches[k];
    tv_keypoint* const pair[2] = {&r.keypoints[0][m.idx0], &r.keypoints[1][m.idx1]};
    double shapes[2][4];
    patch_shape(*pair[0], r.tilts[0][m.idx0], shapes[0]);
    patch_shape(*pair[1], r.tilts[1][m.idx1], shapes[1]);
    r.aligned[m.idx0] = static_cast<uint8_t>(
        align_keypoints(*context->kernels, task.views[0].image, task.views[1].image,
                        static_cast<double>(r.keypoint_size), pair[0], pair[1], shapes));
  }
  *num_matches = merge_places(r, context->arena, r.matches, *num_matches, r.matches, *num_matches);
}

// Merges `matches` into `found`, which has room for both: removes the found matches that use a
// keypoint of `matches`, then inserts `matches` so that idx0 ascends. Returns how many matches
// `found` then holds.
int32_t join_matches(const tv_correspondence* matches, int32_t num_matches, Arena& arena,
                     int32_t max_keypoints, tv_correspondence* found, int32_t num_found) {
  ArenaScope scope(arena);
  uint8_t* used = arena_alloc<uint8_t>(arena, 2 * static_cast<size_t>(max_keypoints));
  std::memset(used, 0, 2 * static_cast<size_t>(max_keypoints));
  for (int32_t k = 0; k < num_matches; ++k) {
    used[2 * matches[k].idx0] = used[2 * matches[k].idx1 + 1] = 1;
  }
  int32_t num_new = 0;
  for (int32_t k = 0; k < num_found; ++k) {
    const tv_correspondence m = found[k];
    if (used[2 * m.idx0] == 0 && used[2 * m.idx1 + 1] == 0) found[num_new++] = m;
  }
  int32_t a = num_matches - 1, b = num_new - 1;
  // The merge runs from the end, because `found` is an input and receives the result.
  for (int32_t k = num_matches + num_new - 1; a >= 0; --k) {
    found[k] = b >= 0 && found[b].idx0 > matches[a].idx0 ? found[b--] : matches[a--];
  }
  return num_matches + num_new;
}

// Keeps the best matches, at most `most`, in their order; returns how many it left out. Where two
// of equal rank compete for the last place, neither gets it.
int32_t keep_best(tv_correspondence* matches, int32_t most, int32_t* num_matches) {
  const int32_t num = *num_matches;
  if (num <= most) return 0;
  uint64_t limit = 0;  // the largest rank with at most `most` ranks below it, found bit by bit
  for (int bit = 62;; --bit) {
    const bool last = bit < 0;
    const uint64_t trial = last ? limit : limit | uint64_t{1} << bit;
    int32_t below = 0;
    for (int32_t k = 0; k < num; ++k) {
      if (rank_of(matches[k]) >= trial) continue;
      if (last) matches[below] = matches[k];
      ++below;
    }
    if (last) return num - (*num_matches = below);
    if (below <= most) limit = trial;
  }
}

tv_features features_of(const Results& r, const int32_t num_keypoints[2], int view) {
  return {sizeof(tv_features), num_keypoints[view], r.keypoints[view], r.descriptors[view]};
}

bool is_full_pose(const tv_two_view& v) { return v.has_R != 0 && v.has_t != 0; }

// Stores the cameras and the motion of an estimate in r, for the stages that follow. Call it for
// each estimate that is kept.
void keep_pair(const tv_two_view& estimate, const tv_view& view0, const tv_view& view1,
               Results& r) {
  if (is_full_pose(estimate)) tv_corrected_pair(&estimate, view0.camera, view1.camera, r.pair);
}

// Estimates from r.pairs. Not inlined, so that its stack frame is not in use elsewhere.
__attribute__((noinline)) void estimate_matches(tv_context* context, const Task& task,
                                                const Results& r, uint8_t* inlier_mask,
                                                tv_two_view* result, Evidence* evidence) {
  ArenaScope scope(context->arena);
  *evidence = Evidence{};
  PairEstimate estimate{};
  estimate.problem.options = task.estimate;
  estimate.outcome.evidence = evidence;
  estimate_pair(context, task.views[0].camera, task.views[1].camera, r.pairs, &estimate);
  write_estimate(estimate, result);
  write_inliers(estimate, inlier_mask);
}

// Writes the guided matches of an estimate to r.more_matches. Not inlined, so that its stack frame
// is not in use during the second estimate.
__attribute__((noinline)) tv_status match_guided(tv_context* context,
                                                 const int32_t num_keypoints[2],
                                                 const tv_two_view& estimate, Results& r,
                                                 int32_t* count) {
  const tv_features features[2] = {features_of(r, num_keypoints, 0),
                                   features_of(r, num_keypoints, 1)};
  tv_epipolar epipolar{&r.pair->camera0, &r.pair->camera1, {}};
  std::copy(estimate.E, estimate.E + 9, epipolar.matrix);
  return tv_match_guided(context, &epipolar, &features[0], &features[1], nullptr, r.more_matches,
                         context->most_keypoints, count);
}

// Matches again along the epipolar lines of the attempt's estimate, and estimates from all matches.
// If takes_guided_estimate accepts the second estimate, *num_matches, *num_left_out, the estimate
// and r's matches, pixels and mask become those of the second pass; else they stay. So does the
// attempt's judgement. Not inlined, like the
// two stages below, so that its stack frame is not in use during the first estimate.
__attribute__((noinline)) tv_status match_along_lines(tv_context* context, const Task& task,
                                                      Attempt& attempt, Results& r,
                                                      int32_t* num_matches, int32_t* num_left_out) {
  const tv_limits& limits = context->limits;
  tv_two_view* const estimate = &attempt.estimate;
  int32_t count = 0;
  tv_status status = match_guided(context, attempt.num_keypoints, *estimate, r, &count);
  if (status != TV_OK) return status;
  count = join_matches(r.matches, *num_matches, context->arena, context->most_keypoints,
                       r.more_matches, count);
  if (count == *num_matches) return TV_OK;
  if (tilts_of_rung(attempt.rung) > 1) {
    count = merge_places(r, context->arena, r.matches, *num_matches, r.more_matches, count);
  }
  const int32_t left_out = keep_best(r.more_matches, limits.max_matches, &count);
  gather_pixels(r, r.more_matches, count);
  tv_two_view& again = *r.more_estimate;
  estimate_matches(context, task, r, r.more_inlier_mask, &again, &attempt.evidence);
  if (!takes_guided_estimate(*estimate, attempt.judgement.verdict, judge(attempt.evidence).verdict,
                             &again)) {
    gather_pixels(r, r.matches, *num_matches);
    return TV_OK;
  }
  *estimate = again;
  keep_pair(again, task.views[0], task.views[1], r);
  *num_matches = count;
  *num_left_out = left_out;
  std::copy(r.more_matches, r.more_matches + count, r.matches);
  std::copy(r.more_inlier_mask, r.more_inlier_mask + count, r.inlier_mask);
  return TV_OK;
}

// Triangulates the inliers of a full pose; all other points are invalid. Writes to *num_points how
// many have the status TV_POINT_OK.
__attribute__((noinline)) tv_status triangulate_inliers(tv_context* context,
                                                        tv_triangulation method,
                                                        const tv_two_view& two_view,
                                                        int32_t num_matches, Results& r,
                                                        int32_t* num_points) {
  StageTimer timer(context, TV_STAGE_TRIANGULATE);
  *num_points = 0;
  if (num_matches == 0) return TV_OK;
  const bool full_pose = is_full_pose(two_view);
  if (full_pose) {
    const tv_status status = tv_triangulate(r.pair, &r.pairs, method, r.points);
    if (status != TV_OK) return status;
  }
  for (int32_t k = 0; k < num_matches; ++k) {
    if (!full_pose || r.inlier_mask[k] == 0) {
      r.points[k] = tv_point{};
      r.points[k].status = TV_POINT_INVALID;
    }
    *num_points += r.points[k].status == TV_POINT_OK;
  }
  return TV_OK;
}

void store_unit(const Mat3& m, double out[9]) {
  const Mat3 unit = m.normalized();
  for (int k = 0; k < 9; ++k) out[k] = unit(k / 3, k % 3);
}

// Adjusts pose and points together, and computes E, F, the covariance and the number of points
// anew.
__attribute__((noinline)) tv_status adjust(tv_context* context, int32_t num_matches, Results& r,
                                           tv_two_view* two_view, int32_t* num_points) {
  tv_bundle_result bundle;
  tv_bundle_result_init(&bundle);
  const tv_status status =
      tv_adjust_two_view(context, &r.pairs, nullptr, r.pair, r.points, &bundle);
  if (status != TV_OK) return status;
  std::copy(r.pair->cam1_from_cam0_R, r.pair->cam1_from_cam0_R + 9, two_view->R);
  std::copy(r.pair->cam1_from_cam0_t, r.pair->cam1_from_cam0_t + 3, two_view->t);
  Pose pose;
  for (int k = 0; k < 9; ++k) pose.R(k / 3, k % 3) = two_view->R[k];
  for (int k = 0; k < 3; ++k) pose.t[k] = two_view->t[k];
  const Mat3 E = essential_from_pose(pose);
  store_unit(E, two_view->E);
  store_unit(inverse_intrinsics(intrinsics_of(r.pair->camera1)).transpose() * E *
                 inverse_intrinsics(intrinsics_of(r.pair->camera0)),
             two_view->F);
  two_view->has_covariance = bundle.has_covariance;
  std::copy(bundle.covariance, bundle.covariance + 25, two_view->covariance);
  if (bundle.has_covariance) two_view->noise_px = bundle.noise_px;
  *num_points = 0;
  for (int32_t k = 0; k < num_matches; ++k) *num_points += r.points[k].status == TV_POINT_OK;
  return TV_OK;
}

constexpr tv_reconstruct_options kDefaults = {sizeof(tv_reconstruct_options),
                                              TV_TRIANGULATION_ITERATIVE_LS,
                                              nullptr,
                                              nullptr,
                                              nullptr,
                                              0,
                                              0,
                                              1.0,
                                              1,
                                              0,
                                              0,
                                              0};

tv_status read_reconstruct_options(const tv_reconstruct_options* options,
                                   tv_reconstruct_options* checked) {
  *checked = kDefaults;
  const tv_status status = read_sized(options, checked);
  if (status != TV_OK) return status;
  constexpr size_t kWithAlignment = offsetof(tv_reconstruct_options, align_matches) + 4;
  if (options != nullptr && options->struct_size < kWithAlignment) checked->align_matches = 0;
  if (!is_finite(checked->sigma_by_size)) return TV_ERR_NOT_FINITE;
  const bool valid = is_triangulation_method(checked->triangulation) &&
                     (checked->guided_matching == 0 || checked->guided_matching == 1) &&
                     (checked->bundle_adjustment == 0 || checked->bundle_adjustment == 1) &&
                     checked->sigma_by_size >= 0 && checked->sigma_by_size <= kMostSigmaExponent &&
                     (checked->align_matches == 0 || checked->align_matches == 1) &&
                     checked->reserved == 0 && within(checked->effort, 0, kMaxEffort) &&
                     within(checked->max_effort, 0, kMaxEffort);
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

bool is_of_size(const tv_camera* camera, const tv_image& image) {
  return camera == nullptr || (camera->width == image.width && camera->height == image.height);
}

// Checks the views, and reads the options of the stages. Not inlined, for the same reason as the
// stages.
__attribute__((noinline)) tv_status read_task(const tv_context& context, Task* task) {
  tv_feature_options features;
  tv_status status = read_feature_options(context, task->options.feature, &features);
  for (const tv_view& view : task->views) {
    if (status == TV_OK) status = check_image(context, &view.image);
    if (status == TV_OK) status = check_mask(view.mask, view.image);
    if (status == TV_OK && !is_of_size(view.camera, view.image)) status = TV_ERR_CAMERA;
    if (status != TV_OK) return status;
    const Arena& arena = context.arena;
    if (overlap(arena.memory, arena.size_bytes, view.image.data, image_bytes(view.image)) ||
        (view.mask != nullptr &&
         overlap(arena.memory, arena.size_bytes, view.mask->data, image_bytes(*view.mask)))) {
      return TV_ERR_OVERLAP;
    }
  }
  const tv_camera* const camera0 = task->views[0].camera;
  status = read_estimate_options(task->options.estimate, camera0 != nullptr, &task->estimate);
  return status != TV_OK ? status : check_optional_cameras(camera0, task->views[1].camera);
}

// Extracts the keypoints of both views and matches them. Not inlined, so that its stack frame is
// not in use during the estimate.
__attribute__((noinline)) tv_status extract_and_match(tv_context* context, const Task& task,
                                                      Results& r, Attempt* attempt) {
  tv_feature_options features;  // read again, so that they are not on the stack elsewhere
  read_feature_options(*context, task.options.feature, &features);
  r.keypoint_size = features.keypoint_size;
  r.sigma_by_size = task.options.sigma_by_size;
  for (int v = 0; v < 2; ++v) {
    RungKeypoints found = {r.keypoints[v], r.descriptors[v], r.tilts[v], 0};
    extract_rung(context, task.views[v].image, task.views[v].mask, features, attempt->rung, &found);
    attempt->num_keypoints[v] = found.num;
  }
  const tv_features found[2] = {features_of(r, attempt->num_keypoints, 0),
                                features_of(r, attempt->num_keypoints, 1)};
  return tv_match(context, &found[0], &found[1], task.options.match, r.matches,
                  context->most_keypoints, &attempt->num_found);
}

// Replaces descriptors by those of the mirrored patches; a second call restores them. A patch is
// turned to its angle: mirrored across that axis, its rows of cells change places, the first with
// the last, and the direction bin k becomes bin -k.
void mirror_descriptors(uint8_t* descriptors, int32_t num) {
  for (int32_t i = 0; i < num; ++i, descriptors += TV_DESCRIPTOR_BYTES) {
    uint8_t mirrored[TV_DESCRIPTOR_BYTES];
    for (int k = 0; k < TV_DESCRIPTOR_BYTES; ++k) {
      mirrored[k] = descriptors[32 * (3 - k / 32) + (k & 24) + (-k & 7)];
    }
    std::copy(mirrored, mirrored + TV_DESCRIPTOR_BYTES, descriptors);
  }
}

// Whether more keypoints match when one picture is mirrored; the same for exchanged views. On rung
// 0 the strongest are compared, on higher rungs all: there the strongest of the image as it is have
// few matches either way. docs/algorithms/two_view.md, mirrored pictures. Not inlined, so that its
// stack frame is not in use during the estimate.
__attribute__((noinline)) bool looks_mirrored(tv_context* context, const Attempt& attempt,
                                              const tv_match_options* options, Results& r) {
  constexpr int32_t kStrongest = 512;
  const int32_t most = attempt.rung == 0 ? kStrongest : context->most_keypoints;
  const int32_t strongest[2] = {std::min(attempt.num_keypoints[0], most),
                                std::min(attempt.num_keypoints[1], most)};
  const tv_features features[2] = {features_of(r, strongest, 0), features_of(r, strongest, 1)};
  int32_t count[2] = {attempt.num_found, 0};  // matches as they are, and mirrored
  for (int mirrored = 0; mirrored < 2; ++mirrored) {
    if (mirrored == 1 || attempt.rung == 0) {
      tv_match(context, &features[0], &features[1], options, r.more_matches,
               context->most_keypoints, &count[mirrored]);
    }
    mirror_descriptors(r.descriptors[0], strongest[0]);
  }
  return count[1] > count[0];
}

// Whether more than half of the inliers have a second nearest descriptor that is as near as those
// of one place in two pictures are: then another place looks the same. docs/algorithms/two_view.md,
// a second place that looks the same.
bool looks_repeated(const tv_match_options* options, const Results& r, int32_t num_matches) {
  constexpr float kAlikeSq = 20000;
  tv_match_options match{};
  read_sized(options, &match);
  // Below such a bound max_distance replaces the distance of the second nearest descriptor, and
  // nothing is known of it.
  if (match.max_distance > 0 && match.max_distance * match.max_distance <= kAlikeSq) return false;
  int32_t alike = 0, inliers = 0;
  for (int32_t k = 0; k < num_matches; ++k) {
    if (r.inlier_mask[k] == 0) continue;
    const tv_correspondence& m = r.matches[k];
    ++inliers;
    alike += static_cast<float>(m.dist_sq) < kAlikeSq * (m.ratio * m.ratio);
  }
  return 2 * alike > inliers;
}

// Adds what the descriptors are evidence for, and judges the attempt.
void judge_attempt(tv_context* context, const Task& task, Results& r, Attempt* attempt) {
  Evidence& evidence = attempt->evidence;
  const int32_t num_keypoints = std::min(attempt->num_keypoints[0], attempt->num_keypoints[1]);
  evidence.looks_repeated = looks_repeated(task.options.match, r, attempt->num_matches);
  // To match mirrored pictures takes time, and where something is against the pair already, it adds
  // nothing. Where a quarter of the keypoints match, the pictures are not mirrored.
  evidence.looks_mirrored = 4 * attempt->num_matches < num_keypoints &&
                            judge(evidence).verdict == TV_VERDICT_OK &&
                            looks_mirrored(context, *attempt, task.options.match, r);
  attempt->judgement = judge(evidence);
}

// Runs the rung that *attempt names. The stack is deepest in the estimate.
tv_status run_rung(tv_context* context, const Task& task, Results& r, Attempt* attempt) {
  std::memset(r.aligned, 0, static_cast<size_t>(context->most_keypoints));
  tv_status status = extract_and_match(context, task, r, attempt);
  if (status != TV_OK) return status;
  attempt->num_matches = attempt->num_found;
  const bool has_tilts = tilts_of_rung(attempt->rung) > 1;
  if (has_tilts) align_and_merge(context, task, r, &attempt->num_matches);
  attempt->num_left_out = keep_best(r.matches, context->limits.max_matches, &attempt->num_matches);
  if (!has_tilts && task.options.align_matches != 0) {
    align_found(context, task.views, attempt->num_matches, r);
  }
  gather_pixels(r, r.matches, attempt->num_matches);
  estimate_matches(context, task, r, r.inlier_mask, &attempt->estimate, &attempt->evidence);
  keep_pair(attempt->estimate, task.views[0], task.views[1], r);
  judge_attempt(context, task, r, attempt);
  return TV_OK;
}

// How many of the matches have a ratio that wrong ones seldom have.
int32_t num_certain(const Results& r, int32_t num_matches) {
  constexpr float kCertain = 0.8f;
  int32_t certain = 0;
  for (int32_t k = 0; k < num_matches; ++k) certain += r.matches[k].ratio < kCertain;
  return certain;
}

// Whether more keypoints or views could give what this attempt lacks. docs/algorithms/effort.md has
// the measurements.
bool could_help(const Results& r, const Attempt& attempt) {
  const tv_two_view& e = attempt.estimate;
  const Judgement& judgement = attempt.judgement;
  if (judgement.verdict == TV_VERDICT_OK || e.kind == TV_KIND_NO_MOTION ||
      e.kind == TV_KIND_PANORAMIC) {
    return false;
  }
  // A blank picture has nothing to match in any view.
  constexpr int32_t kFewKeypoints = 16;
  if (std::min(attempt.num_keypoints[0], attempt.num_keypoints[1]) < kFewKeypoints) return false;
  if (e.kind == TV_KIND_DEGENERATE) {
    // On rung 0 nothing tells unrelated pictures from a wall at a slant. On rung 2 there are twelve
    // certain matches in 3 % of unrelated pairs, and the highest rung is for those that have them.
    constexpr int32_t kFewCertain = 12;
    return attempt.rung < 2 || num_certain(r, attempt.num_matches) >= kFewCertain;
  }
  // What a pose lacks by the cameras alone, in enough places, no view gives.
  constexpr uint32_t kOfCameras = TV_REASON_LOW_PARALLAX | TV_REASON_CAMERA_CONTRADICTED;
  constexpr int32_t kEnoughPlaces = 20;
  return (judgement.reasons & ~kOfCameras) != 0 || e.num_places < kEnoughPlaces;
}

// The rung to climb to after an attempt at `rung`. Rung 1 takes longer than rung 2 and finds less;
// it is climbed to where nothing higher is allowed.
int32_t next_rung(int32_t rung, int32_t max_effort) {
  return rung == 0 && max_effort >= 2 ? 2 : rung + 1;
}

// Runs one rung after another, as far as the options allow and a further one could help. *attempt,
// which is given as Attempt{}, is then the last one.
tv_status climb(tv_context* context, Task& task, Results& r, Attempt* attempt) {
  const int32_t max_effort = task.options.max_effort;
  for (attempt->rung = task.options.effort;; attempt->rung = next_rung(attempt->rung, max_effort)) {
    const uint64_t start_ns = clock_ns(*context);
    const tv_status status = run_rung(context, task, r, attempt);
    if (status != TV_OK) return status;
    attempt->rung_ns[attempt->num_rungs++] = clock_ns(*context) - start_ns;
    if (attempt->rung >= max_effort || !could_help(r, *attempt)) return TV_OK;
    // Each rung's estimate has its chance to agree by accident.
    int32_t& num_trials = task.estimate.num_trials;
    num_trials = std::min(std::max(num_trials, 1) + 1, 10000);
  }
}

// Not inlined, so that its stack frame is not in use during the estimate.
__attribute__((noinline)) void write_reconstruction(const Results& r, const Attempt& attempt,
                                                    int32_t num_matches, int32_t num_left_out,
                                                    int32_t num_points,
                                                    tv_reconstruction* reconstruction) {
  tv_reconstruction packed{};
  packed.effort = attempt.rung;
  packed.num_rungs = attempt.num_rungs;
  std::copy_n(attempt.rung_ns, attempt.num_rungs, packed.rung_ns);
  for (int v = 0; v < 2; ++v) {
    packed.tilts[v] = r.tilts[v];
    packed.num_keypoints[v] = attempt.num_keypoints[v];
    packed.keypoints[v] = r.keypoints[v];
    packed.descriptors[v] = r.descriptors[v];
  }
  packed.num_matches_left_out = num_left_out;
  packed.num_matches = num_matches;
  packed.num_points = num_points;
  packed.matches = r.matches;
  packed.inlier_mask = r.inlier_mask;
  packed.points = r.points;
  write_sized(packed, reconstruction);
}

}  // namespace
}  // namespace tv

void tv_view_init_sized(tv_view* view, size_t struct_size) { tv::init_zeros(view, struct_size); }

void tv_reconstruct_options_init_sized(tv_reconstruct_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

void tv_reconstruction_init_sized(tv_reconstruction* reconstruction, size_t struct_size) {
  tv::init_zeros(reconstruction, struct_size);
}

tv_status tv_reconstruct(tv_context* context, const tv_view* view0, const tv_view* view1,
                         const tv_reconstruct_options* options, tv_two_view* two_view,
                         tv_reconstruction* reconstruction) {
  if (context == nullptr || view0 == nullptr || view1 == nullptr || two_view == nullptr ||
      reconstruction == nullptr) {
    return TV_ERR_NULL;
  }
  tv::Task task{};
  tv_reconstruct_options& checked = task.options;
  tv_status status = tv::read_sized(view0, &task.views[0]);
  if (status == TV_OK) status = tv::read_sized(view1, &task.views[1]);
  if (status == TV_OK) status = tv::check_sized(two_view);
  if (status == TV_OK) status = tv::check_sized(reconstruction);
  if (status == TV_OK) status = tv::read_reconstruct_options(options, &checked);
  if (status != TV_OK) return status;
  if (task.views[0].reserved != 0 || task.views[1].reserved != 0) return TV_ERR_ARGUMENT;
  if (tv::overlap(two_view, two_view->struct_size, reconstruction, reconstruction->struct_size)) {
    return TV_ERR_OVERLAP;
  }
  const uint32_t purposes = TV_PURPOSE_RECONSTRUCT |
                            (checked.guided_matching != 0 ? TV_PURPOSE_MATCH_GUIDED : 0) |
                            (checked.bundle_adjustment != 0 ? TV_PURPOSE_ADJUST : 0);
  if (!tv::made_for(*context, purposes)) return TV_ERR_LIMITS;
  if (std::max(checked.effort, checked.max_effort) > context->limits.max_effort) {
    return TV_ERR_EFFORT;
  }
  status = tv::read_task(*context, &task);
  if (status != TV_OK) return status;
  tv::ArenaScope scope(context->arena);
  tv::Results r = tv::alloc_results(context->arena, context->limits);
  tv::Attempt attempt{};
  status = tv::climb(context, task, r, &attempt);
  if (status != TV_OK) return status;
  int32_t num_matches = attempt.num_matches, num_left_out = attempt.num_left_out, num_points = 0;
  tv_two_view& estimate = attempt.estimate;
  if (checked.guided_matching != 0 && tv::is_full_pose(estimate) && estimate.has_E != 0) {
    status = tv::match_along_lines(context, task, attempt, r, &num_matches, &num_left_out);
    if (status != TV_OK) return status;
  }
  status = tv::triangulate_inliers(context, static_cast<tv_triangulation>(checked.triangulation),
                                   estimate, num_matches, r, &num_points);
  if (status != TV_OK) return status;
  if (checked.bundle_adjustment != 0 && tv::is_full_pose(estimate)) {
    status = tv::adjust(context, num_matches, r, &estimate, &num_points);
    if (status != TV_OK) return status;
  }
  tv::write_judgement(attempt.judgement, &estimate);
  tv::write_sized(estimate, two_view);
  tv::write_reconstruction(r, attempt, num_matches, num_left_out, num_points, reconstruction);
  return TV_OK;
}
