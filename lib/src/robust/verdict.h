// What kind of pair this is: the rivals of the epipolar model, and the tests that choose.
#pragma once

#include "geometry/homography_4pt.h"
#include "robust/estimators.h"

namespace tv {

// An epipolar model of the pair, on rays.
struct EpipolarModel {
  bool found = false;
  bool has_pose = false;
  Pose pose;
  Mat3 M = Mat3::Zero();  // E = [t]x R, or the uncalibrated matrix
};

// The rivals, found among the epipolar model's inliers, and counted over all matches.
struct Rivals {
  bool has_rotation, has_homography;
  Mat3 R = Mat3::Identity(), H = Mat3::Zero();  // on rays
  int rotation_inliers, homography_inliers, identity_inliers;
};

// A residual in two dimensions is held against the same quantile as the epipolar one: at 95 per
// cent chi-square is 3.84 with one degree of freedom, 5.99 with two.
inline constexpr double kTransferThresholdScale = 1.2489995996796797;  // sqrt(5.99 / 3.84)

// log C(n, k), by Stirling's series.
double log_binomial(int n, int k);

// log of the expected number of models, among all that samples of m matches give, that k or more of
// n matches agree with by chance, when one does with probability p (L. Moisan, B. Stival, "A
// probabilistic criterion to detect rigid point matches", IJCV 2004):
//   NFA = models (n - m) C(n, k) C(k, m) p^(k - m).
double log_false_alarms(int n, int k, int m, int models, double p);

inline constexpr double kLogMeaningful = -4.605170185988091;  // NFA < 0.01

// The probability p at which log_false_alarms is kLogMeaningful; k > m.
double meaningful_chance(int n, int k, int m, int models);

// The probability that a match of view 0's point with a wrong point of view 1 agrees with M:
// counted over wrong pairings of these very points, so that crowded points are allowed for; weighed
// with the share of the image that a band of the threshold's width covers. Counting ends when it is
// clear on which side of `limit` the count will lie.
double chance_of_agreement(const Matches& matches, const Mat3& M, double threshold_px,
                           uint64_t seed, double limit = 0);

// A rival speaks for the pair when it explains this share of what the epipolar model does, or of
// all matches where there is none.
inline constexpr double kRivalShare = 0.7, kRivalShareAlone = 0.5;

// The rotation and the homography that explain most of the listed matches; one that explains less
// than least_share of them may be missed.
Rivals find_rivals(const Matches& matches, const int32_t* support, int num_support, bool calibrated,
                   double least_share, double threshold_px, uint64_t seed, Arena& arena);

// Whether the matches that a rival H leaves unexplained agree on an epipole more than chance would
// have it. A match that H misses by a vector d falls into the epipolar band, were d's direction
// random, with probability (2/pi) asin(w / |d|), w the band's half width. By Hoeffding (1963), of n
// such matches k or more do with probability at most exp(-n KL(k/n || mean)). inlier[i]: whether
// match i is an inlier of the epipolar model. True: there is a translation, or depth off the plane.
bool leaves_parallax(const Matches& matches, const Mat3& H, const uint8_t* inlier,
                     double threshold_px);

size_t verdict_bytes(int max_matches);

}  // namespace tv
