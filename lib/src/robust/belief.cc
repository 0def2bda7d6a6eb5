#include "robust/belief.h"

#include <algorithm>

#include "base/math.h"

namespace tv {
namespace {

// One term of the logit of the probability that the pose is wrong: its weight, and the reason that
// is given where the term is large. usual: the median of the evidence over right poses, where the
// term is 0.
struct Part {
  double weight, usual;
  uint32_t reason;
};

// scripts/belief --fit prints these lines.
constexpr double kBias = 9.609;
constexpr Part kDisagreement = {1.528, -1.999, TV_REASON_LOW_INLIER_RATIO};
constexpr Part kNoise = {1.986, 0.398, TV_REASON_LOW_INLIER_RATIO};
constexpr Part kPlaces = {-3.085, 2.996, TV_REASON_TOO_FEW_MATCHES};
constexpr Part kRegionShift = {0.510, -7.044, TV_REASON_CROWDED_MATCHES};
constexpr double kAlternative = 2.114;

// The number of places counts up to this value only: a pose with more of them may be wrong, but not
// because its places are few.
constexpr double kEnoughPlaces = 20;

double clamped(double x, double low, double high) { return std::max(low, std::min(x, high)); }

}  // namespace

Belief belief_of(const Evidence& e) {
  const double places = std::min(e.num_places[0], e.num_places[1]);
  const double shift = clamped(e.region_shift_rad, 0.05 * kPi / 180, 20 * kPi / 180);
  const struct {
    Part part;
    double value;
  } found[] = {{kDisagreement, log(1.02 - clamped(e.agreement, 0, 1))},
               {kNoise, clamped(e.noise_px / e.threshold_px, 0, 1)},
               {kPlaces, log(clamped(places, 1, kEnoughPlaces))},
               {kRegionShift, log(shift)}};
  double logit = kBias + (e.has_alternative ? kAlternative : 0);
  // Of several attempts at a pair, each can be wrong by accident: the odds add up.
  if (e.num_trials > 1) logit += log(e.num_trials);
  double most = 0;
  for (const auto& f : found) {
    logit += f.part.weight * f.value;
    most = std::max(most, f.part.weight * (f.value - f.part.usual));
  }
  uint32_t raised_by = 0;
  for (const auto& f : found) {
    if (2 * f.part.weight * (f.value - f.part.usual) >= most) raised_by |= f.part.reason;
  }
  return {1 / (1 + exp(-logit)), raised_by};
}

}  // namespace tv
