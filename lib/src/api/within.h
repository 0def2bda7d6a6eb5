// Whether an option lies in its range.
#pragma once

#include <cstdint>

namespace tv {

// Whether the value is in [low, high]; false for a NaN.
inline bool within(int32_t value, int32_t low, int32_t high) {
  return value >= low && value <= high;
}
inline bool within(float value, float low, float high) { return value >= low && value <= high; }
inline bool within(double value, double low, double high) { return value >= low && value <= high; }

}  // namespace tv
