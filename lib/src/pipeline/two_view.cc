#include "pipeline/two_view.h"

#include <algorithm>
#include <cstring>
#include <new>
#include <utility>

#include "robust/calibration.h"
#include "robust/place_focal_length.h"
#include "robust/still.h"

namespace tv {
namespace {

uint32_t bits_of(float x) {
  uint32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  return bits;
}

uint64_t hash_of(const double* a, const double* b) {
  const double values[4] = {a[0], a[1], b[0], b[1]};
  uint64_t hash = 0;
  for (double value : values) {
    const double positive_zero = value + 0.0;
    uint64_t bits;
    std::memcpy(&bits, &positive_zero, sizeof bits);
    hash = (hash ^ bits) * 0x9e3779b97f4a7c15ULL;
    hash ^= hash >> 29;
  }
  return hash;
}

// Whether the two views are exchanged for the computation. The choice depends neither on which view
// the caller names first nor on the order of the matches, so that both calls compute the same
// result. The pixels decide; where every match occurs in both directions, the cameras, then the
// matches' ratios and sigmas, then gravity. Where all of these are equal, both calls are the same
// problem.
bool exchanged(const tv_camera* camera0, const tv_camera* camera1, const TwoViewProblem& named) {
  for (const bool with_ratios : {false, true}) {
    uint64_t forward = 0, backward = 0;
    for (int i = 0; i < named.num; ++i) {
      // What an own view's sigma adds to the weight, and the other view's; 0 for sigmas of 1.
      uint64_t ratio = 0, sigma[2] = {0, 0};
      if (with_ratios && named.ratios != nullptr) ratio = bits_of(named.ratios[i]);
      for (int v = 0; with_ratios && v < 2; ++v) {
        sigma[v] = bits_of(static_cast<float>(named.sigma(v, i))) ^ bits_of(1.0f);
      }
      const double *a = named.pixels[0] + 2 * i, *b = named.pixels[1] + 2 * i;
      forward += hash_of(a, b) * (2 * (ratio + (sigma[0] << 32) + 3 * sigma[1]) + 1);
      backward += hash_of(b, a) * (2 * (ratio + (sigma[1] << 32) + 3 * sigma[0]) + 1);
    }
    if (forward != backward) return forward > backward;
    const int cameras = camera0 == nullptr ? 0 : std::memcmp(camera0, camera1, sizeof(tv_camera));
    if (cameras != 0) return cameras > 0;
  }
  const tv_estimate_options& options = named.options;
  return std::memcmp(options.gravity0, options.gravity1, sizeof options.gravity0) > 0;
}

// The results lie in the arena, and the problem's cameras are those that they refer to.
void search_and_finish(tv_context* context, PairEstimate& e) {
  {
    StageTimer timer(context, TV_STAGE_ESTIMATE);
    prepare_matches(e.problem, context->arena, &e.matches);
    if (refines_focal_length(e.problem)) {
      search_focal_length(e.problem, &e.matches, context->arena, &e.model);
    } else {
      search_two_view(e.problem, e.matches, context->arena, &e.model);
    }
  }
  StageTimer timer(context, TV_STAGE_REFINE);
  finish_two_view(e.problem, e.model, context->arena, &e.matches, &e.outcome);
}

void take_cameras(const tv_camera* const cameras[2], TwoViewProblem& problem) {
  problem.camera[0] = prepare_camera(*cameras[0]);
  problem.camera[1] = prepare_camera(*cameras[1]);
}

// The same without the matches that stand still. cameras: those of the problem. True: the matches
// are no part of the scene, and the problem has them left out; else it is as before, and there are
// no results.
bool estimate_without_still(tv_context* context, const tv_camera* const cameras[2],
                            PairEstimate& e) {
  TwoViewProblem& problem = e.problem;
  const tv_camera &first = problem.camera[0].model, &second = problem.camera[1].model;
  if (!problem.calibrated || first.width != second.width || first.height != second.height) {
    return false;
  }
  uint8_t* is_still = arena_alloc<uint8_t>(context->arena, static_cast<size_t>(problem.num));
  e.num_still = find_still_matches(problem, is_still);
  if (e.num_still == 0) return false;
  const size_t used_bytes = context->arena.used_bytes;
  problem.is_still = is_still;
  search_and_finish(context, e);
  if (contradicts_still(problem, e.matches, e.outcome, e.num_still)) return true;
  problem.is_still = nullptr;
  take_cameras(cameras, problem);
  problem.focal_log_scale = 0;
  problem.focal_is_ambiguous = false;
  context->arena.used_bytes = used_bytes;
  // Constructed in place, since a temporary would take stack.
  new (&e.matches) Matches{};
  new (&e.model) TwoViewModel{};
  Evidence* const evidence = e.outcome.evidence;
  *evidence = Evidence{};
  new (&e.outcome) TwoViewOutcome{};
  e.outcome.evidence = evidence;
  e.num_still = 0;
  return false;
}

// Writes the problem, in the canonical order, but for its options, which are there. *cameras are
// exchanged with the views. Returns whether they were.
bool pose_problem(const tv_pixel_pairs& pairs, const tv_camera* cameras[2],
                  TwoViewProblem& problem) {
  tv_estimate_options& o = problem.options;
  problem.pixels[0] = pairs.pixels0;
  problem.pixels[1] = pairs.pixels1;
  problem.ratios = pairs.ratios;
  problem.sigmas[0] = pairs.sigmas0;
  problem.sigmas[1] = pairs.sigmas1;
  problem.num = pairs.num;
  problem.calibrated = cameras[0] != nullptr;
  problem.one_camera =
      problem.calibrated && std::memcmp(cameras[0], cameras[1], sizeof *cameras[0]) == 0;
  if (problem.one_camera) {
    tv_calibration &a = o.calibration0, &b = o.calibration1;
    a.focal_sigma = std::max(a.focal_sigma, b.focal_sigma);
    a.center_sigma = std::max(a.center_sigma, b.center_sigma);
    a.refine |= b.refine;
    b = a;
  }
  const bool swapped = exchanged(cameras[0], cameras[1], problem);
  if (swapped) {
    std::swap(cameras[0], cameras[1]);
    std::swap(problem.pixels[0], problem.pixels[1]);
    std::swap(problem.sigmas[0], problem.sigmas[1]);
    std::swap(o.gravity0, o.gravity1);
    std::swap(o.calibration0, o.calibration1);
  }
  if (problem.calibrated) take_cameras(cameras, problem);
  return swapped;
}

}  // namespace

void estimate_pair(tv_context* context, const tv_camera* camera0, const tv_camera* camera1,
                   const tv_pixel_pairs& pairs, PairEstimate* estimate) {
  const tv_camera* cameras[2] = {camera0, camera1};
  PairEstimate& e = *estimate;
  {
    StageTimer timer(context, TV_STAGE_ESTIMATE);
    e.swapped = pose_problem(pairs, cameras, e.problem);
    e.problem.kernels = tvk_geometry_of(context->kernels);
  }
  if (!estimate_without_still(context, cameras, e)) search_and_finish(context, e);
}

}  // namespace tv
