#include "dense/lines.h"

#include <cstddef>

namespace tv {
namespace {

int16_t least_of(const int16_t* block) {
  int16_t least = block[0];
  for (int32_t i = 1; i < kBlock; ++i) least = block[i] < least ? block[i] : least;
  return least;
}

}  // namespace

void census_row(const uint8_t* pixels, int32_t width, int32_t height, int32_t y, uint32_t* census) {
  for (int32_t x = 0; x < width; ++x) census[x] = 0;
  if (y < kHalfDown || y + kHalfDown >= height) return;
  const uint8_t* middle = pixels + static_cast<ptrdiff_t>(y) * width;
  for (int32_t dy = -kHalfDown; dy <= 0; ++dy) {
    const int32_t last = dy < 0 ? kHalfAcross : -1;
    for (int32_t dx = -kHalfAcross; dx <= last; ++dx) {
      const ptrdiff_t offset = static_cast<ptrdiff_t>(dy) * width + dx;
      const uint8_t *before = middle + offset, *after = middle - offset;
      for (int32_t x = kHalfAcross; x < width - kHalfAcross; ++x) {
        census[x] = census[x] << 1 | (before[x] < after[x] ? 1u : 0u);
      }
    }
  }
}

void count_bits(uint32_t word, const uint32_t* others, int32_t count, int16_t* bits) {
  for (int32_t k = 0; k < count; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      uint32_t v = word ^ others[k + i];
      v = v - (v >> 1 & 0x55555555u);
      v = (v & 0x33333333u) + (v >> 2 & 0x33333333u);
      v = (v + (v >> 4)) & 0x0f0f0f0fu;
      v = v + (v >> 8);
      bits[k + i] = static_cast<int16_t>((v + (v >> 16)) & 63u);
    }
  }
}

int16_t follow(const int16_t* cost, const int16_t* before, int16_t least_before, int16_t large,
               int32_t count, int16_t* __restrict after, int16_t* __restrict sums) {
  const int16_t jump = static_cast<int16_t>(least_before + large);
  int16_t least[kBlock];
  for (int16_t& value : least) value = kNever;
  for (int32_t k = 0; k < count; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      const int16_t left = before[k + i - 1], right = before[k + i + 1], same = before[k + i];
      int16_t way = left < right ? left : right;
      way = static_cast<int16_t>(way + kSmall);
      way = same < way ? same : way;
      way = jump < way ? jump : way;
      way = static_cast<int16_t>(way + cost[k + i] - least_before);
      after[k + i] = way;
      sums[k + i] = static_cast<int16_t>(sums[k + i] + way);
      least[i] = way < least[i] ? way : least[i];
    }
  }
  return least_of(least);
}

int16_t least_of_line(const int16_t* line, int32_t count) {
  int16_t block[kBlock];
  for (int16_t& value : block) value = kNever;
  for (int32_t k = 0; k < count; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      block[i] = line[k + i] < block[i] ? line[k + i] : block[i];
    }
  }
  return least_of(block);
}

void lower(const int16_t* sums, int32_t count, int16_t* least) {
  for (int32_t k = 0; k < count; k += kBlock) {
    for (int32_t i = 0; i < kBlock; ++i) {
      const int16_t old = least[k + i];
      least[k + i] = sums[k + i] < old ? sums[k + i] : old;
    }
  }
}

}  // namespace tv
