// The median of numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace cli {

// Of an even number of values the upper one of the two in the middle. There must be one at least.
inline double median_of(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace cli
