#include "base/order.h"

#include <algorithm>

namespace tv {

double nth_smallest(double* values, int count, int n) {
  std::nth_element(values, values + n, values + count);
  return values[n];
}

}  // namespace tv
