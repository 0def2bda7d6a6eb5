// Helpers of the tests over many simulated pairs: a context for estimation alone, the number of
// pairs, and the seed. Storage is static, since a failing Unity test leaves by longjmp, which skips
// destructors.
#ifndef TEST_SUPPORT_ESTIMATOR_H
#define TEST_SUPPORT_ESTIMATOR_H

#include <cstdio>
#include <cstdlib>

#include "twoview/context.h"
#include "unity.h"

namespace estimator {

// Makes a context that estimates from up to max_matches matches and has no room for images. Only
// one exists at a time.
inline tv_context* make_context(int max_matches) {
  alignas(TV_CONTEXT_ALIGNMENT) static uint8_t memory[8 << 20];
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 64;
  limits.max_keypoints = 1;
  limits.max_matches = max_matches;
  size_t size_bytes;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &size_bytes));
  TEST_ASSERT_TRUE(size_bytes <= sizeof memory);
  tv_context* context = nullptr;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_init(&context, &limits, memory, size_bytes));
  return context;
}

// Reads TWOVIEW_PAIRS and TWOVIEW_SEED where they are set. A count below `fewest` would make the
// test meaningless and ends the program.
inline void read_environment(int fewest, int* num_pairs, uint64_t* seed) {
  if (const char* text = std::getenv("TWOVIEW_PAIRS")) *num_pairs = std::atoi(text);
  if (const char* text = std::getenv("TWOVIEW_SEED")) *seed = std::strtoull(text, nullptr, 10);
  std::printf("TWOVIEW_SEED=%llu TWOVIEW_PAIRS=%d\n", static_cast<unsigned long long>(*seed),
              *num_pairs);
  if (*num_pairs >= fewest) return;
  std::printf("TWOVIEW_PAIRS is to be at least %d\n", fewest);
  std::exit(2);
}

}  // namespace estimator

#endif
