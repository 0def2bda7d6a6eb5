// The sampler, which chooses the matches that the robust loop tries next.
#pragma once

#include <cstdint>

#include "base/random.h"

namespace tv {

// PROSAC (O. Chum, J. Matas, "Matching with PROSAC: progressive sample consensus", CVPR 2005): the
// matches are sorted, most certain first; samples come from a pool of the first ones, which grows
// so that after kProsacSamples samples a match it has drawn the certain ones as often as uniform
// sampling would. Once the pool holds all, or without an order, sampling is uniform. Every other
// sample is uniform from the start: the most certain matches may lie on one plane, or on a repeated
// structure.
struct Sampler {
  Random random;
  int num, size;  // number of matches, and how many of them a sample takes
  bool progressive;
  int pool;             // samples come from the first `pool` matches
  double average;       // T_n of the PROSAC paper for the present pool
  int64_t next_growth;  // T'_n of the PROSAC paper: the draw at which the pool grows
  int64_t drawn;        // number of samples drawn from the pool
  bool uniform_next;
};

inline constexpr double kProsacSamples = 10;

Sampler make_sampler(uint64_t seed, int num, int size, bool progressive);

// Writes `size` different indices of matches. num >= size.
void draw_sample(Sampler& sampler, int32_t* sample);

}  // namespace tv
