// Tests that the three-point solver with known gravity finds the true pose, and that its poses
// satisfy the constraints.
#include <cmath>

#include "geometry/relpose_upright_3pt.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Pose;
using tv::Vec3;

constexpr uint64_t kSeed = 11;

struct Sample {
  Vec3 rays0[3], rays1[3];
  Vec3 down0, down1;
  Pose truth;
};

Sample make_sample(tv::Random* random, const Mat3& R, const Vec3& t, const Vec3& down0) {
  Sample s;
  for (int k = 0; k < 3; ++k) {
    const Vec3 point(uniform(random, -2, 2), uniform(random, -2, 2), uniform(random, 2, 8));
    s.rays0[k] = point.normalized();
    s.rays1[k] = R * point + t;  // rays of any length are allowed
  }
  s.down0 = down0;
  s.down1 = (R * down0).normalized();
  s.truth = Pose{R, t};
  return s;
}

Mat3 any_rotation(tv::Random* random) {
  return tv::rotation_about(scene::direction(random), uniform(random, -tv::kPi, tv::kPi)) *
         tv::rotation_about(scene::direction(random), uniform(random, -tv::kPi, tv::kPi));
}

int solve(const Sample& s, Pose* poses) {
  return tv::relpose_upright_3pt(s.rays0, s.rays1, tv::level_from_camera(s.down0),
                                 tv::level_from_camera(s.down1), poses);
}

double nearest_pose(const Sample& s, const Pose* poses, int count) {
  double best = 10;
  for (int k = 0; k < count; ++k) {
    const double turned = (poses[k].R - s.truth.R).norm();
    const double moved =
        std::fmin((poses[k].t - s.truth.t).norm(), (poses[k].t + s.truth.t).norm());
    best = std::fmin(best, turned + moved);
  }
  return best;
}

// The largest residual of the constraints: epipolar (unit rays), gravity, R R' = I, and |t| = 1.
double residual(const Sample& s, const Pose& pose) {
  const Mat3 E = tv::essential_from_pose(pose);
  double worst = (pose.R * s.down0 - s.down1).norm();
  worst = std::fmax(worst, (pose.R * pose.R.transpose() - Mat3::Identity()).norm());
  worst = std::fmax(worst, std::fabs(pose.t.norm() - 1));
  for (int k = 0; k < 3; ++k) {
    worst = std::fmax(worst, std::fabs(s.rays1[k].normalized().dot(E * s.rays0[k].normalized())));
  }
  return worst;
}

void test_level_frames_have_gravity_along_z(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (int trial = 0; trial < 1000; ++trial) {
    Vec3 down = scene::direction(&random);
    if (trial < 6) {  // gravity along each axis, in both directions
      down = Vec3::Zero();
      down[trial / 2] = trial % 2 == 0 ? 1 : -1;
    }
    const Mat3 level = tv::level_from_camera(down);
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0, (level * down - Vec3(0, 0, 1)).norm());
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 0, (level * level.transpose() - Mat3::Identity()).norm());
    TEST_ASSERT_DOUBLE_WITHIN(1e-14, 1, level.determinant());
  }
}

void test_the_true_pose_is_among_the_solutions_of_random_problems(void) {
  tv::Random random = tv::random_seeded(kSeed + 1);
  constexpr int kTrials = 100000;
  int missed = 0, coarse = 0, total = 0;
  double worst = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Mat3 R = any_rotation(&random);
    const Vec3 t = scene::direction(&random);
    const Sample s = make_sample(&random, R, t, scene::direction(&random));
    Pose poses[tv::kMaxRelposeUpright3pt];
    const int count = solve(s, poses);
    TEST_ASSERT_LESS_OR_EQUAL_INT(tv::kMaxRelposeUpright3pt, count);
    total += count;
    for (int k = 0; k < count; ++k) worst = std::fmax(worst, residual(s, poses[k]));
    const double error = nearest_pose(s, poses, count);
    missed += error > 1e-6;
    coarse += error > 1e-9;
  }
  TEST_ASSERT_TRUE(worst < 1e-12);
  // Two roots that are nearly equal lose half the digits.
  TEST_ASSERT_LESS_OR_EQUAL_INT(2, missed);
  TEST_ASSERT_LESS_OR_EQUAL_INT(20, coarse);
  TEST_ASSERT_GREATER_THAN_INT(3 * kTrials, total);
}

void test_matches_that_no_motion_made_satisfy_the_constraints(void) {
  tv::Random random = tv::random_seeded(kSeed + 2);
  double worst = 0;
  int total = 0;
  for (int trial = 0; trial < 10000; ++trial) {
    Sample s = make_sample(&random, Mat3::Identity(), Vec3(1, 0, 0), scene::direction(&random));
    for (int k = 0; k < 3; ++k) {
      s.rays0[k] = scene::direction(&random);
      s.rays1[k] = scene::direction(&random);
    }
    s.down1 = scene::direction(&random);
    Pose poses[tv::kMaxRelposeUpright3pt];
    const int count = solve(s, poses);
    total += count;
    for (int k = 0; k < count; ++k) worst = std::fmax(worst, residual(s, poses[k]));
  }
  TEST_ASSERT_TRUE(worst < 1e-11);
  TEST_ASSERT_GREATER_THAN_INT(10000, total);
}

// The tangent of half the yaw is infinite at half a turn; the solver avoids it by an offset.
void test_quarter_turns_and_half_turns_of_yaw_are_found(void) {
  tv::Random random = tv::random_seeded(kSeed + 3);
  for (int quarter = 0; quarter < 4; ++quarter) {
    for (int trial = 0; trial < 500; ++trial) {
      const Vec3 down = trial % 2 == 0 ? scene::direction(&random) : Vec3(0, 1, 0);
      const Mat3 R = tv::rotation_about(down, quarter * tv::kPi / 2);
      const Sample s = make_sample(&random, R, scene::direction(&random), down);
      Pose poses[tv::kMaxRelposeUpright3pt];
      TEST_ASSERT_TRUE(nearest_pose(s, poses, solve(s, poses)) < 1e-6);
    }
  }
}

void test_the_solutions_do_not_depend_on_the_rays_lengths(void) {
  tv::Random random = tv::random_seeded(kSeed + 4);
  for (int trial = 0; trial < 200; ++trial) {
    const Sample s = make_sample(&random, any_rotation(&random), scene::direction(&random),
                                 scene::direction(&random));
    Sample stretched = s;
    for (int k = 0; k < 3; ++k) {
      stretched.rays0[k] *= 1e3;
      stretched.rays1[k] *= 1e-3;
    }
    Pose poses[tv::kMaxRelposeUpright3pt];
    TEST_ASSERT_TRUE(nearest_pose(stretched, poses, solve(stretched, poses)) < 1e-6);
  }
}

void test_degenerate_samples_give_finite_poses_or_none(void) {
  tv::Random random = tv::random_seeded(kSeed + 5);
  const double nan = std::nan("");
  for (int kind = 0; kind < 9; ++kind) {
    for (int trial = 0; trial < 100; ++trial) {
      const Vec3 down = scene::direction(&random);
      const Mat3 R = tv::rotation_about(down, uniform(&random, -3, 3));
      Sample s = make_sample(&random, R, scene::direction(&random), down);
      for (int k = 0; k < 3; ++k) {
        // three copies of one match
        if (kind == 0) s.rays0[k] = s.rays0[0], s.rays1[k] = s.rays1[0];
        if (kind == 1) s.rays1[k] = R * s.rays0[k];  // a rotation without translation
        if (kind == 2) s.rays1[k] = s.rays0[k], s.down1 = s.down0;  // equal rays: no motion
        if (kind == 3) s.rays0[k] = s.rays1[k] = Vec3::Zero();
        if (kind == 4) s.rays0[k] = s.down0;  // all rays of view 0 are along gravity
        if (kind == 5) s.rays0[k] = s.down0, s.rays1[k] = -s.down1;
        // All rays of a view lie in one plane.
        if (kind == 6) s.rays0[k] = s.rays1[k] = Vec3(0.1 * k, 0.2 * k, 1);
        if (kind == 7 && k == 2) s.rays0[2] = s.rays0[1], s.rays1[2] = s.rays1[1];
        if (kind == 8) s.rays1[k][k] = nan;
      }
      Pose poses[tv::kMaxRelposeUpright3pt];
      const int count = solve(s, poses);
      TEST_ASSERT_TRUE(count >= 0 && count <= tv::kMaxRelposeUpright3pt);
      for (int k = 0; k < count; ++k) {
        TEST_ASSERT_TRUE(poses[k].R.allFinite());
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 1, poses[k].t.norm());
      }
      if (kind == 3 || kind == 8) {
        TEST_ASSERT_EQUAL_INT(0, count);
      }
    }
  }
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_level_frames_have_gravity_along_z);
  RUN_TEST(test_the_true_pose_is_among_the_solutions_of_random_problems);
  RUN_TEST(test_matches_that_no_motion_made_satisfy_the_constraints);
  RUN_TEST(test_quarter_turns_and_half_turns_of_yaw_are_found);
  RUN_TEST(test_the_solutions_do_not_depend_on_the_rays_lengths);
  RUN_TEST(test_degenerate_samples_give_finite_poses_or_none);
  return UNITY_END();
}
