// Which image is named first makes no difference to what is reported: simulated pairs of all kinds,
// forward moves and changes of scale by 2 among them, are estimated in both orders. The kind, the
// verdict, the reasons and the evidence must be the same to the last bit, and R the transposed one.
// TWOVIEW_PAIRS: pairs in all, default 400, or 100 under sanitizers; scripts/statistics takes
// 10000. TWOVIEW_SEED selects other pairs. TWOVIEW_VERBOSE=1 prints each pair that differs.
#include <cstdlib>
#include <cstring>

#include "support/calls.h"
#include "support/estimator.h"
#include "support/pair_kinds.h"
#include "support/sanitized.h"
#include "twoview/two_view.h"

namespace {

tv_context* context;
pair_kinds::Pair pair;
float ratios[pair_kinds::kMaxMatches];
int num_pairs = kSanitized ? 100 : 400;
uint64_t base_seed = 1;
bool verbose = false;

EstimatedPair estimate(bool calibrated, bool swapped, const float* of_matches) {
  tv_estimate_options options;
  tv_estimate_options_init(&options);
  if (!calibrated) options.method = TV_SOLVER_EIGHT_POINT;
  EstimatedPair r;
  tv_two_view_init_sized(&r, sizeof(tv_two_view));
  const int first = swapped ? 1 : 0;
  TEST_ASSERT_EQUAL_INT(
      TV_OK, estimate_evidence(context, calibrated ? &pair.camera[first] : nullptr,
                               calibrated ? &pair.camera[1 - first] : nullptr, pair.pixels[first],
                               pair.pixels[1 - first], of_matches, pair.num, &options, &r,
                               &r.evidence, nullptr));
  return r;
}

bool same_report(const EstimatedPair& a, const EstimatedPair& b) {
  return std::memcmp(&a.evidence, &b.evidence, sizeof a.evidence) == 0 && a.kind == b.kind &&
         a.verdict == b.verdict && a.reasons == b.reasons &&
         a.probability_wrong == b.probability_wrong && a.num_matches == b.num_matches &&
         a.num_inliers == b.num_inliers && a.num_iterations == b.num_iterations &&
         a.num_still == b.num_still && a.median_parallax_rad == b.median_parallax_rad &&
         a.rms_error_px == b.rms_error_px && a.noise_px == b.noise_px && a.has_R == b.has_R &&
         a.has_t == b.has_t && a.has_H == b.has_H && a.has_F == b.has_F &&
         a.has_covariance == b.has_covariance && a.has_alternative == b.has_alternative;
}

bool transposed(const EstimatedPair& a, const EstimatedPair& b) {
  for (int k = 0; k < 9; ++k) {
    if (a.has_R != 0 && a.R[k] != b.R[3 * (k % 3) + k / 3]) return false;
  }
  return true;
}

void test_swapped_images_get_the_same_verdict(void) {
  const pair_kinds::Ranges ranges;
  const int num_each = (num_pairs + pair_kinds::kNumAllKinds - 1) / pair_kinds::kNumAllKinds;
  int num_done = 0, num_different = 0;
  for (int kind = 0; kind < pair_kinds::kNumAllKinds; ++kind) {
    int different = 0, crowded = 0, ok = 0;
    for (int k = 0; k < num_each; ++k) {
      const uint64_t seed = base_seed * 1000003 + static_cast<uint64_t>(kind * 100003 + k);
      pair_kinds::make(static_cast<pair_kinds::Kind>(kind), ranges, seed, &pair);
      const bool calibrated = k % 8 != 7;
      const EstimatedPair a = estimate(calibrated, false, nullptr);
      const EstimatedPair b = estimate(calibrated, true, nullptr);
      const bool same = same_report(a, b) && transposed(a, b);
      different += !same;
      crowded += (a.reasons & TV_REASON_CROWDED_MATCHES) != 0;
      ok += a.verdict == TV_VERDICT_OK;
      if (!same && verbose) {
        std::printf("%s seed %llu: verdict %d %d reasons %x %x coverage %.3f %.3f\n",
                    pair_kinds::name_of(kind), static_cast<unsigned long long>(seed), a.verdict,
                    b.verdict, a.reasons, b.reasons, a.evidence.coverage, b.evidence.coverage);
      }
    }
    std::printf("%-14s %6d pairs, %d differ when swapped; %d ok, %d crowded\n",
                pair_kinds::name_of(kind), num_each, different, ok, crowded);
    num_done += num_each;
    num_different += different;
  }
  std::printf("all: %d of %d pairs differ when swapped\n", num_different, num_done);
  TEST_ASSERT_EQUAL_INT(0, num_different);
}

// Every match is there in both directions, so neither the pixels nor the cameras show which view
// comes first; with equal ratios nothing does. In the second case a match and its reversed copy
// have different ratios.
void test_matches_that_are_the_same_in_both_orders(void) {
  const pair_kinds::Ranges ranges;
  for (int k = 0; k < 20; ++k) {
    pair_kinds::make(pair_kinds::kGeneral, ranges, base_seed * 1000003 + static_cast<uint64_t>(k),
                     &pair);
    const int half = pair.num / 2;
    for (int i = 0; i < half; ++i) {
      for (int v = 0; v < 2; ++v) {
        std::memcpy(pair.pixels[v] + 2 * (half + i), pair.pixels[1 - v] + 2 * i,
                    2 * sizeof(double));
      }
      ratios[i] = 0.5f + 0.0004f * static_cast<float>(i);
      ratios[half + i] = 0.9f - 0.0003f * static_cast<float>(i);
    }
    pair.num = 2 * half;
    TEST_ASSERT_TRUE(same_report(estimate(true, false, nullptr), estimate(true, true, nullptr)));
    const EstimatedPair a = estimate(true, false, ratios), b = estimate(true, true, ratios);
    TEST_ASSERT_TRUE(same_report(a, b) && transposed(a, b));
  }
}

}  // namespace

void setUp(void) { context = estimator::make_context(pair_kinds::kMaxMatches); }

void tearDown(void) {}

int main(void) {
  verbose = std::getenv("TWOVIEW_VERBOSE") != nullptr;
  estimator::read_environment(1, &num_pairs, &base_seed);
  UNITY_BEGIN();
  RUN_TEST(test_swapped_images_get_the_same_verdict);
  RUN_TEST(test_matches_that_are_the_same_in_both_orders);
  return UNITY_END();
}
