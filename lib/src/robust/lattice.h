// Whether points lie on a lattice, as the corners of windows or tiles do: such points match as well
// one period off. Formula: docs/algorithms/two_view.md, second model and lattice. Tests:
// test/unit/test_lattice.cc.
#pragma once

#include <cstdint>

#include "base/arena.h"

namespace tv {

// For each point's nearest neighbours: how many have another point at the opposite place, minus how
// many have one at a place where a lattice has none, which is the number expected by chance.
struct Lattice {
  double share;   // difference of the counts as a share of the neighbours; nearly 1 on a lattice
  double sigmas;  // difference of the counts over its standard deviation for random points
};

// xy: num x 2. listed: null, or the indices of the points whose neighbours are examined. Of a list
// at most 64 points are examined, of all points at most 512.
Lattice find_lattice(const double* xy, int num, const int32_t* listed, int num_listed,
                     Arena& arena);
size_t lattice_bytes(int max_points);

// The share of the neighbours of the listed points that have another point at the opposite place, a
// bound of find_lattice's share in half of its time; 0 as soon as it is known to be at most
// `least`.
double opposite_share(const double* xy, int num, const int32_t* listed, int num_listed,
                      double least, Arena& arena);

}  // namespace tv
