// The bytes of an estimate depend on its matches and options alone: neither on the kernel set nor
// on what the context's memory held before. Simulated pairs of all kinds, in which a third of the
// matches is given twice, are estimated with every kernel set that this machine runs, in memory
// that was filled with zeros, with ones, and with the bits of a large number.
// TWOVIEW_PAIRS: pairs in all, default 80, or 30 under sanitizers. TWOVIEW_SEED selects other
// pairs.
#include <cstdlib>
#include <cstring>

#include "support/estimator.h"
#include "support/pair_kinds.h"
#include "support/sanitized.h"
#include "twoview/two_view.h"

namespace {

constexpr int kFills[] = {0x00, 0xff, 0x7f};

struct Memory {
  alignas(TV_CONTEXT_ALIGNMENT) uint8_t bytes[8 << 20];
};
Memory memory;
pair_kinds::Pair pair;
double pixels[2][2 * pair_kinds::kMaxMatches];
float ratios[pair_kinds::kMaxMatches], sigmas[2][pair_kinds::kMaxMatches];
int num_pairs = kSanitized ? 30 : 80;
uint64_t base_seed = 1;

struct Result {
  tv_two_view two_view;
  uint8_t mask[pair_kinds::kMaxMatches];
};
Result expected, actual;

// Null if this machine does not run the kernel set.
tv_context* context_in(int fill, int set) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 64;
  limits.max_keypoints = 1;
  limits.max_matches = pair_kinds::kMaxMatches;
  limits.kernels = set;
  size_t size_bytes;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_context_size(&limits, &size_bytes));
  TEST_ASSERT_TRUE(size_bytes <= sizeof memory.bytes);
  std::memset(memory.bytes, fill, size_bytes);
  tv_context* context = nullptr;
  const tv_status status = tv_context_init(&context, &limits, memory.bytes, size_bytes);
  TEST_ASSERT_TRUE(status == TV_OK || status == TV_ERR_KERNELS);
  return status == TV_OK ? context : nullptr;
}

// Copies the pair's matches and repeats every third one behind them, with another sigma.
int repeat_matches(uint64_t seed) {
  tv::Random random = tv::random_seeded(seed);
  int num = 0;
  for (int pass = 0; pass < 2; ++pass) {
    for (int k = 0; k < pair.num; k += pass == 0 ? 1 : 3, ++num) {
      for (int v = 0; v < 2; ++v) {
        for (int d = 0; d < 2; ++d) pixels[v][2 * num + d] = pair.pixels[v][2 * k + d];
        sigmas[v][num] = static_cast<float>(scene::uniform(&random, 0.7, 2));
      }
      ratios[num] = pass == 0 ? static_cast<float>(scene::uniform(&random, 0, 0.9)) : ratios[k];
    }
  }
  return num;
}

void estimate(tv_context* context, int num, bool calibrated, bool with_sigmas, Result* r) {
  tv_pixel_pairs pairs;
  tv_pixel_pairs_init(&pairs);
  pairs.num = num;
  pairs.pixels0 = pixels[0];
  pairs.pixels1 = pixels[1];
  pairs.ratios = ratios;
  if (with_sigmas) {
    pairs.sigmas0 = sigmas[0];
    pairs.sigmas1 = sigmas[1];
  }
  std::memset(r, 0, sizeof *r);
  tv_two_view_init(&r->two_view);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_two_view(context, calibrated ? &pair.camera[0] : nullptr,
                                                    calibrated ? &pair.camera[1] : nullptr, &pairs,
                                                    nullptr, &r->two_view, nullptr, r->mask));
}

void test_bytes_depend_on_the_matches_alone(void) {
  const pair_kinds::Ranges ranges;
  const int num_each = (num_pairs + pair_kinds::kNumAllKinds - 1) / pair_kinds::kNumAllKinds;
  int num_different = 0, num_sets = 0;
  for (int kind = 0; kind < pair_kinds::kNumAllKinds; ++kind) {
    for (int k = 0; k < num_each; ++k) {
      const uint64_t seed = base_seed * 1000003 + static_cast<uint64_t>(kind * 100003 + k);
      pair_kinds::make(static_cast<pair_kinds::Kind>(kind), ranges, seed, &pair);
      const int num = repeat_matches(seed);
      const bool calibrated = k % 8 != 7, with_sigmas = k % 2 != 0;
      num_sets = 0;
      for (int set = TV_KERNELS_C; set <= TV_KERNELS_NEON; ++set) {
        for (int fill : kFills) {
          tv_context* const context = context_in(fill, set);
          if (context == nullptr) break;
          num_sets += fill == kFills[0];
          const bool is_first = set == TV_KERNELS_C && fill == kFills[0];
          estimate(context, num, calibrated, with_sigmas, is_first ? &expected : &actual);
          if (is_first || std::memcmp(&expected, &actual, sizeof actual) == 0) continue;
          ++num_different;
          std::printf("%s seed %llu: set %s in memory of 0x%02x: other bytes\n",
                      pair_kinds::name_of(kind), static_cast<unsigned long long>(seed),
                      tv_kernels_string(static_cast<tv_kernels>(set)), fill);
        }
      }
    }
  }
  std::printf("%d pairs, %d kernel sets: %d results differ\n", num_each * pair_kinds::kNumAllKinds,
              num_sets, num_different);
  TEST_ASSERT_EQUAL_INT(0, num_different);
}

}  // namespace

void setUp(void) {}
void tearDown(void) {}

int main(void) {
  estimator::read_environment(pair_kinds::kNumAllKinds, &num_pairs, &base_seed);
  UNITY_BEGIN();
  RUN_TEST(test_bytes_depend_on_the_matches_alone);
  return UNITY_END();
}
