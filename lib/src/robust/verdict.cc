#include "robust/verdict.h"

#include <algorithm>
#include <cmath>

namespace tv {
namespace {

// A pose that fewer matches agree on is not to be relied on (COLMAP asks for as many).
constexpr int kFewMatches = 15;

// As told by the median of residuals that are spread evenly over the band: 0.74.
constexpr double kNoiseOfChance = 0.7;

// Whether the support's rays of one view lie in one plane, as those of a line of points do: their
// distances from it have a root mean square below three thresholds.
bool in_a_line(const Fit& f, int view) {
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

}  // namespace

void judge(Fit& f) {
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

}  // namespace tv
