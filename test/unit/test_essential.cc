// Tests of geometry/essential.h: poses from essential matrices and back, bases, and the signs of
// depths.
#include <cmath>

#include "geometry/essential.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Pose;
using tv::Vec3;

constexpr uint64_t kSeed = 3;

Pose random_pose(tv::Random* random) {
  return Pose{tv::rotation_about(scene::direction(random), uniform(random, 0, 3)),
              scene::direction(random)};
}

void test_a_match_fulfils_the_epipolar_constraint(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (int trial = 0; trial < 100; ++trial) {
    const Pose pose = random_pose(&random);
    const Vec3 x0 = 3 * scene::direction(&random);
    const Mat3 E = tv::essential_from_pose(pose);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0, (pose.R * x0 + pose.t).dot(E * x0));
  }
}

void test_decomposition_returns_the_pose_and_its_twin(void) {
  tv::Random random = tv::random_seeded(kSeed + 1);
  for (int trial = 0; trial < 500; ++trial) {
    const Pose pose = random_pose(&random);
    const Mat3 E = tv::essential_from_pose(pose) * uniform(&random, -5, 5);
    Mat3 R[2];
    Vec3 t;
    TEST_ASSERT_TRUE(tv::decompose_essential(E, R, &t));
    const double same = std::fmin((R[0] - pose.R).norm(), (R[1] - pose.R).norm());
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, same);
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, std::fmin((t - pose.t).norm(), (t + pose.t).norm()));
    // The twisted pose is the pose turned by half a turn about t.
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, (tv::rotation_about(t, tv::kPi) * R[0] - R[1]).norm());
  }
}

void test_decomposition_refuses_what_is_no_epipolar_matrix(void) {
  Mat3 R[2], bad = Mat3::Zero();
  Vec3 t;
  TEST_ASSERT_FALSE(tv::decompose_essential(bad, R, &t));
  bad(0, 0) = 1;  // a matrix of rank 1
  TEST_ASSERT_FALSE(tv::decompose_essential(bad, R, &t));
  bad(1, 1) = NAN;
  TEST_ASSERT_FALSE(tv::decompose_essential(bad, R, &t));
  bad(1, 1) = INFINITY;
  TEST_ASSERT_FALSE(tv::decompose_essential(bad, R, &t));
}

void test_steps_are_rotations_and_agree_with_the_exponential(void) {
  tv::Random random = tv::random_seeded(kSeed + 2);
  for (double size = 1e-6; size < 10; size *= 10) {
    const Vec3 axis = scene::direction(&random);
    const Mat3 step = tv::rotation_step(size * axis);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0, (step * step.transpose() - Mat3::Identity()).norm());
    if (size < 1e-2) {
      TEST_ASSERT_DOUBLE_WITHIN(1e-15 + size * size * size, 0,
                                (step - tv::rotation_about(axis, size)).norm());
    }
  }
}

void test_the_tangent_basis_is_the_stated_one(void) {
  const Vec3 tie = Vec3(1, -1, 1).normalized();
  Vec3 b1, b2;
  tv::tangent_basis(tie, &b1, &b2);  // sizes are equal: b1 is along e_0 x t
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0, (b1 - Vec3(0, -1, -1).normalized()).norm());
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0, (b2 - tie.cross(b1)).norm());
  tv::tangent_basis(Vec3(0.6, 0.8, 0), &b1, &b2);  // t[2] is the smallest: b1 is along e_2 x t
  TEST_ASSERT_DOUBLE_WITHIN(1e-15, 0, (b1 - Vec3(-0.8, 0.6, 0)).norm());
}

void test_depth_signs_tell_in_front_from_behind(void) {
  tv::Random random = tv::random_seeded(kSeed + 3);
  for (int trial = 0; trial < 1000; ++trial) {
    const Pose pose = random_pose(&random);
    const Vec3 ray0 = uniform(&random, 0.1, 5) * scene::direction(&random);
    const double depth0 = uniform(&random, -4, 4);
    const Vec3 x1 = pose.R * (depth0 * ray0) + pose.t;
    const double side = uniform(&random, -1, 1) < 0 ? -1 : 1;
    const Vec3 ray1 = side * uniform(&random, 0.2, 3) * x1;
    const tv::DepthSigns d = tv::depth_signs(pose, ray0, ray1, 1e-9);
    if ((pose.R * ray0).normalized().cross(ray1.normalized()).norm() < 1e-3) continue;
    TEST_ASSERT_EQUAL_INT(depth0 > 0, d.depth0 > 0);
    TEST_ASSERT_EQUAL_INT(side > 0, d.depth1 > 0);
    TEST_ASSERT_EQUAL_INT(depth0 > 0 && side > 0 ? 1 : -1, tv::depth_vote(d));
  }
}

void test_points_within_the_tolerance_of_infinity_do_not_vote(void) {
  const Pose pose{Mat3::Identity(), Vec3(1, 0, 0)};
  const Vec3 far(0.1, 0.2, 1);
  for (double parallax = -1e-3; parallax <= 1e-3; parallax += 1e-4) {
    const Vec3 ray1(far[0] + parallax, far[1], 1);
    const int vote = tv::depth_vote(tv::depth_signs(pose, far, ray1, 4.5e-4));
    const double size = std::fabs(parallax);
    if (size < 4e-4) {
      TEST_ASSERT_EQUAL_INT(0, vote);
    }
    if (size > 5e-4) {
      TEST_ASSERT_EQUAL_INT(parallax > 0 ? 1 : -1, vote);
    }
  }
  TEST_ASSERT_EQUAL_INT(0, tv::depth_vote(tv::depth_signs(pose, far, far, 0)));
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_match_fulfils_the_epipolar_constraint);
  RUN_TEST(test_decomposition_returns_the_pose_and_its_twin);
  RUN_TEST(test_decomposition_refuses_what_is_no_epipolar_matrix);
  RUN_TEST(test_steps_are_rotations_and_agree_with_the_exponential);
  RUN_TEST(test_the_tangent_basis_is_the_stated_one);
  RUN_TEST(test_depth_signs_tell_in_front_from_behind);
  RUN_TEST(test_points_within_the_tolerance_of_infinity_do_not_vote);
  return UNITY_END();
}
