// Homographies from four points and their two motions, and rotations from two points.
#include <cmath>

#include "geometry/homography_4pt.h"
#include "geometry/rotation_2pt.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Vec3;

constexpr uint64_t kSeed = 4;

struct Plane {
  Mat3 R, H;
  Vec3 t, normal;  // t is divided by the plane's distance
  Vec3 rays0[4], rays1[4];
};

Plane make_plane(tv::Random* random) {
  Plane p;
  p.R = tv::rotation_about(scene::direction(random), uniform(random, 0, 0.4));
  p.t = uniform(random, 0.1, 0.4) * scene::direction(random);
  p.normal = Vec3(uniform(random, -0.5, 0.5), uniform(random, -0.5, 0.5), 1).normalized();
  p.H = p.R + p.t * p.normal.transpose();
  const double x[4] = {-0.5, 0.5, 0.4, -0.6}, y[4] = {-0.4, -0.5, 0.5, 0.4};
  for (int k = 0; k < 4; ++k) {
    p.rays0[k] = Vec3(x[k] + uniform(random, -0.1, 0.1), y[k] + uniform(random, -0.1, 0.1), 1);
    p.rays1[k] = (p.H * p.rays0[k]).normalized();
  }
  return p;
}

void test_four_exact_points_give_the_homography_with_its_sign(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (int trial = 0; trial < 500; ++trial) {
    const Plane p = make_plane(&random);
    Mat3 H;
    TEST_ASSERT_TRUE(tv::homography_4pt(p.rays0, p.rays1, &H));
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, (H - p.H.normalized()).norm());
  }
}

void test_a_homography_that_sends_points_behind_is_refused(void) {
  tv::Random random = tv::random_seeded(kSeed + 1);
  Plane p = make_plane(&random);
  p.rays1[2] = -p.rays1[2];
  Mat3 H;
  TEST_ASSERT_FALSE(tv::homography_4pt(p.rays0, p.rays1, &H));
}

void test_three_points_on_a_line_or_repeated_points_never_give_a_nan(void) {
  tv::Random random = tv::random_seeded(kSeed + 2);
  Plane p = make_plane(&random);
  Mat3 H = Mat3::Zero();
  p.rays0[3] = p.rays0[0], p.rays1[3] = p.rays1[0];
  TEST_ASSERT_FALSE(tv::homography_4pt(p.rays0, p.rays1, &H));
  p = make_plane(&random);
  p.rays0[3] = 0.5 * (p.rays0[0] + p.rays0[1]);
  tv::homography_4pt(p.rays0, p.rays1, &H);
  TEST_ASSERT_TRUE(H.allFinite());
}

void test_one_of_the_two_motions_is_the_true_one(void) {
  tv::Random random = tv::random_seeded(kSeed + 3);
  for (int trial = 0; trial < 500; ++trial) {
    const Plane p = make_plane(&random);
    tv::PlanarPose poses[2];
    const Mat3 scaled = uniform(&random, 0.1, 9) * p.H;
    const int count = tv::decompose_homography(scaled, Vec3(0, 0, 1), poses);
    TEST_ASSERT_EQUAL_INT(2, count);
    double best = 10;
    for (int k = 0; k < 2; ++k) {
      // Each of the two motions explains H: H = R + t n' / d.
      const Mat3 rebuilt = poses[k].pose.R + poses[k].baseline_over_depth * poses[k].pose.t *
                                                 poses[k].normal.transpose();
      TEST_ASSERT_DOUBLE_WITHIN(1e-8, 0, (rebuilt - p.H).norm());
      TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1, poses[k].pose.R.determinant());
      TEST_ASSERT_TRUE(poses[k].normal[2] >= 0);
      best = std::fmin(best, (poses[k].pose.R - p.R).norm() +
                                 (poses[k].pose.t - p.t.normalized()).norm() +
                                 (poses[k].normal - p.normal).norm());
    }
    TEST_ASSERT_DOUBLE_WITHIN(1e-6, 0, best);
  }
}

void test_rotations_and_singular_matrices_have_no_planar_motion(void) {
  tv::PlanarPose poses[2];
  const Mat3 R = tv::rotation_about(Vec3(0, 1, 0), 0.3);
  TEST_ASSERT_EQUAL_INT(0, tv::decompose_homography(R, Vec3(0, 0, 1), poses));
  TEST_ASSERT_EQUAL_INT(0, tv::decompose_homography(Mat3::Zero(), Vec3(0, 0, 1), poses));
  Mat3 singular = Mat3::Identity();
  singular(2, 2) = 0;
  TEST_ASSERT_EQUAL_INT(0, tv::decompose_homography(singular, Vec3(0, 0, 1), poses));
}

void test_two_exact_rays_give_the_rotation(void) {
  tv::Random random = tv::random_seeded(kSeed + 4);
  for (int trial = 0; trial < 500; ++trial) {
    const Mat3 R = tv::rotation_about(scene::direction(&random), uniform(&random, 0, 3));
    const Vec3 rays0[2] = {scene::direction(&random), 2 * scene::direction(&random)};
    const Vec3 rays1[2] = {3 * (R * rays0[0]), R * rays0[1]};
    if (rays0[0].normalized().cross(rays0[1].normalized()).norm() < 0.05) continue;
    Mat3 found;
    TEST_ASSERT_TRUE(tv::rotation_2pt(rays0, rays1, &found));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, (found - R).norm());
  }
}

void test_parallel_rays_give_no_rotation(void) {
  const Vec3 rays[2] = {Vec3(0, 0, 1), Vec3(0, 0, 2)}, other[2] = {Vec3(1, 0, 1), Vec3(0, 0, 1)};
  Mat3 R;
  TEST_ASSERT_FALSE(tv::rotation_2pt(rays, other, &R));
  TEST_ASSERT_FALSE(tv::rotation_2pt(other, rays, &R));
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_four_exact_points_give_the_homography_with_its_sign);
  RUN_TEST(test_a_homography_that_sends_points_behind_is_refused);
  RUN_TEST(test_three_points_on_a_line_or_repeated_points_never_give_a_nan);
  RUN_TEST(test_one_of_the_two_motions_is_the_true_one);
  RUN_TEST(test_rotations_and_singular_matrices_have_no_planar_motion);
  RUN_TEST(test_two_exact_rays_give_the_rotation);
  RUN_TEST(test_parallel_rays_give_no_rotation);
  return UNITY_END();
}
