// How often the verdict names the kind of a simulated pair (support/pair_kinds.h has the kinds and
// their ranges), how often a solvable pair gets its "ok", and how often an "ok" is wrong.
// TWOVIEW_PAIRS: pairs of each kind, default 100; scripts/statistics takes 10000. TWOVIEW_SEED
// selects other pairs. TWOVIEW_KIND=K takes pairs of kind number K only. TWOVIEW_VERBOSE=1 prints
// each pair that is misnamed, each solvable one without "ok", and each wrong "ok".
#include <cstdlib>

#include "support/calls.h"
#include "support/estimator.h"
#include "support/pair_kinds.h"
#include "twoview/two_view.h"

namespace {

using pair_kinds::Kind;

tv_context* context;
pair_kinds::Pair pair;
int num_pairs = 100;
uint64_t base_seed = 1;
bool verbose = false;

struct Count {
  int pairs, named, solvable, ok_of_solvable, ok, wrong_ok;
};
Count counts[pair_kinds::kNumKinds];

uint32_t other_reasons(const tv_two_view& r, uint32_t expected) {
  const uint32_t naming = TV_REASON_TOO_FEW_MATCHES | TV_REASON_SECOND_MOTION |
                          TV_REASON_REPEATED_STRUCTURE | TV_REASON_LOW_PARALLAX;
  return r.reasons & naming & ~expected;
}

bool named_right(const tv_two_view& r) {
  switch (pair.kind) {
    case pair_kinds::kGeneral: return r.kind == TV_KIND_CALIBRATED && other_reasons(r, 0) == 0;
    case pair_kinds::kPlanar:  // a plane may also have low parallax
      return r.kind == TV_KIND_PLANAR && other_reasons(r, TV_REASON_LOW_PARALLAX) == 0;
    case pair_kinds::kPureRotation: return r.kind == TV_KIND_PANORAMIC;
    case pair_kinds::kNoMotion: return r.kind == TV_KIND_NO_MOTION;
    case pair_kinds::kLowParallax: return (r.reasons & TV_REASON_LOW_PARALLAX) != 0;
    case pair_kinds::kTooFew: return (r.reasons & TV_REASON_TOO_FEW_MATCHES) != 0;
    case pair_kinds::kSecondMotion: return (r.reasons & TV_REASON_SECOND_MOTION) != 0;
    case pair_kinds::kLattice: return (r.reasons & TV_REASON_REPEATED_STRUCTURE) != 0;
    case pair_kinds::kForwardMove:
    case pair_kinds::kScaleChange: break;
  }
  return false;
}

// Whether the matches determine one pose: in a general scene, and for a plane whose other motion
// they exclude.
bool solvable() {
  return pair.kind == pair_kinds::kGeneral ||
         (pair.kind == pair_kinds::kPlanar && pair.other_motion_excluded);
}

double pose_error_deg(const tv_two_view& r) {
  if (r.has_R == 0) return 180;
  const double rotation = scene::rotation_error_deg(r.R, pair.R);
  if (r.has_t == 0 || pair.t.norm() == 0) return rotation;
  return std::fmax(rotation, scene::translation_error_deg(r.t, pair.t));
}

void print_pair(const char* what, const EstimatedPair& r, uint64_t seed) {
  if (!verbose) return;
  std::printf(
      "%s: %s seed %llu: %s %s reasons %x, %d matches, inliers %d (E %d H %d R %d), "
      "parallax %.2f deg, rms %.2f noise %.2f (true %.2f) coverage %.2f error %.2f deg\n",
      what, pair_kinds::name_of(pair.kind), static_cast<unsigned long long>(seed),
      tv_kind_string(static_cast<tv_kind>(r.kind)),
      tv_verdict_string(static_cast<tv_verdict>(r.verdict)), r.reasons, r.num_matches,
      r.num_inliers, r.evidence.essential_inliers, r.evidence.homography_inliers,
      r.evidence.rotation_inliers, r.median_parallax_rad * 180 / tv::kPi, r.rms_error_px,
      r.noise_px, pair.noise_px, r.evidence.coverage, pose_error_deg(r));
}

void judge(uint64_t seed) {
  tv_estimate_options options;
  tv_estimate_options_init(&options);
  EstimatedPair r;
  tv_two_view_init_sized(&r, sizeof(tv_two_view));
  TEST_ASSERT_EQUAL_INT(TV_OK, estimate_evidence(context, &pair.camera[0], &pair.camera[1],
                                                 pair.pixels[0], pair.pixels[1], nullptr, pair.num,
                                                 &options, &r, &r.evidence, nullptr));
  Count& c = counts[pair.kind];
  ++c.pairs;
  const bool named = named_right(r), ok = r.verdict == TV_VERDICT_OK;
  c.named += named;
  c.ok += ok;
  if (!named) print_pair("misnamed", r, seed);
  if (solvable()) {
    ++c.solvable;
    c.ok_of_solvable += ok;
    if (!ok && named) print_pair("not ok", r, seed);
  }
  if (ok && pose_error_deg(r) > 5) {
    ++c.wrong_ok;
    print_pair("wrong ok", r, seed);
  }
}

// Requires at least `share` of n, less three standard deviations of a binomial count.
bool at_least(int count, int n, double share) {
  return count >= n * share - 3 * std::sqrt(n * share * (1 - share));
}

void test_the_verdict_names_the_kind_and_ok_means_ok(void) {
  const pair_kinds::Ranges ranges;
  int ok = 0, wrong = 0, solvable_pairs = 0, ok_of_solvable = 0;
  const char* only = std::getenv("TWOVIEW_KIND");
  std::printf("%-14s %6s  %9s  %9s  %8s\n", "kind", "pairs", "named [%]", "ok [%]", "wrong ok");
  for (int kind = 0; kind < pair_kinds::kNumKinds; ++kind) {
    if (only != nullptr && kind != std::atoi(only)) continue;
    for (int k = 0; k < num_pairs; ++k) {
      const uint64_t seed = base_seed * 1000003 + static_cast<uint64_t>(kind * 100003 + k);
      pair_kinds::make(static_cast<Kind>(kind), ranges, seed, &pair);
      judge(seed);
    }
    const Count& c = counts[kind];
    std::printf("%-14s %6d  %9.2f  ", pair_kinds::name_of(kind), c.pairs,
                100.0 * c.named / c.pairs);
    if (c.solvable > 0) {
      std::printf("%9.2f", 100.0 * c.ok_of_solvable / c.solvable);
    } else {
      std::printf("%9s", "-");
    }
    std::printf("  %3d of %d\n", c.wrong_ok, c.ok);
    ok += c.ok;
    wrong += c.wrong_ok;
    solvable_pairs += c.solvable;
    ok_of_solvable += c.ok_of_solvable;
  }
  std::printf("all: ok for %d of %d solvable; %d of %d ok wrong by 5 degrees\n", ok_of_solvable,
              solvable_pairs, wrong, ok);
  for (const Count& c : counts) TEST_ASSERT_TRUE(at_least(c.named, c.pairs, 0.99));
  TEST_ASSERT_TRUE(at_least(ok_of_solvable, solvable_pairs, 0.95));
  TEST_ASSERT_LESS_OR_EQUAL_INT(1 + ok / 10000, wrong);
}

}  // namespace

void setUp(void) { context = estimator::make_context(pair_kinds::kMaxMatches); }

void tearDown(void) {}

int main(void) {
  verbose = std::getenv("TWOVIEW_VERBOSE") != nullptr;
  estimator::read_environment(1, &num_pairs, &base_seed);
  UNITY_BEGIN();
  RUN_TEST(test_the_verdict_names_the_kind_and_ok_means_ok);
  return UNITY_END();
}
