#include "robust/two_view.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/estimators_upright.h"
#include "robust/final_pose.h"
#include "robust/lattice.h"
#include "robust/loop.h"
#include "robust/refine.h"
#include "robust/second_model.h"

namespace tv {
namespace {

// A model from a few lucky samples is not the best that local optimisation can reach: go on a
// little, and longer where inliers are few. docs/decisions/0002-robust-loop.md has the
// measurements.
constexpr int kMinIterations = 50, kFewInliersIterations = 20000;

// A pose that fewer matches agree on is not to be relied on (COLMAP asks for as many).
constexpr int kFewMatches = 15;

// An "ok" is for poses that are 5 degrees off only by an accident of four standard deviations.
constexpr double kMostSigma = 1.25 * kPi / 180;

RayPairs searched(const Matches& matches) {
  RayPairs pairs = matches.pairs;
  pairs.num = matches.num_unique;
  return pairs;
}

LoopOptions loop_options(const tv_estimate_options& options) {
  return LoopOptions{options.confidence, kMinIterations, options.max_iterations,
                     options.fixed_iterations, kFewInliersIterations};
}

template <typename Estimator>
LoopResult<typename Estimator::Model> run(Estimator estimator, const TwoViewProblem& problem) {
  Sampler sampler = make_sampler(problem.options.seed, estimator.pairs.num, Estimator::kSampleSize,
                                 problem.ratios != nullptr);
  return robust_loop(estimator, sampler, loop_options(problem.options));
}

// A model's degrees of freedom. An upright pose has three, but refinement frees all five.
int least_matches(int method) {
  if (method == TV_SOLVER_EIGHT_POINT) return 8;
  return method == TV_SOLVER_SEVEN_POINT ? 7 : 5;
}

GravityPrior gravity_of(const TwoViewProblem& problem) {
  const tv_estimate_options& options = problem.options;
  return gravity_prior(options.gravity0, options.gravity1, options.gravity_sigma_rad);
}

}  // namespace

size_t two_view_scratch_bytes(int max_matches) {
  const size_t n = static_cast<size_t>(max_matches);
  const size_t second = arena_bytes<uint8_t>(n) + second_model_bytes(max_matches);
  const size_t lattice = arena_bytes<double>(2 * n) + lattice_bytes(max_matches);
  const size_t search = arena_bytes<int32_t>(n) + arena_bytes<PoseBatch>(1);
  const size_t finish = 2 * arena_bytes<int32_t>(n) + arena_bytes<uint8_t>(n) +
                        arena_bytes<double>(n) +
                        std::max(verdict_bytes(max_matches), std::max(second, lattice));
  return matches_bytes(max_matches) + std::max(search, finish);
}

void search_two_view(const TwoViewProblem& problem, const Matches& matches, Arena& arena,
                     TwoViewModel* model) {
  *model = TwoViewModel{};
  ArenaScope scope(arena);
  const RayPairs pairs = searched(matches);
  int32_t* indices = arena_alloc<int32_t>(arena, static_cast<size_t>(pairs.num));
  const double threshold = problem.options.max_error_px;
  EpipolarModel& epipolar = model->epipolar;
  const int sample_size = least_matches(problem.options.method);
  if (pairs.num < sample_size) return;
  if (sample_size == 5) {
    const GravityPrior gravity = gravity_of(problem);
    const LoopResult<Pose> result =
        problem.options.method == TV_SOLVER_UPRIGHT
            ? run(make_upright_estimator(pairs, threshold, indices, gravity), problem)
            : run(PoseEstimator{pairs, threshold, indices, arena_alloc<PoseBatch>(arena, 1)},
                  problem);
    model->num_iterations = result.num_iterations;
    epipolar.found = epipolar.has_pose = result.found;
    if (result.found) epipolar.pose = result.model;
    return;
  }
  const LoopResult<Mat3> result =
      problem.options.method == TV_SOLVER_EIGHT_POINT
          ? run(FundamentalEstimator<8>{pairs, threshold, indices}, problem)
          : run(FundamentalEstimator<7>{pairs, threshold, indices}, problem);
  model->num_iterations = result.num_iterations;
  epipolar.found = result.found;
  if (!result.found) return;
  epipolar.M = result.model;
  if (!problem.calibrated) return;
  // The paper's path: the essential matrix nearest to F, the pose of most points in front.
  const int count = near_matches(pairs, pairs.num, epipolar.M, threshold, indices);
  Svd3 svd = svd3(epipolar.M);
  const Mat3 essential =
      svd.U.col(0) * svd.V.col(0).transpose() + svd.U.col(1) * svd.V.col(1).transpose();
  epipolar.has_pose =
      pose_from_essential(pairs, indices, count, essential, threshold, false, &epipolar.pose);
  epipolar.found = epipolar.has_pose;
}

namespace {

struct Finish {
  const TwoViewProblem& problem;
  Matches& matches;
  const RayPairs& pairs;  // without repeats
  double threshold;
  int32_t* indices;  // scratch
  double* values;    // scratch
  int32_t* support;  // the unique inliers of the epipolar model
  int num_support;
  PoseRefiner refiner;  // of the same pairs and scratch
  TwoViewOutcome* out;
};

Mat3 refined_fundamental(const Finish& f, const Mat3& start) {
  FundamentalModel model = fundamental_model(start);
  for (int round = 0; round < kFinalRounds; ++round) {
    const int count =
        near_matches(f.pairs, f.pairs.num, model.matrix(), kFinalNear * f.threshold, f.indices);
    if (count < 7) break;
    refine(f.pairs, f.indices, count, final_loss(f.refiner, model.matrix(), count),
           kFinalIterations, &model);
  }
  return model.matrix().normalized();
}

void collect_support(Finish& f) {
  const EpipolarModel& epipolar = f.out->epipolar;
  f.num_support = 0;
  const RayPairs& pairs = f.matches.pairs;
  if (epipolar.has_pose) {
    pose_squares(pairs, 0, pairs.num, epipolar.pose, f.threshold, f.values);
  } else {
    sampson_squares(pairs, 0, pairs.num, epipolar.M, f.values);
  }
  for (int i = 0; i < pairs.num; ++i) {
    const bool inlier = f.values[i] <= f.threshold * f.threshold;
    f.out->inlier[i] = inlier;
    if (inlier && i < f.pairs.num) f.support[f.num_support++] = i;
  }
}

// Where one camera saw both views and the matches say that its principal point is not where it is
// said to be, pose and principal point are refined together, and the rays follow.
TVK_NOINLINE void place_principal_point(Finish& f) {
  constexpr int kSteps = 6;
  constexpr double kSmallStepPx = 0.01, kMostSigmas = 6;
  Pose& pose = f.out->epipolar.pose;
  PrincipalPoint& point = f.refiner.principal_point;
  const tv_camera& camera = f.problem.camera[0].model;
  const double sigma = f.problem.options.principal_point_sigma;
  if (!f.problem.one_camera || !(sigma > 0)) return;
  point.sigma_px[0] = sigma * camera.fx;
  point.sigma_px[1] = sigma * camera.fy;
  point.is_free = principal_point_is_off(f.refiner, pose);
  if (!point.is_free) return;
  const Pose as_told = pose;
  double step[2] = {1, 1};
  for (int k = 0; k < kSteps && std::fabs(step[0]) + std::fabs(step[1]) > kSmallStepPx; ++k) {
    if (!move_together(f.refiner, &pose, step)) break;
    for (int i = 0; i < 2; ++i) point.shift_px[i] += step[i];
    move_principal_points(f.problem, point.shift_px, &f.matches);
  }
  // What asks for more than that is no calibration's error.
  if (!(std::fabs(point.shift_px[0]) < kMostSigmas * point.sigma_px[0] &&
        std::fabs(point.shift_px[1]) < kMostSigmas * point.sigma_px[1])) {
    point = PrincipalPoint{};
    pose = as_told;
    move_principal_points(f.problem, point.shift_px, &f.matches);
    return;
  }
  pose = refined_pose(f.refiner, pose);
  std::copy(point.shift_px, point.shift_px + 2, f.out->principal_point_shift_px);
}

void refine_epipolar(Finish& f) {
  EpipolarModel& epipolar = f.out->epipolar;
  if (epipolar.has_pose) {
    epipolar.pose = refined_pose(f.refiner, epipolar.pose);
    place_principal_point(f);
    epipolar.M = essential_from_pose(epipolar.pose);
  } else {
    epipolar.M = refined_fundamental(f, epipolar.M);
  }
  collect_support(f);
}

void store_uncertainty(const PoseUncertainty& uncertainty, TwoViewOutcome* out) {
  out->has_covariance = true;
  out->noise_px = uncertainty.noise_px;
  std::copy(uncertainty.covariance, uncertainty.covariance + 25, out->covariance);
}

// The matches that the named transfer explains become the inliers.
void inliers_of_transfer(Finish& f, const Mat3& H) {
  const double limit = kTransferThresholdScale * f.threshold;
  transfer_squares(f.matches.pairs, 0, f.matches.pairs.num, H, f.values);
  for (int i = 0; i < f.matches.pairs.num; ++i) f.out->inlier[i] = f.values[i] <= limit * limit;
}

// A plane allows two motions. Where the plane explains nearly all of the support they are fitted
// together with it; where there is more than the plane, each is refined as a pose, and the epipolar
// model's own competes with them. The one of lowest cost is the pose, and a second one that is
// different and not clearly worse the alternative. Not inlined, for the stack below
// finish_two_view.
TVK_NOINLINE void choose_planar_pose(Finish& f, const Rivals& rivals) {
  TwoViewOutcome& out = *f.out;
  Vec3 mean = Vec3::Zero();
  for (int k = 0; k < f.num_support; ++k) mean += ray_of(f.pairs, 0, f.support[k]).normalized();
  PlaneFit fit;
  Pose poses[3];
  int num_poses = 0;
  const bool plane_alone = 20 * rivals.homography_inliers >= 17 * f.num_support;
  if (plane_alone) num_poses = refine_on_plane(f.refiner, rivals.H, mean, &fit);
  const bool on_plane = num_poses > 0;
  for (int k = 0; k < num_poses; ++k) poses[k] = fit.pose[k];
  if (!on_plane) {
    poses[num_poses++] = out.epipolar.pose;
    PlanarPose planar[2];
    const int count = decompose_homography(rivals.H, mean, planar);
    for (int k = 0; k < count; ++k) poses[num_poses++] = refined_pose(f.refiner, planar[k].pose);
  }
  const PoseEstimator scorer{f.pairs, f.threshold, f.indices, nullptr};
  int best = 0, inliers[3];
  int64_t cost[3];
  for (int k = 0; k < num_poses; ++k) {
    cost[k] = scorer.full_cost(poses[k], &inliers[k]);
    best = cost[k] < cost[best] ? k : best;
  }
  out.epipolar.pose = poses[best];
  out.epipolar.M = essential_from_pose(poses[best]);
  collect_support(f);
  int other = -1;
  double farthest = 1e-4;  // half a degree
  for (int k = 0; k < num_poses; ++k) {
    const double turned =
        (poses[k].R - poses[best].R).squaredNorm() + (poses[k].t - poses[best].t).squaredNorm();
    // Of the other two, one may be the best again, stopped elsewhere in a flat valley.
    if (k != best && turned > farthest && 10 * inliers[k] >= 9 * inliers[best]) {
      other = k;
      farthest = turned;
    }
  }
  if (other >= 0) {
    out.has_alternative = true;
    out.alternative = poses[other];
    out.reasons |= TV_REASON_TWO_PLANAR_SOLUTIONS;
  }
  PoseUncertainty uncertainty;
  const bool certain =
      on_plane ? fit.certain[best] : uncertainty_of(f.refiner, poses[best], &uncertainty);
  if (certain) store_uncertainty(on_plane ? fit.uncertainty[best] : uncertainty, &out);
  if (other < 0) return;
  out.has_alternative_covariance =
      on_plane ? fit.certain[other] : uncertainty_of(f.refiner, poses[other], &uncertainty);
  if (out.has_alternative_covariance) {
    const PoseUncertainty& u = on_plane ? fit.uncertainty[other] : uncertainty;
    std::copy(u.covariance, u.covariance + 25, out.alternative_covariance);
  }
}

// Whether the support moves along the epipolar lines by more than noise. What a rotation leaves
// over has two dimensions, the epipolar residual one: under a rotation alone the sum S of the
// differences is about as large as the sum of the squared epipolar residuals (1.3 times, since the
// search turns the epipole to where the residuals happen to be smallest; in one of 300 pairs more
// than the limit), and a parallax of p deviations of the noise adds p^2 / 2 times as much.
// leaves_parallax tells about the matches that the rotation does not explain, this about those that
// it does.
bool moves_along_lines(const Finish& f, const Mat3& R) {
  if (!f.out->epipolar.has_pose) return false;
  const double limit = kTransferThresholdScale * f.threshold;
  double across = 0, along = 0;
  int n = 0;
  transfer_squares(f.pairs, f.support, f.num_support, R, f.values);
  for (int k = 0; k < f.num_support; ++k) {
    const double r_sq = f.values[k];
    if (r_sq > limit * limit) continue;
    const double epipolar_sq = sampson_sq(f.pairs, f.support[k], f.out->epipolar.M);
    across += epipolar_sq;
    along += r_sq - epipolar_sq;
    ++n;
  }
  return n > 0 && along > (1.8 + 40.0 / n) * across;
}

// Whether the pair is to be called by one of the rivals, or degenerate.
tv_kind choose_kind(Finish& f, const Rivals& rivals, int sample_size) {
  const EpipolarModel& epipolar = f.out->epipolar;
  const bool calibrated = f.problem.calibrated;
  const int n = f.pairs.num;
  // A pure rotation or no motion is meaningful by its own count; an epipolar model by its own.
  const double disc = std::min(1.0, kPi * kTransferThresholdScale * kTransferThresholdScale * 2 *
                                        f.threshold * f.threshold / f.matches.area_px);
  const bool rotation_meaningful =
      rivals.has_rotation &&
      log_false_alarms(n, rivals.rotation_inliers, 2, 1, disc) < kLogMeaningful;
  const bool still_meaningful =
      log_false_alarms(n, rivals.identity_inliers, 1, 1, disc) < kLogMeaningful;
  const bool homography_meaningful =
      rivals.has_homography &&
      log_false_alarms(n, rivals.homography_inliers, 4, 1, disc) < kLogMeaningful;
  bool epipolar_meaningful = false;
  if (epipolar.found && f.num_support > sample_size) {
    const double limit =
        meaningful_chance(n, f.num_support, sample_size, sample_size == 5 ? 10 : 3);
    epipolar_meaningful = chance_of_agreement(f.matches, epipolar.M, f.threshold,
                                              f.problem.options.seed, limit) < limit;
  }
  // A rival speaks for the pair when it explains most of what the epipolar model does (half of all
  // matches where there is none: a failed search is no proof of a rotation), and the rest does not
  // agree on an epipole.
  const double most = epipolar.found ? kRivalShare * f.num_support : kRivalShareAlone * n;
  const bool rotation_enough = rotation_meaningful && rivals.rotation_inliers > most &&
                               !leaves_parallax(f.matches, rivals.R, f.out->inlier, f.threshold) &&
                               !moves_along_lines(f, rivals.R);
  const bool homography_enough = homography_meaningful && rivals.homography_inliers > most &&
                                 !leaves_parallax(f.matches, rivals.H, f.out->inlier, f.threshold);
  const int rival_inliers = calibrated ? rivals.rotation_inliers : rivals.homography_inliers;
  const bool still = still_meaningful && 20 * rivals.identity_inliers >= 19 * rival_inliers &&
                     (calibrated ? rotation_enough : homography_enough);
  if (still) return TV_KIND_NO_MOTION;
  if (rotation_enough) return TV_KIND_PANORAMIC;
  if (!epipolar_meaningful && !homography_enough) return TV_KIND_DEGENERATE;
  if (!calibrated) {
    return homography_enough ? TV_KIND_PLANAR_OR_PANORAMIC : TV_KIND_UNCALIBRATED;
  }
  if (!epipolar.has_pose) return TV_KIND_DEGENERATE;
  return homography_enough ? TV_KIND_PLANAR : TV_KIND_CALIBRATED;
}

// Grows with the angle between a match's rays, R taken off: 0 to 2 for 0 to 180 degrees.
double pseudo_angle(const Finish& f, int i) {
  const RayPairs& pairs = f.matches.pairs;
  const double b[3] = {pairs.ray[1][0][i], pairs.ray[1][1][i], pairs.ray[1][2][i]};
  double a[3], across[3];
  turn_ray0(pairs, i, f.out->epipolar.pose.R, a);
  cross(a, b, across);
  const double sine = std::sqrt(dot(across, across)), cosine = dot(a, b);
  return cosine > 0 ? sine / (sine + cosine) : 1 - cosine / (sine - cosine);
}

double angle_of_pseudo(double p) { return p < 1 ? atan2(p, 1 - p) : atan2(2 - p, 1 - p); }

// The largest standard deviation of the rotation and of the direction, bounded from above by the
// traces of their blocks.
double largest_sigma(const double covariance[25]) {
  const double rotation = covariance[0] + covariance[6] + covariance[12];
  const double direction = covariance[18] + covariance[24];
  return std::sqrt(std::max(rotation, direction));
}

// The parallax of a full pose, and whether it is enough.
void measure_pose(Finish& f) {
  TwoViewOutcome& out = *f.out;
  double sum = 0;
  if (f.num_support == 0) return;
  for (int k = 0; k < f.num_support; ++k) {
    f.values[k] = pseudo_angle(f, f.support[k]);
    sum += f.pairs.pixel_angle[f.support[k]];
  }
  double* middle = f.values + (f.num_support - 1) / 2;
  std::nth_element(f.values, middle, f.values + f.num_support);
  out.median_parallax_rad = angle_of_pseudo(*middle);
  const double least_px = std::max(3 * f.threshold, 10 * out.noise_px);
  if (out.median_parallax_rad < least_px * sum / f.num_support || !out.has_covariance ||
      largest_sigma(out.covariance) > kMostSigma) {
    out.reasons |= TV_REASON_LOW_PARALLAX;
  }
}

// A model of the rest that is no part of the first: matches farther from it than kClear thresholds.
constexpr double kClear = 3;

// A second consistent model, and whether the points repeat themselves as on a lattice: then it is
// the same scene, matched one period off; where most of the support does, so may the pose be.
constexpr double kLatticeSigmas = 3.3, kMostlyLattice = 0.5;

void look_for_second_model(Finish& f, Arena& arena) {
  TwoViewOutcome& out = *f.out;
  const int n = f.pairs.num;
  bool second = false;
  {
    ArenaScope scope(arena);
    uint8_t* explained = arena_alloc<uint8_t>(arena, static_cast<size_t>(n));
    const bool by_pose = out.has_t;
    const double limit = kClear * f.threshold;
    int num_first = 0;
    if (by_pose) {
      sampson_squares(f.pairs, 0, n, out.epipolar.M, f.values);
    } else {
      transfer_squares(f.pairs, 0, n, out.H, f.values);
    }
    for (int i = 0; i < n; ++i) {
      explained[i] = f.values[i] <= limit * limit;
      num_first += out.inlier[i] != 0;
    }
    second = find_second_model(f.matches, explained, num_first, f.threshold, f.problem.options.seed,
                               arena)
                 .found;
  }
  ArenaScope scope(arena);
  double* xy = arena_alloc<double>(arena, 2 * static_cast<size_t>(n));
  for (int i = 0; i < n; ++i) {
    for (int d = 0; d < 2; ++d) xy[2 * i + d] = f.problem.pixels[0][2 * f.matches.order[i] + d];
  }
  int count = 0;
  for (int i = 0; i < n; ++i) {
    if (out.inlier[i] != 0) f.indices[count++] = i;
  }
  const Lattice lattice = find_lattice(xy, n, second ? nullptr : f.indices, count, arena);
  if (lattice.sigmas > kLatticeSigmas && (second || lattice.share > kMostlyLattice)) {
    out.reasons |= TV_REASON_REPEATED_STRUCTURE;
  } else if (second) {
    out.reasons |= TV_REASON_SECOND_MOTION;
  }
}

void measure_inliers(Finish& f) {
  TwoViewOutcome& out = *f.out;
  const bool by_transfer = out.kind == TV_KIND_PANORAMIC || out.kind == TV_KIND_NO_MOTION ||
                           out.kind == TV_KIND_PLANAR_OR_PANORAMIC;
  const RayPairs& pairs = f.matches.pairs;
  double sum = 0;
  if (by_transfer) {
    transfer_squares(pairs, 0, pairs.num, out.H, f.values);
  } else {
    sampson_squares(pairs, 0, pairs.num, out.epipolar.M, f.values);
  }
  for (int i = 0; i < pairs.num; ++i) {
    if (out.inlier[i] == 0) continue;
    ++out.num_inliers;
    sum += f.values[i];
  }
  if (out.num_inliers > 0) out.rms_error_px = std::sqrt(sum / out.num_inliers);
}

// As told by the median of residuals that are spread evenly over the band: 0.74.
constexpr double kNoiseOfChance = 0.7;

// Whether the support's rays of one view lie in one plane, as those of a line of points do: their
// distances from it have a root mean square below three thresholds.
bool in_a_line(const Finish& f, int view) {
  if (f.num_support == 0) return false;
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0, pixel_angle = 0;
  for (int k = 0; k < f.num_support; ++k) {
    const int i = f.support[k];
    double* const* ray = f.pairs.ray[view];
    const double x = ray[0][i], y = ray[1][i], z = ray[2][i];
    const double weight = 1 / ((x * x + y * y) + z * z);
    xx += weight * x * x;
    xy += weight * x * y;
    xz += weight * x * z;
    yy += weight * y * y;
    yz += weight * y * z;
    zz += weight * z * z;
    pixel_angle += f.pairs.pixel_angle[i];
  }
  Mat3 sum;
  sum << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  const double limit = 3 * f.threshold * pixel_angle / f.num_support;
  return svd3(sum).s[2] < limit * limit * f.num_support;
}

void judge(Finish& f) {
  TwoViewOutcome& out = *f.out;
  const bool degenerate = out.kind == TV_KIND_DEGENERATE;
  int unique_inliers = 0;
  for (int i = 0; i < f.pairs.num; ++i) unique_inliers += out.inlier[i];
  if ((degenerate ? f.pairs.num : unique_inliers) < kFewMatches) {
    out.reasons |= TV_REASON_TOO_FEW_MATCHES;
  }
  if (degenerate) {
    if (f.pairs.num >= kFewMatches) out.reasons |= TV_REASON_LOW_INLIER_RATIO;
    out.verdict = TV_VERDICT_REFUSED;
    return;
  }
  // Residuals that fill the band as evenly as chance does are no better than few inliers.
  if (4 * out.num_inliers < f.matches.pairs.num || out.noise_px > kNoiseOfChance * f.threshold) {
    out.reasons |= TV_REASON_LOW_INLIER_RATIO;
  }
  if (out.has_t && (in_a_line(f, 0) || in_a_line(f, 1))) out.reasons |= TV_REASON_CROWDED_MATCHES;
  if (out.kind == TV_KIND_NO_MOTION) out.reasons |= TV_REASON_NO_MOTION;
  if (out.kind == TV_KIND_PANORAMIC) out.reasons |= TV_REASON_PURE_ROTATION;
  if (out.kind == TV_KIND_NO_MOTION || out.kind == TV_KIND_PANORAMIC) {
    out.verdict = TV_VERDICT_REFUSED;  // no full pose
  } else {
    out.verdict = out.reasons == 0 ? TV_VERDICT_OK : TV_VERDICT_DOUBTFUL;
  }
}

}  // namespace

void finish_two_view(const TwoViewProblem& problem, const TwoViewModel& model, Arena& arena,
                     Matches* all_matches, TwoViewOutcome* outcome) {
  Matches& matches = *all_matches;
  *outcome = TwoViewOutcome{};
  const size_t n = static_cast<size_t>(matches.pairs.num);
  outcome->inlier = arena_alloc<uint8_t>(arena, n);
  for (size_t i = 0; i < n; ++i) outcome->inlier[i] = 0;
  ArenaScope scope(arena);
  const RayPairs unique = searched(matches);
  const double threshold = problem.options.max_error_px;
  int32_t* indices = arena_alloc<int32_t>(arena, n);
  double* values = arena_alloc<double>(arena, n);
  int32_t* support = arena_alloc<int32_t>(arena, n);
  Finish f{
      problem,
      matches,
      unique,
      threshold,
      indices,
      values,
      support,
      0,
      PoseRefiner{problem, matches, unique, threshold, gravity_of(problem), {}, indices, values},
      outcome};
  TwoViewOutcome& out = *outcome;
  out.epipolar = model.epipolar;
  if (out.epipolar.found) {
    refine_epipolar(f);
    (problem.calibrated ? out.essential_inliers : out.fundamental_inliers) = f.num_support;
  }
  if (f.num_support < 5) {  // no epipolar model: a rival may still explain the matches
    f.num_support = f.pairs.num;
    for (int i = 0; i < f.pairs.num; ++i) f.support[i] = i;
    out.epipolar.found = false;
  }
  const double least_share = out.epipolar.found ? kRivalShare : kRivalShareAlone;
  const Rivals rivals = find_rivals(matches, f.support, f.num_support, problem.calibrated,
                                    least_share, f.threshold, problem.options.seed, arena);
  out.rotation_inliers = rivals.rotation_inliers;
  out.homography_inliers = rivals.homography_inliers;
  if (!out.epipolar.found) f.num_support = 0;
  const int sample_size = least_matches(problem.options.method);
  out.kind = choose_kind(f, rivals, sample_size);
  out.H = rivals.H;
  out.has_H = out.kind == TV_KIND_PLANAR || out.kind == TV_KIND_PLANAR_OR_PANORAMIC;
  switch (out.kind) {
    case TV_KIND_PLANAR:
      choose_planar_pose(f, rivals);
      out.essential_inliers = f.num_support;
      out.has_R = out.has_t = true;
      break;
    case TV_KIND_CALIBRATED: {
      PoseUncertainty uncertainty;
      if (uncertainty_of(f.refiner, out.epipolar.pose, &uncertainty)) {
        store_uncertainty(uncertainty, &out);
      }
      out.has_R = out.has_t = true;
      break;
    }
    case TV_KIND_PANORAMIC:
      out.epipolar.pose.R = out.H = rivals.R;
      out.has_R = true;
      inliers_of_transfer(f, out.H);
      break;
    case TV_KIND_NO_MOTION:
      if (problem.calibrated) {
        out.epipolar.pose.R = out.H = Mat3::Identity();
        out.has_R = true;
      }
      inliers_of_transfer(f, out.H);
      break;
    case TV_KIND_PLANAR_OR_PANORAMIC: inliers_of_transfer(f, out.H); break;
    case TV_KIND_DEGENERATE:
      for (size_t i = 0; i < n; ++i) out.inlier[i] = 0;
      break;
    case TV_KIND_UNCALIBRATED: break;
  }
  if (out.has_t) measure_pose(f);
  measure_inliers(f);
  if (problem.calibrated && out.kind != TV_KIND_DEGENERATE) {
    look_for_second_model(f, arena);
  }
  judge(f);
}

}  // namespace tv
