// A wide lens costs no accuracy: planar pairs seen through a lens like the AR.Drone's, and the same
// pairs through a pinhole of the same focal length. TWOVIEW_PAIRS is the number of pairs,
// TWOVIEW_SEED selects other ones.
//
// The pinhole is tried twice: with points spread over its own image, as the lens's are over its
// own; and with the lens's very points and noise, which lie up to 1.3 times as far out as the
// pinhole's image reaches. There half a pixel is a smaller angle for the pinhole than for the lens,
// whose scale in the corners is 0.56: the pinhole's matches contain more information. By the
// Cramer-Rao bound (pose and plane, noise in both views, the true inliers, 400 pairs of this
// generator: AUC@1/5/10 of 52.6, 89.0, 94.5 for the lens and 61.1, 91.5, 95.7 for the pinhole) no
// estimator can be within two points there.
#include <cmath>
#include <cstdlib>

#include "support/calls.h"
#include "support/estimator.h"
#include "support/scene.h"
#include "twoview/two_view.h"

namespace {

using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr int kNum = 200, kNumTrue = 140;  // 60 of 200 matches are wrong
constexpr double kNoisePx = 0.5;
constexpr int kMaxPairs = 100000;
constexpr int kThresholdsDeg[3] = {1, 5, 10};
const double kInfinite = HUGE_VAL;

tv_context* context;
uint64_t seed = 360;
int num_pairs = 100;

// AUC@1/5/10, in points, by which the Cramer-Rao bound puts the pinhole above the lens where both
// see the lens's points (see above).
constexpr double kBoundLoss[3] = {8.5, 2.5, 1.2};

enum { kLens, kPinhole, kNumCameras };
const tv_camera kCameras[kNumCameras] = {
    {TV_CAMERA_BROWN_CONRADY, 640, 360, 0, 560, 560, 319.5, 179.5, {-0.5, 0.25}},
    {TV_CAMERA_PINHOLE, 640, 360, 0, 560, 560, 319.5, 179.5, {}}};
tv::Camera cameras[kNumCameras];

// A view is the camera that takes the pictures, and the camera over whose image the points are
// spread.
enum { kLensView, kPinholeOwn, kPinholeSame, kNumViews };
struct View {
  const char* name;
  int camera, points;
};
const View kViews[kNumViews] = {{"lens", kLens, kLens},
                                {"pinhole, its own points", kPinhole, kPinhole},
                                {"pinhole, the lens's points", kPinhole, kLens}};

struct Pair {
  Mat3 R;
  Vec3 t, plane;  // t has length 1; the points X lie on plane' X = distance
  double distance;
  double pixels[2][2 * kNum];
};
Pair pair;

// The pose whose error counts: the primary one, or of a plane's two the one nearer to the truth.
enum { kPrimary, kNearer, kNumRules };
double errors[kNumViews][kNumRules][kMaxPairs];

bool in_image(const Vec2& p) { return p[0] >= 0 && p[0] <= 639 && p[1] >= 0 && p[1] <= 359; }

// A point of the plane that both views of the camera see, spread evenly over the first image.
bool see(tv::Random* random, int camera, Vec3 points[2]) {
  const Vec2 pixel(scene::uniform(random, 0, 639), scene::uniform(random, 0, 359));
  Vec3 ray;
  Vec2 other;
  if (!tv::unproject(cameras[camera], pixel, &ray, nullptr)) return false;
  const double along = pair.plane.dot(ray);
  if (along < 0.05) return false;
  points[0] = pair.distance / along * ray;
  points[1] = pair.R * points[0] + pair.t;
  return points[1][2] > 0.05 && tv::project(cameras[camera], points[1], &other, nullptr) &&
         in_image(other);
}

// The pose turns by 5 to 30 degrees about any axis and moves in any direction; the plane is tilted
// by up to about 35 degrees and is 1 to 5 baselines away. A pose is drawn again until a third of
// the lens's first image is in the second, and a quarter of the pinhole's.
void draw_motion(tv::Random* random) {
  for (;;) {
    const double angle = scene::uniform(random, 5, 30) * tv::kPi / 180;
    pair.R = tv::rotation_about(scene::direction(random), angle);
    pair.t = scene::direction(random);
    const double tilt_x = scene::uniform(random, -0.5, 0.5);
    pair.plane = Vec3(tilt_x, scene::uniform(random, -0.5, 0.5), 1).normalized();
    pair.distance = scene::uniform(random, 1, 5);
    int both[kNumCameras] = {};
    Vec3 points[2];
    for (int c = 0; c < kNumCameras; ++c) {
      for (int k = 0; k < 300; ++k) both[c] += see(random, c, points);
    }
    if (both[kLens] >= 100 && both[kPinhole] >= 75) return;
  }
}

void make_matches(uint64_t matches_seed, const View& view) {
  tv::Random random = tv::random_seeded(matches_seed);
  Vec3 points[2];
  for (int i = 0; i < kNum; ++i) {
    while (!see(&random, view.points, points)) {
    }
    if (i >= kNumTrue) {  // a wrong match: its pixel in view 1 is random
      const double x = scene::uniform(&random, 0, 639);
      const Vec2 pixel(x, scene::uniform(&random, 0, 359));
      TEST_ASSERT_TRUE(tv::unproject(cameras[view.points], pixel, &points[1], nullptr));
    }
    for (int v = 0; v < 2; ++v) {
      Vec2 pixel;
      TEST_ASSERT_TRUE(tv::project(cameras[view.camera], points[v], &pixel, nullptr));
      for (int k = 0; k < 2; ++k) {
        pair.pixels[v][2 * i + k] = pixel[k] + kNoisePx * scene::normal(&random);
      }
    }
  }
}

// The larger one of rotation error and translation error; the latter ignores the sign of t.
double pose_error_deg(const double R[9], const double t[3]) {
  const double direction = scene::translation_error_deg(t, pair.t);
  return std::fmax(scene::rotation_error_deg(R, pair.R), std::fmin(direction, 180 - direction));
}

void estimate(int view, int index) {
  const tv_camera* camera = &kCameras[kViews[view].camera];
  tv_two_view result;
  tv_two_view_init(&result);
  TEST_ASSERT_EQUAL_INT(
      TV_OK, estimate_pixels(context, camera, camera, pair.pixels[0], pair.pixels[1], nullptr, kNum,
                             nullptr, &result, nullptr));
  double primary = kInfinite, other = kInfinite;
  if (result.has_R && result.has_t) primary = pose_error_deg(result.R, result.t);
  if (result.has_alternative) {
    other = pose_error_deg(result.alternative_R, result.alternative_t);
  }
  errors[view][kPrimary][index] = primary;
  errors[view][kNearer][index] = std::fmin(primary, other);
}

// Area under recall against threshold from 0 to the threshold, in per cent of it: recall runs in
// straight lines from (0, 0) through (e_i, i / n), and flat after the last error (SuperGlue's).
double auc_percent(const double* sorted, int num, double threshold) {
  double area = 0, last_error = 0, last_recall = 0;
  for (int i = 0; i < num && sorted[i] < threshold; ++i) {
    const double recall = (i + 1.0) / num;
    area += (sorted[i] - last_error) * (recall + last_recall) / 2;
    last_error = sorted[i];
    last_recall = recall;
  }
  return 100 * (area + (threshold - last_error) * last_recall) / threshold;
}

int ascending(const void* a, const void* b) {
  const double x = *static_cast<const double*>(a), y = *static_cast<const double*>(b);
  return (x > y) - (x < y);
}

// Sorts the errors and prints a line of the table.
void sum_up(int view, int rule, double auc[3]) {
  const char* const rules[kNumRules] = {"primary pose", "nearer of the two"};
  const size_t count = static_cast<size_t>(num_pairs);
  double* list = errors[view][rule];
  std::qsort(list, count, sizeof list[0], ascending);
  for (int k = 0; k < 3; ++k) auc[k] = auc_percent(list, num_pairs, kThresholdsDeg[k]);
  std::printf("%-18s %-27s AUC@1/5/10 %5.1f %5.1f %5.1f   median %.3f deg\n", rules[rule],
              kViews[view].name, auc[0], auc[1], auc[2], list[count / 2]);
}

void test_a_wide_lens_is_as_good_as_a_pinhole(void) {
  for (int i = 0; i < num_pairs; ++i) {
    tv::Random random = tv::random_seeded(seed + static_cast<uint64_t>(i));
    draw_motion(&random);
    for (int view = 0; view < kNumViews; ++view) {
      make_matches(~seed - static_cast<uint64_t>(i), kViews[view]);
      estimate(view, i);
    }
  }
  double auc[kNumRules][kNumViews][3];
  for (int rule = 0; rule < kNumRules; ++rule) {
    for (int view = 0; view < kNumViews; ++view) sum_up(view, rule, auc[rule][view]);
  }
  // Chance decides which of a plane's two poses is the primary one, separately for the lens and for
  // the pinhole, so the nearer pose is compared. With fewer than 1000 pairs two standard errors are
  // allowed for chance, at a standard deviation of 30 points a pair.
  const double chance = num_pairs < 1000 ? 2 * 30 / std::sqrt(num_pairs) : 0;
  for (int k = 0; k < 3; ++k) {
    const double lens = auc[kNearer][kLensView][k];
    TEST_ASSERT_TRUE(lens >= auc[kNearer][kPinholeOwn][k] - 2 - chance);
    TEST_ASSERT_TRUE(lens >= auc[kNearer][kPinholeSame][k] - kBoundLoss[k] - 2 - chance);
    TEST_ASSERT_TRUE(auc[kPrimary][kLensView][k] > 0.6 * lens);
  }
}

}  // namespace

void setUp(void) {
  context = estimator::make_context(kNum);
  for (int c = 0; c < kNumCameras; ++c) cameras[c] = tv::prepare_camera(kCameras[c]);
}

void tearDown(void) {}

int main(void) {
  estimator::read_environment(10, &num_pairs, &seed);
  if (num_pairs > kMaxPairs) num_pairs = kMaxPairs;
  UNITY_BEGIN();
  RUN_TEST(test_a_wide_lens_is_as_good_as_a_pinhole);
  return UNITY_END();
}
