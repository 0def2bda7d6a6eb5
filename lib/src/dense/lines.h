// The inner loops of semi-global matching. A line is the costs of the steps of one pixel; `count`
// is a multiple of kBlock.
#pragma once

#include <cstdint>

namespace tv {

// The window of the census: (2 kHalfAcross + 1) x (2 kHalfDown + 1) pixels.
inline constexpr int32_t kHalfAcross = 4, kHalfDown = 3;

// The cost of a change of parallax by one step along a path.
inline constexpr int32_t kSmall = 5;

// Above every cost and every sum of costs.
inline constexpr int16_t kNever = 8000;

// Loops over costs run in blocks of this many: a loop of known length becomes vector code in any
// build, and a small one.
inline constexpr int32_t kBlock = 8;

// The census of a row: each pixel before the middle of the window is compared with that opposite to
// it, which makes 31 bits. 0 where the window is not wholly inside.
void census_row(const uint8_t* pixels, int32_t width, int32_t height, int32_t y, uint32_t* census);

// The number of bits in which a word differs from each of `count` others.
void count_bits(uint32_t word, const uint32_t* others, int32_t count, int16_t* bits);

// One step of a path: the costs of a pixel from those of the pixel before, which are added to
// `sums`. least_before is the least of `before`, which has an entry of kNever before and behind it;
// large is the cost of a change by more than a step. Returns the least of `after`.
int16_t follow(const int16_t* cost, const int16_t* before, int16_t least_before, int16_t large,
               int32_t count, int16_t* __restrict after, int16_t* __restrict sums);

int16_t least_of_line(const int16_t* line, int32_t count);

// Lowers each of `least` to the sum beside it.
void lower(const int16_t* sums, int32_t count, int16_t* least);

}  // namespace tv
