// Order statistics (base/order.h).
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <vector>

#include "base/order.h"
#include "base/random.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

void test_nth_smallest_is_what_sorting_gives() {
  const uint64_t seed = 20261125;
  printf("seed %llu\n", static_cast<unsigned long long>(seed));
  tv::Random random = tv::random_seeded(seed);
  for (int count = 1; count < 200; ++count) {
    std::vector<double> values(static_cast<size_t>(count));
    for (double& x : values) x = tv::random_below(random, 50);  // many are equal
    std::vector<double> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    const int n = static_cast<int>(tv::random_below(random, static_cast<uint32_t>(count)));
    std::vector<double> copy = values;
    TEST_ASSERT_EQUAL_DOUBLE(sorted[static_cast<size_t>(n)],
                             tv::nth_smallest(copy.data(), count, n));
    TEST_ASSERT_EQUAL_DOUBLE(sorted[static_cast<size_t>(count / 2)],
                             tv::median(values.data(), count));
  }
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_nth_smallest_is_what_sorting_gives);
  return UNITY_END();
}
