// The share of simulated pairs whose true pose lies within the covariance's 95 per cent ellipsoid,
// for each class of motion. Noise of 0.5 px, 100 to 400 matches, up to 30 per cent of them wrong,
// three lenses (support/pair_kinds.h). TWOVIEW_PAIRS: pairs of each class, default 300;
// scripts/statistics takes 10000. TWOVIEW_SEED selects other pairs, TWOVIEW_KIND=K takes class
// number K only.
#include <Eigen/Cholesky>
#include <cstdlib>

#include "support/calls.h"
#include "support/estimator.h"
#include "support/pair_kinds.h"
#include "twoview/two_view.h"

namespace {

using scene::Vec5;
using tv::Mat3;
using tv::Vec3;
using Mat5 = Eigen::Matrix<double, 5, 5, Eigen::RowMajor>;

enum Class { kGeneral, kSideways, kForward, kLowParallax, kPlanar, kNumClasses };
const char* const kNames[kNumClasses] = {"general", "sideways", "forward", "parallax of 1 to 3 deg",
                                         "planar"};
constexpr double kChiSq95[6] = {0, 3.841, 5.991, 7.815, 9.488, 11.070};

tv_context* context;
pair_kinds::Pair pair;
int num_pairs = 300;
uint64_t base_seed = 1;

bool draw_pair(pair_kinds::Maker& maker, Class which) {
  tv::Random& random = maker.random;
  pair.num = 0;
  pair.kind = which == kPlanar ? pair_kinds::kPlanar : pair_kinds::kGeneral;
  pair.noise_px = 0.5;
  const tv_camera camera = pair_kinds::draw_camera(&random);
  for (int v = 0; v < 2; ++v) {
    pair.camera[v] = camera;
    maker.cameras[v] = tv::prepare_camera(camera);
  }
  pair_kinds::Ranges ranges;
  maker.draw_motion(ranges);
  const Vec3 jitter = 0.2 * scene::direction(&random);
  if (which == kSideways) pair.t = (Vec3(1, 0, 0) + jitter).normalized();
  if (which == kForward) pair.t = (Vec3(0, 0, -1) + jitter).normalized();
  const int num = 100 + static_cast<int>(tv::random_below(random, 301));
  const int num_wrong = static_cast<int>(num * scene::uniform(&random, 0, 0.3));
  bool made;
  if (which == kPlanar) {
    made = maker.put_plane(num - num_wrong);
  } else if (which == kLowParallax) {
    const double wanted = scene::uniform(&random, 1, 3) * tv::kPi / 180 * camera.fx;
    const tv::Random start = random;
    double scale = 5;
    made = true;
    for (int round = 0; round < 2 && made; ++round) {
      random = start;
      pair.num = 0;
      pair.noise_px = round == 0 ? 0 : 0.5;
      made = maker.put_general(num - num_wrong, scale);
      if (round == 0 && made) scale *= maker.median_parallax_px() / wanted;
    }
  } else {
    made = maker.put_general(num - num_wrong, 1);
  }
  if (made) maker.put_wrong(num_wrong);
  return made;
}

void test_the_ellipsoid_of_95_per_cent_holds_the_truth(void) {
  int share_wrong = 0;
  const char* only = std::getenv("TWOVIEW_KIND");
  std::printf("%-24s %6s %10s %12s %8s\n", "class", "pairs", "within [%]", "mean e'C^-1e",
              "no cov.");
  for (int which = 0; which < kNumClasses; ++which) {
    if (only != nullptr && which != std::atoi(only)) continue;
    int within = 0, total = 0, absent = 0;
    double sum = 0;
    for (int k = 0; k < num_pairs; ++k) {
      const uint64_t seed = base_seed * 1000003 + static_cast<uint64_t>(which * 100003 + k);
      pair_kinds::Maker maker{tv::random_seeded(seed), {}, &pair};
      while (!draw_pair(maker, static_cast<Class>(which))) {
      }
      tv_two_view r;
      tv_two_view_init(&r);
      TEST_ASSERT_EQUAL_INT(
          TV_OK, estimate_pixels(context, &pair.camera[0], &pair.camera[1], pair.pixels[0],
                                 pair.pixels[1], nullptr, pair.num, nullptr, &r, nullptr));
      if (r.has_covariance == 0) {
        ++absent;
        continue;
      }
      Vec5 e = scene::pose_error(r.R, r.t, pair.R, pair.t);
      const double* covariance = r.covariance;
      if (which == kPlanar && r.has_alternative != 0) {
        const Vec5 other = scene::pose_error(r.alternative_R, r.alternative_t, pair.R, pair.t);
        if (other.norm() < e.norm()) {
          e = other;
          covariance = r.alternative_covariance;
        }
      }
      const Mat5 C = Eigen::Map<const Mat5>(covariance);
      const double distance = e.dot(C.ldlt().solve(e));
      within += distance <= kChiSq95[5];
      sum += std::fmin(distance, 100.0);
      ++total;
      if (std::getenv("TWOVIEW_VERBOSE") != nullptr && distance > 100) {
        std::printf("far: seed %llu distance %.0f config %d %d matches\n",
                    static_cast<unsigned long long>(seed), distance, r.kind, pair.num);
      }
    }
    std::printf("%-24s %6d %10.2f %12.2f %8d\n", kNames[which], total, 100.0 * within / total,
                sum / total, absent);
    const double spread = 3 * std::sqrt(0.95 * 0.05 / total);
    const double share = static_cast<double>(within) / total;
    share_wrong += share < 0.93 - spread || share > 0.97 + spread;
    TEST_ASSERT_TRUE(50 * absent <= num_pairs);
  }
  TEST_ASSERT_EQUAL_INT(0, share_wrong);
}

}  // namespace

void setUp(void) { context = estimator::make_context(pair_kinds::kMaxMatches); }

void tearDown(void) {}

int main(void) {
  estimator::read_environment(1, &num_pairs, &base_seed);
  UNITY_BEGIN();
  RUN_TEST(test_the_ellipsoid_of_95_per_cent_holds_the_truth);
  return UNITY_END();
}
