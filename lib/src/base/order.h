// Order statistics. Tests: test/unit/test_order.cc.
#pragma once

namespace tv {

// The value that has n smaller or equal ones before it, n < count, when the `count` values are
// sorted. Changes their order.
double nth_smallest(double* values, int count, int n);

// The middle one of `count` > 0 values, the upper of two.
inline double median(double* values, int count) { return nth_smallest(values, count, count / 2); }

}  // namespace tv
