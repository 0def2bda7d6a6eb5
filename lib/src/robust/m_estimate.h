// What the finish of a pair's pose (robust/final_pose.h) and that of an absolute pose
// (pose/absolute_pose.h) have in common: the rounds of the refinement, the steps of a robust loss,
// and the variance of what minimises it (P. Huber, "Robust Statistics", 1981, 7.6).
#pragma once

namespace tv {

// The final refinement selects the matches kFinalRounds times, and takes at most kFinalIterations
// steps each time, until one gains less than kFinalGains of the cost. The pose of the first round
// only serves to select the near matches and to estimate the noise. A step that gains less than a
// millionth of the cost is a fiftieth of a standard deviation long, and the next one a tenth of
// that.
inline constexpr int kFinalRounds = 2, kFinalIterations = 20;
inline constexpr double kFinalGains[kFinalRounds] = {1e-3, 1e-6};

// The least scale of a loss, and the least noise of a residual, in thresholds: exact matches come
// from a camera that is not exact.
inline constexpr double kLeastScale = 0.02;

// Twice the logarithm of a thousand: what a likelihood's doubled logarithm changes by for evidence
// at a significance of 0.001. Chi-square with two degrees of freedom exceeds it once in a thousand
// times.
inline constexpr double kEvidence = 13.815510557964274;

// Sums over the matches of the loss's weight, and of psi^2, psi' and psi'^2, psi its derivative.
struct LossSums {
  double weight = 0, psi_sq = 0, slope = 0, slope_sq = 0;
};

// The factor on a step of reweighted least squares, which take the weight for the curvature of the
// loss, psi', so that their steps are too short: the ratio of the two sums, at most 1.5.
inline double stretch_of(double weight, double slope) {
  constexpr double kMostStretch = 1.5;
  return weight < kMostStretch * slope ? weight / slope : kMostStretch;
}

// Huber's factor for few matches, K = 1 + p / n var(psi') / (mean psi')^2, for num matches of
// `dimensions` residuals each and p parameters. mean: of psi', which may be less than the sums say.
inline double small_sample_factor(const LossSums& sums, int num, int dimensions, int p,
                                  double mean) {
  const double of_slope = sums.slope_sq / num - mean * mean;
  return 1 + p / static_cast<double>(dimensions * num) * of_slope / (mean * mean);
}

// The damping of Levenberg and Marquardt between one step and the next.
struct Damping {
  double lambda = 1e-4;
  void ease() { lambda = 0.1 * lambda < 1e-10 ? 1e-10 : 0.1 * lambda; }
  // After a step that lowered nothing. False: no shorter one is tried.
  bool tighten() {
    lambda *= 10;
    return lambda <= 1e6;
  }
};

}  // namespace tv
