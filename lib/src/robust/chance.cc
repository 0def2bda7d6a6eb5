#include "robust/chance.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/sampson.h"

namespace tv {
namespace {

constexpr double kInfinity = __builtin_inf();
constexpr int kChunk = 64;  // matches that are handled at a time, on the stack

double log_factorial(int n) {
  if (n < 16) {
    double product = 1;
    for (int k = 2; k <= n; ++k) product *= k;
    return log(product);
  }
  const double x = n;
  return (x + 0.5) * log(x) - x + 0.91893853320467274178 + 1 / (12 * x) - 1 / (360 * x * x * x);
}

// Whether the share agreeing / drawn shows on which side of the limit its probability lies: if the
// probability were equal to the limit, a share as far from it would occur with a probability of at
// most exp(-kClear) (Chernoff's bound).
bool is_clear(int agreeing, int drawn, double limit) {
  constexpr double kClear = 25;
  if (drawn == 0 || !(limit > 0 && limit < 1)) return false;
  const double n = drawn, share = agreeing / n;
  double divergence = 0;
  if (agreeing > 0) divergence += share * log(share / limit);
  if (agreeing < drawn) divergence += (1 - share) * log((1 - share) / (1 - limit));
  return n * divergence > kClear;
}

// Wrong matches, made of points of view 0 and other points of view 1, stored as RayPairs.
struct WrongPairs {
  double storage[18][kChunk];
  RayPairs arrays;

  explicit WrongPairs(const RayPairs& pairs) : arrays(pairs) {
    for (int k = 0; k < 18; ++k) array(k) = storage[k];
  }
  double*& array(int k) {  // an entry of the rays (k < 6) or of the Jacobians
    return k < 6 ? arrays.ray[k / 3][k % 3] : arrays.jacobian[k / 6 - 1][k % 6];
  }
  int count_agreeing(const RayPairs& pairs, const int listed[2][kChunk], const Mat3& M,
                     double threshold_px) {
    for (int v = 0; v < 2; ++v) {
      for (int k = 0; k < (pairs.on_plane ? 2 : 3); ++k) {
        for (int l = 0; l < kChunk; ++l) arrays.ray[v][k][l] = pairs.ray[v][k][listed[v][l]];
      }
      for (int k = 0; k < (pairs.on_plane ? 4 : 6); ++k) {
        for (int l = 0; l < kChunk; ++l) {
          arrays.jacobian[v][k][l] = pairs.jacobian[v][k][listed[v][l]];
        }
      }
    }
    double squares[kChunk];
    sampson_squares(arrays, 0, kChunk, M, squares);
    int agreeing = 0;
    for (double r_sq : squares) agreeing += r_sq <= threshold_px * threshold_px;
    return agreeing;
  }
};

}  // namespace

double log_binomial(int n, int k) {
  return log_factorial(n) - log_factorial(k) - log_factorial(n - k);
}

double log_false_alarms(int n, int k, int m, int models, double p) {
  if (k <= m) return kInfinity;
  return log(static_cast<double>(models) * (n - m)) + log_binomial(n, k) + log_binomial(k, m) +
         (k - m) * log(p);
}

double meaningful_chance(int n, int k, int m, int models) {
  return exp((kLogMeaningful - log(static_cast<double>(models) * (n - m)) - log_binomial(n, k) -
              log_binomial(k, m)) /
             (k - m));
}

WrongMatch draw_wrong_match(Random& random, int n) {
  const int first = static_cast<int>(random_below(random, static_cast<uint32_t>(n)));
  const int other = static_cast<int>(random_below(random, static_cast<uint32_t>(n - 1)));
  return {first, other + (other >= first)};
}

double chance_from_pairings(int agreeing, int drawn, int most, int n, double prior) {
  constexpr double kPriorWeight = 100;
  const double different = 0.5 * n * (n - 1.0);
  const double weight = different < most ? different : most;
  return (weight * agreeing / drawn + kPriorWeight * prior) / (weight + kPriorWeight);
}

double chance_of_agreement(const Matches& matches, const Mat3& M, double threshold_px,
                           uint64_t seed, double limit) {
  constexpr int kPairings = 1024;
  const RayPairs& pairs = matches.pairs;
  // The share of the image that a band around a line covers, of half width sqrt(2) T, because
  // Sampson's distance shares the error between the two images. The band's length is taken as the
  // image's side.
  const double prior = std::min(
      1.0, 2.8284271247461903 * threshold_px / std::sqrt(matches.area_px) * sigma_means(matches).s);
  const int n = matches.num_unique();
  if (n < 2) return 1;
  Random random = random_seeded(seed);
  WrongPairs wrong(pairs);
  int agreeing = 0, drawn = 0;
  while (drawn < kPairings && !is_clear(agreeing, drawn, limit)) {
    int listed[2][kChunk];
    for (int k = 0; k < kChunk; ++k) {
      const WrongMatch drawn_match = draw_wrong_match(random, n);
      listed[0][k] = drawn_match.first;
      listed[1][k] = drawn_match.second;
    }
    agreeing += wrong.count_agreeing(pairs, listed, M, threshold_px);
    drawn += kChunk;
  }
  return chance_from_pairings(agreeing, drawn, kPairings, n, prior);
}

}  // namespace tv
