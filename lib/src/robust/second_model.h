// Whether what the pair's model leaves over follows a model of its own: a second motion, or the
// same scene matched one period off.
#pragma once

#include "robust/estimators.h"

namespace tv {

struct SecondModel {
  bool found = false;
  Pose pose;
  int num_inliers = 0;
};

size_t second_model_bytes(int max_matches);

// Searches the unique matches that the first model does not explain (explained[i] is 0; its
// inliers' tail, too, is to be marked) for a pose of their own. Found: the model is meaningful
// among them (chance.h), and counts at least kSecondShare of num_first.
inline constexpr double kSecondShare = 0.15;
SecondModel find_second_model(const Matches& matches, const uint8_t* explained, int num_first,
                              double threshold_px, uint64_t seed, Arena& arena);

// Whether points lie as on a lattice: of a point's nearest neighbours, how many have another point
// at the opposite place, less those that have one at a place where a lattice has none, which is
// chance. xy: num x 2; listed: null or the indices of the points that are asked.
struct Lattice {
  double share;   // of neighbours, chance taken off; a full lattice has nearly 1
  double sigmas;  // how many standard deviations of a count of chance that is
};
Lattice find_lattice(const double* xy, int num, const int32_t* listed, int num_listed,
                     Arena& arena);
size_t lattice_bytes(int max_points);

}  // namespace tv
