// How likely a count of inliers is to come about by chance (a-contrario statistics): the number of
// false alarms, and the probability that a wrong match agrees with an epipolar model.
#pragma once

#include "base/random.h"
#include "robust/matches.h"

namespace tv {

// log C(n, k), by Stirling's series.
double log_binomial(int n, int k);

// log of the expected number of models, among all that samples of m matches give, that k or more of
// n matches agree with by chance, where each does with probability p (L. Moisan, B. Stival, "A
// probabilistic criterion to detect rigid point matches", IJCV 2004):
//   NFA = models (n - m) C(n, k) C(k, m) p^(k - m).
// Where the matches' probabilities differ, it is at most this with their mean as p, by Maclaurin's
// inequality of symmetric means.
double log_false_alarms(int n, int k, int m, int models, double p);

inline constexpr double kLogMeaningful = -4.605170185988091;  // NFA < 0.01

// The probability p at which log_false_alarms is kLogMeaningful; k > m.
double meaningful_chance(int n, int k, int m, int models);

// Two different ones of n matches, the point of the first paired with that of the second: a wrong
// match, as long as few matches are equal.
struct WrongMatch {
  int first, second;
};
WrongMatch draw_wrong_match(Random& random, int n);

// The probability that a wrong pairing of n matches agrees: the share of the drawn pairings that
// agree, averaged with `prior`, which counts as 100 pairings. Among few matches some pairings are
// drawn more than once, so that the draws count for less. most: how many may be drawn.
double chance_from_pairings(int agreeing, int drawn, int most, int n, double prior);

// The probability that a point of view 0, matched with a wrong point of view 1, agrees with M. It
// is counted over wrong pairings of the matched points, so that it is right for crowded points,
// too, and averaged with a prior: the share of the image that a band of the threshold's width
// covers. Counting ends early when it is clear on which side of `limit` the probability lies.
double chance_of_agreement(const Matches& matches, const Mat3& M, double threshold_px,
                           uint64_t seed, double limit = 0);

}  // namespace tv
