// Simulated poses with noise: the covariance holds the true error as often as it says, for every
// camera model, with wrong matches, sigmas, gravity and planes, and however far the origin is.
#include <cmath>
#include <cstdio>

#include "base/math.h"
#include "robust/ldlt.h"
#include "support/api.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Vec3;

constexpr int kMost = 300, kTrials = 300;
constexpr double kLimit = 12.591587243743977;  // chi-square, six degrees of freedom, 95 per cent

struct Case {
  const char* name;
  int model, num;
  double wrong, noise_px;
  bool sigmas, plane;
  double gravity_sigma_rad, origin;
};

struct Counts {
  int estimated = 0, inside = 0, ok = 0;
  double mean_sq = 0;  // of the squared distance, which is 6 on average
};

tv_camera camera_of(int model) {
  if (model == 1) return scene::distorted();
  if (model == 2) {
    return tv_camera{TV_CAMERA_KANNALA_BRANDT,      640, 480, 0, 200, 201, 318, 242,
                     {-0.02, 0.004, -0.001, 0.0002}};
  }
  return scene::pinhole();
}

// The rotation vector of R.
Vec3 log_of(const Mat3& R) {
  const Vec3 axis(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
  const double sine = 0.5 * axis.norm(), cosine = 0.5 * (R.trace() - 1);
  return sine > 0 ? Vec3(axis / (2 * sine) * tv::atan2(sine, cosine)) : Vec3(0.5 * axis);
}

Counts measure(const Case& c) {
  static double pixels[2 * kMost], points[3 * kMost];
  static float sigmas[kMost];
  Counts counts;
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_matches = kMost;
  limits.purposes = TV_PURPOSE_ABSOLUTE_POSE;
  api_context api = api_make(&limits);
  const tv_camera camera = camera_of(c.model);
  const tv::Camera prepared = tv::prepare_camera(camera);
  tv::Random random = tv::random_seeded(77);
  for (int trial = 0; trial < kTrials; ++trial) {
    const Mat3 R = tv::rotation_about(scene::direction(&random), uniform(&random, 0, 3));
    const Vec3 origin = c.origin * scene::direction(&random);
    const Vec3 t = scene::direction(&random) - R * origin;
    const Vec3 normal = (Vec3(0, 0, 1) + 0.5 * scene::direction(&random)).normalized();
    for (int i = 0; i < c.num;) {
      const tv::Vec2 pixel(uniform(&random, 0, camera.width - 1),
                           uniform(&random, 0, camera.height - 1));
      Vec3 ray;
      if (!tv::unproject(prepared, pixel, &ray, nullptr)) continue;
      if (c.plane && ray.dot(normal) < 0.2) continue;
      const double depth = c.plane ? 4 / ray.dot(normal) : uniform(&random, 2, 8);
      const Vec3 point = R.transpose() * (depth * ray - t);
      sigmas[i] = c.sigmas ? static_cast<float>(uniform(&random, 1, 4)) : 1;
      const bool wrong = i < c.wrong * c.num;
      for (int d = 0; d < 2; ++d) {
        pixels[2 * i + d] = pixel[d] + c.noise_px * sigmas[i] * scene::normal(&random);
        if (wrong) pixels[2 * i + d] = uniform(&random, 0, d == 0 ? camera.width : camera.height);
      }
      for (int d = 0; d < 3; ++d) points[3 * i + d] = point[d];
      ++i;
    }
    tv_pixel_points matches;
    tv_pixel_points_init(&matches);
    matches.num = c.num;
    matches.pixels = pixels;
    matches.points = points;
    if (c.sigmas) matches.sigmas = sigmas;
    tv_absolute_pose_options options;
    tv_absolute_pose_options_init(&options);
    options.gravity_sigma_rad = c.gravity_sigma_rad;
    if (c.gravity_sigma_rad > 0) {
      const Vec3 down = scene::direction(&random);
      Vec3 b[2];
      Vec3 seen = R * down;
      tv::tangent_basis(Vec3(seen), &b[0], &b[1]);
      for (const Vec3& across : b) seen += c.gravity_sigma_rad * scene::normal(&random) * across;
      for (int d = 0; d < 3; ++d) {
        options.gravity_in_world[d] = down[d];
        options.gravity_in_camera[d] = seen[d];
      }
    }
    tv_absolute_pose result;
    tv_absolute_pose_init(&result);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_estimate_absolute_pose(api.context, &camera, &matches, &options,
                                                           &result, nullptr));
    counts.ok += result.verdict == TV_VERDICT_OK;
    if (!result.has_covariance) continue;
    // The error in the parameters of the covariance: x_true = exp([w]x) x + d.
    Mat3 found;
    for (int k = 0; k < 9; ++k) found(k / 3, k % 3) = result.R[k];
    const Mat3 turn = R * found.transpose();
    const Vec3 w = log_of(turn), d = t - turn * Vec3(result.t[0], result.t[1], result.t[2]);
    double upper[21], inverse[36], squared = 0;
    for (int r = 0, slot = 0; r < 6; ++r) {
      for (int k = r; k < 6; ++k) upper[slot++] = result.covariance[6 * r + k];
    }
    TEST_ASSERT_TRUE(tv::invert_symmetric(6, upper, inverse));
    for (int k = 0; k < 36; ++k) {
      const int row = k / 6, column = k % 6;
      squared +=
          inverse[k] * (row < 3 ? w[row] : d[row - 3]) * (column < 3 ? w[column] : d[column - 3]);
    }
    ++counts.estimated;
    counts.inside += squared < kLimit;
    counts.mean_sq += squared;
  }
  counts.mean_sq /= counts.estimated;
  api_release(&api);
  return counts;
}

void test_the_covariance_holds_the_truth(void) {
  const Case cases[] = {{"pinhole", 0, 100, 0, 0.7, false, false, 0, 0},
                        {"few", 0, 20, 0, 0.7, false, false, 0, 0},
                        {"many", 0, kMost, 0, 0.7, false, false, 0, 0},
                        {"half wrong", 0, 150, 0.5, 0.7, false, false, 0, 0},
                        {"80 % wrong", 0, kMost, 0.8, 0.7, false, false, 0, 0},
                        {"distorted", 1, 100, 0.3, 0.7, false, false, 0, 0},
                        {"fisheye", 2, 100, 0.3, 0.7, false, false, 0, 0},
                        {"sigmas", 0, 100, 0.3, 0.3, true, false, 0, 0},
                        {"plane", 0, 100, 0.3, 0.5, false, true, 0, 0},
                        {"gravity", 0, 60, 0.3, 0.7, false, false, 0.002, 0},
                        {"much noise", 0, 100, 0.2, 2, false, false, 0, 0},
                        {"little noise", 0, 100, 0.3, 0.05, false, false, 0, 0},
                        {"far origin", 0, 100, 0.3, 0.7, false, false, 0, 1e6}};
  bool good = true;
  for (const Case& c : cases) {
    const Counts counts = measure(c);
    const double share = 100.0 * counts.inside / counts.estimated;
    const bool within = counts.estimated >= 0.97 * kTrials && share >= 90 && share <= 98;
    std::printf("%-13s %d estimates, %.1f %% inside, mean square %.2f, ok %d%s\n", c.name,
                counts.estimated, share, counts.mean_sq, counts.ok, within ? "" : "  <-- outside");
    good = good && within;
  }
  TEST_ASSERT_TRUE(good);
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_covariance_holds_the_truth);
  return UNITY_END();
}
