#include "robust/evidence.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "robust/second_model.h"

namespace tv {
namespace {

// An "ok" is for poses that are 5 degrees off only by an accident of four standard deviations.
constexpr double kMostSigma = 1.25 * kPi / 180;

// Grows with the angle between a match's rays, R taken off: 0 to 2 for 0 to 180 degrees.
double pseudo_angle(const Fit& f, int i) {
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

}  // namespace

// The parallax of a full pose, and whether it is enough.
void measure_pose(Fit& f) {
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

namespace {

// A model of the rest that is no part of the first: matches farther from it than kClear thresholds.
constexpr double kClear = 3;

// A second consistent model, and whether the points repeat themselves as on a lattice: then it is
// the same scene, matched one period off; where most of the support does, so may the pose be.
constexpr double kLatticeSigmas = 3.3, kMostlyLattice = 0.5;

}  // namespace

void look_for_second_model(Fit& f, Arena& arena) {
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

void measure_inliers(Fit& f) {
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

}  // namespace tv
