#include "pose/absolute_pose.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "base/order.h"
#include "geometry/null_space.h"
#include "pose/reprojection.h"
#include "robust/gravity.h"
#include "robust/ldlt.h"
#include "robust/loop.h"
#include "robust/m_estimate.h"
#include "robust/verdict.h"

namespace tv {
namespace {

// A pose is refined at the one of these scales of the loss, in standard deviations of the noise, at
// which Huber's estimate of the variance, sum psi^2 / (sum psi')^2, is least: with heavy tails that
// is a small one, with normal noise a large one. The covariance is computed at kScale, since a
// variance that was chosen for being small is biased low (robust/final_pose.cc).
constexpr double kScales[] = {6, 4, 3, 2, 1.5, 1};
// A smaller scale must lower the estimate by this many times its relative standard deviation, which
// is 1 / sqrt(n).
constexpr double kClearly = 2;
// kVariance: the variance of the estimate over that of least squares at kScale, for normal noise.
constexpr double kScale = 4, kVariance = 1.0563871016563298;

struct Finish {
  const SightingInput& input;
  const Sightings& s;
  double threshold_px;
  GravitySight gravity;  // with the weight that the caller's sigma gives
  int32_t* indices;      // scratch, one entry a match
  double* values;        // scratch, one entry a match
};

// A pose as it is judged.
struct Candidate {
  Pose pose;
  PoseEquations equations;  // without gravity
  double scale_px, noise_px;
  bool determined, has_covariance;
  double variance_px;     // variance_px (J' W J)^-1 is the covariance without gravity
  double covariance[36];  // with gravity, in the parameters of PoseEquations
  double gravity_sq;      // squared distance of gravity in standard deviations, at most 2 kEvidence
};

// The information of the matches and of gravity; the covariance is its inverse.
bool covariance_of(const Candidate& c, const GravitySight& gravity, double covariance[36]) {
  double upper[21];
  for (int k = 0; k < 21; ++k) upper[k] = c.equations.upper[k] / c.variance_px;
  add_turn_information(c.pose.R * gravity.in_world, gravity.weight, 6, upper);
  return invert_symmetric(6, upper, covariance) && all_finite(covariance, 36);
}

// The squared distance of gravity from a pose that the matches alone gave, in standard deviations.
double gravity_distance_sq(const Candidate& c, const GravitySight& gravity) {
  const Vec3 h = c.pose.R * gravity.in_world;
  Vec3 b[2];
  tangent_basis(h, &b[0], &b[1]);
  double e[2], S[2][2];
  for (int i = 0; i < 2; ++i) {
    e[i] = -b[i].dot(gravity.in_camera);
    const Vec3 left = h.cross(b[i]);
    for (int j = 0; j < 2; ++j) {
      const Vec3 right = h.cross(b[j]);
      S[i][j] = i == j ? 1 / gravity.weight : 0;
      for (int k = 0; k < 9; ++k) {
        S[i][j] += left[k / 3] * c.covariance[6 * (k / 3) + k % 3] * right[k % 3];
      }
    }
  }
  // The length of the chord increases up to half a turn; that of its projection does not.
  const double chord_sq = (h - gravity.in_camera).squaredNorm();
  const double length_sq = e[0] * e[0] + e[1] * e[1];
  const double distance =
      (S[1][1] * e[0] * e[0] - 2 * S[0][1] * e[0] * e[1] + S[0][0] * e[1] * e[1]) /
      (S[0][0] * S[1][1] - S[0][1] * S[0][1]);
  return length_sq > 0 ? distance * (chord_sq / length_sq) : chord_sq * gravity.weight;
}

// The variance of the estimate by Huber's formula (robust/covariance.h), for residuals of two
// dimensions. False where the matches are too few for it.
bool set_variance(const Finish& f, Candidate* c) {
  const LossSums& sums = c->equations.sums;
  const int n = c->equations.visible, left = 2 * n - 6;
  const double mean = sums.slope / n, weight = sums.weight / n;
  if (left <= 4 || !(mean > 0.05)) return false;
  const double K = small_sample_factor(sums, n, 2, 6, mean);
  const double least = 0.05 * kLeastScale * f.threshold_px;
  const double uncorrected = std::max(sums.psi_sq / left / (mean * mean), least * least);
  c->noise_px = std::sqrt(uncorrected / kVariance);
  // The noise is itself estimated, from `left` degrees of freedom: with this factor the ellipsoid
  // at 95 per cent is that of the F distribution, within 3 % for 14 and more.
  c->variance_px = uncorrected * K * K * weight * (left / (left - 4.0));
  return true;
}

// The scale of least estimated variance for the squared errors in f.values.
double best_scale(const Finish& f, double noise_px, int count) {
  double least = 0, best = 0;
  const double better = 1 - kClearly / std::sqrt(static_cast<double>(count));
  for (const double factor : kScales) {
    const double scale = std::max(factor * noise_px, kLeastScale * f.threshold_px);
    double psi_sq = 0, slope = 0;
    for (int k = 0; k < count; ++k) {
      const double q = f.values[k] / (scale * scale), share = 1 / (1 + q), weight = share * share;
      psi_sq += f.values[k] * weight * weight;
      slope += weight * (1 - q) * share;
    }
    if (best > 0 && !(slope > 0 && psi_sq < better * least * slope * slope)) continue;
    least = slope > 0 ? psi_sq / (slope * slope) : __builtin_inf();
    best = scale;
  }
  return best;
}

// Refines a pose over all matches near it, and judges it. Null: a candidate that is not determined.
Candidate refined(const Finish& f, const Pose* start) {
  Candidate c{};
  if (start == nullptr) return c;
  c.pose = *start;
  PoseProblem problem{nullptr, f.s, f.indices, 0, 0, {}, 0};
  for (int round = 0; round < kFinalRounds; ++round) {
    const int count = near_sightings(f.s, c.pose, kNear * f.threshold_px, f.indices);
    if (count < 3) return c;
    for (int k = 0; k < count; ++k) f.values[k] = reprojection_sq(f.s.all[f.indices[k]], c.pose);
    // Half of chi-square with two degrees of freedom lies below 2 log 2.
    c.noise_px = std::sqrt(median(f.values, count) / 1.3862943611198906);
    problem.count = count;
    problem.scale_px = best_scale(f, c.noise_px, count);
    if (round == kFinalRounds - 1 && f.input.camera.model.model != TV_CAMERA_PINHOLE) {
      problem.exact = &f.input;
    }
    refine_absolute(problem, kFinalIterations, kFinalGains[round], &c.pose, &c.equations);
  }
  const double scale_px = problem.scale_px;
  const LossSums& sums = c.equations.sums;
  problem.noise_sq = sums.slope > 0 ? sums.psi_sq / (2 * sums.slope) : 0;
  problem.scale_px = std::max(kScale * c.noise_px, kLeastScale * f.threshold_px);
  c.scale_px = problem.scale_px;
  pose_equations(problem, c.pose, &c.equations);
  c.has_covariance = set_variance(f, &c);
  if (!c.has_covariance) c.variance_px = c.scale_px * c.scale_px;
  GravitySight& gravity = problem.gravity;  // not known up to here
  c.determined = covariance_of(c, gravity, c.covariance);
  gravity = f.gravity;
  if (!(gravity.weight > 0)) return c;
  if (c.determined) {
    const double z_sq = gravity_distance_sq(c, gravity);
    gravity.weight *= gravity_weight(z_sq);
    c.gravity_sq = std::min(z_sq, 2 * kEvidence);
  }
  problem.scale_px = scale_px;
  refine_absolute(problem, kFinalIterations, kFinalGains[1], &c.pose, nullptr);
  c.determined = covariance_of(c, gravity, c.covariance);
  return c;
}

// Minus twice the logarithm of a pose's likelihood, but for a constant, by the noise of `judge`.
double evidence_against(const Finish& f, const Candidate& c, const Candidate& judge) {
  const double scale_sq = judge.scale_px * judge.scale_px;
  double sum = 0;
  for (int k = 0; k < f.s.num; ++k) {
    const double error_sq = reprojection_sq(f.s.all[k], c.pose);
    sum += error_sq < 1e300 ? error_sq / (1 + error_sq / scale_sq) : scale_sq;
  }
  return sum / std::max(judge.noise_px * judge.noise_px, 1e-300) + c.gravity_sq;
}

// The middle of points, and the directions and squared sizes of their spread.
struct Spread {
  double mean[3];
  Svd3 svd;
};

Spread spread_of(const Finish& f, int count) {
  Spread spread{};
  Mat3 sum = Mat3::Zero();
  for (int k = 0; k < count; ++k) {
    const double* point = f.s.all[f.indices[k]].point;
    for (int i = 0; i < 3; ++i) spread.mean[i] += point[i] / count;
  }
  for (int k = 0; k < count; ++k) {
    const double* point = f.s.all[f.indices[k]].point;
    double x[3];
    for (int i = 0; i < 3; ++i) x[i] = point[i] - spread.mean[i];
    for (int i = 0; i < 9; ++i) sum.data()[i] += x[i % 3] * x[i / 3];
  }
  spread.svd = svd3(sum);
  return spread;
}

// v becomes its mirror image on the plane through 0 across `normal`.
void reflect(const double normal[3], double v[3]) {
  const double factor = 2 * dot(normal, v) / length_sq_of(normal);
  for (int k = 0; k < 3; ++k) v[k] -= factor * normal[k];
}

// The pose that sees a flat set of points nearly as this one does: the plane mirrored in depth (D.
// Oberkampf, D. DeMenthon, L. Davis, "Iterative pose estimation using coplanar feature points",
// 1996). R x becomes R x mirrored on the plane, then in depth.
Pose mirrored(const Pose& pose, const Spread& spread) {
  double centre[3], normal[3];
  place(pose, spread.mean, centre);
  const double axis[3] = {spread.svd.U(0, 2), spread.svd.U(1, 2), spread.svd.U(2, 2)};
  rotate(pose.R, axis, normal);
  Pose twin;
  for (int c = 0; c < 3; ++c) {
    double column[3] = {pose.R(0, c), pose.R(1, c), pose.R(2, c)};
    reflect(normal, column);
    reflect(centre, column);
    for (int r = 0; r < 3; ++r) twin.R(r, c) = column[r];
  }
  double turned[3];
  rotate(twin.R, spread.mean, turned);
  for (int r = 0; r < 3; ++r) twin.t[r] = centre[r] - turned[r];
  return twin;
}

// The sum of the squared differences of the rotations' entries.
double turn_sq(const Pose& a, const Pose& b) {
  double sum = 0;
  for (int k = 0; k < 9; ++k) {
    const double difference = a.R.data()[k] - b.R.data()[k];
    sum += difference * difference;
  }
  return sum;
}

// The standard deviations of the rotation and, over the distance of the points, of the position.
double largest_sigma(const Candidate& c, double distance) {
  double rotation = 0, position = 0;
  for (int k = 0; k < 3; ++k) {
    // With the pose's change (w, d), the camera's centre, in its own axes, moves by -d + w x t.
    const int a = (k + 1) % 3, b = (k + 2) % 3;
    double row[6] = {};
    row[a] = c.pose.t[b];
    row[b] = -c.pose.t[a];
    row[3 + k] = -1;
    for (int i = 0; i < 36; ++i) position += row[i / 6] * c.covariance[i] * row[i % 6];
    rotation += c.covariance[7 * k];
  }
  return std::sqrt(std::max(rotation, position / (distance * distance)));
}

// The covariance in the caller's parameters, (w, d') with d' = (d + t x w) / scale: a turn about
// the camera instead of the middle of the points.
void store_covariance(const Sightings& s, const Candidate& c, double out[36]) {
  Mat3 lever = cross_matrix(c.pose.t);
  for (int k = 0; k < 9; ++k) lever.data()[k] /= s.scale;
  double half[36];
  for (int i = 0; i < 36; ++i) {
    const int row = i / 6, column = i % 6;
    half[i] = c.covariance[i] / (row < 3 ? 1 : s.scale);
    for (int k = 0; k < 3 && row >= 3; ++k) {
      half[i] += lever(row - 3, k) * c.covariance[6 * k + column];
    }
  }
  for (int i = 0; i < 36; ++i) {
    const int row = i / 6, column = i % 6;
    if (column < row) continue;
    double sum = half[i] / (column < 3 ? 1 : s.scale);
    for (int k = 0; k < 3 && column >= 3; ++k) sum += half[6 * row + k] * lever(column - 3, k);
    out[i] = out[6 * column + row] = sum;
  }
}

// Counts the inliers of a pose and the cells of an 8x8 grid that hold them, and marks them. Writes
// the different ones to f.indices and returns how many.
int count_inliers(const Finish& f, const Pose& pose, tv_absolute_pose* out, uint8_t* mask) {
  const tv_camera& camera = f.input.camera.model;
  const double side[2] = {camera.width / 8.0, camera.height / 8.0};
  uint64_t cells = 0;
  int different = 0;
  double sum = 0;
  for (int k = 0; k < f.s.num_all; ++k) {
    const double error_sq = reprojection_sq(f.s.all[k], pose);
    if (!(error_sq <= f.threshold_px * f.threshold_px)) continue;
    if (k < f.s.num) f.indices[different++] = k;
    if (mask != nullptr) mask[f.s.order[k]] = 1;
    sum += error_sq;
    ++out->num_inliers;
    int cell[2];
    for (int d = 0; d < 2; ++d) {
      const double place = (f.input.pixels[2 * f.s.order[k] + d] + 0.5) / side[d];
      cell[d] = place >= 7 ? 7 : (place > 0 ? static_cast<int>(place) : 0);
    }
    cells |= uint64_t{1} << (8 * cell[1] + cell[0]);
  }
  out->coverage = __builtin_popcountll(cells) / 64.0;
  if (out->num_inliers > 0) out->rms_error_px = std::sqrt(sum / out->num_inliers);
  return different;
}

// The likelier of a pose and its twin. The other one, where it is possible, too, becomes the
// alternative.
const Candidate& better_of(const Finish& f, const Candidate& found, const Candidate& twin,
                           tv_absolute_pose* out) {
  if (!twin.determined || !(turn_sq(twin.pose, found.pose) > 1e-6)) return found;
  const double difference = evidence_against(f, twin, found) - evidence_against(f, found, found);
  const bool takes_twin = difference < 0;
  if (std::fabs(difference) < kEvidence) {
    out->has_alternative = 1;
    const Candidate& other = takes_twin ? found : twin;
    write_pose(f.s, other.pose, out->alternative_R, out->alternative_t);
  }
  return takes_twin ? twin : found;
}

// What a pose is judged by. spread: of the points of its different inliers.
void measure_pose(const Finish& f, const Candidate& best, const Spread& spread, int different,
                  const tv_absolute_pose& out, AbsoluteEvidence* evidence) {
  double centre[3];
  place(best.pose, spread.mean, centre);
  const double distance = length_of(centre);
  const double focal = 0.5 * (f.input.camera.model.fx + f.input.camera.model.fy);
  evidence->has_pose = true;
  evidence->has_alternative = out.has_alternative != 0;
  evidence->num_inliers = out.num_inliers;
  evidence->num_different_inliers = different;
  evidence->noise_px = best.noise_px;
  if (best.has_covariance) evidence->sigma_rad = largest_sigma(best, distance);
  evidence->coverage = out.coverage;
  evidence->width_px = std::sqrt(spread.svd.s[1] / different) / distance * focal;
}

// Refinement, twin, inliers and covariance; what the pose is judged by goes to *evidence, which is
// given as AbsoluteEvidence{}.
void fit_absolute_pose(const SightingInput& input, const Sightings& s,
                       const tv_absolute_pose_options& options, const AbsolutePoseSearch& search,
                       Arena& arena, tv_absolute_pose* out, uint8_t* mask,
                       AbsoluteEvidence* evidence) {
  ArenaScope scope(arena);
  evidence->threshold_px = options.max_error_px;
  evidence->num_matches = s.num_all;
  evidence->num_different = s.num;
  const size_t n = static_cast<size_t>(s.num_all);
  Finish f{input,
           s,
           options.max_error_px,
           {},
           arena_alloc<int32_t>(arena, n),
           arena_alloc<double>(arena, n)};
  const GravityPrior prior =
      gravity_prior(options.gravity_in_world, options.gravity_in_camera, options.gravity_sigma_rad);
  if (prior.known)
    f.gravity = {1 / (prior.sigma_rad * prior.sigma_rad), prior.down[0], prior.down[1]};
  const Candidate found = refined(f, search.found ? &search.pose : nullptr);
  int different = search.found ? count_inliers(f, found.pose, out, nullptr) : 0;
  if (!found.determined || !is_meaningful(input, s, found.pose, different, options)) {
    // No pose: too few matches, points on a line, or no more inliers than chance explains.
    out->num_inliers = 0;
    out->coverage = out->rms_error_px = 0;
    for (int i = 0; i < s.num; ++i) f.indices[i] = i;
    const Vec3 sizes = spread_of(f, s.num).svd.s;
    evidence->is_on_line = !(sizes[1] > 1e-12 * sizes[0]);
    return;
  }
  const Spread spread = spread_of(f, different);
  const Vec3& sizes = spread.svd.s;
  const bool is_flat = sizes[2] < 0.01 * sizes[1];
  const Pose mirror = mirrored(found.pose, spread);
  const Candidate twin = refined(f, is_flat ? &mirror : nullptr);
  const Candidate& best = better_of(f, found, twin, out);
  out->num_inliers = 0;
  different = count_inliers(f, best.pose, out, mask);
  out->has_pose = 1;
  write_pose(s, best.pose, out->R, out->t);
  out->has_covariance = best.has_covariance;
  if (best.has_covariance) {
    out->noise_px = best.noise_px;
    store_covariance(s, best, out->covariance);
  }
  measure_pose(f, best, spread, different, *out, evidence);
}

}  // namespace

void finish_absolute_pose(const SightingInput& input, const Sightings& s,
                          const tv_absolute_pose_options& options, const AbsolutePoseSearch& search,
                          Arena& arena, tv_absolute_pose* out, uint8_t* mask) {
  AbsoluteEvidence evidence;
  fit_absolute_pose(input, s, options, search, arena, out, mask, &evidence);
  const Judgement judgement = judge(evidence);
  out->verdict = judgement.verdict;
  out->reasons = judgement.reasons;
}

}  // namespace tv
