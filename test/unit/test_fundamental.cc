// Tests the eight- and seven-point solvers, null spaces and singular values.
#include <cmath>

#include "geometry/fundamental_7pt.h"
#include "geometry/fundamental_8pt.h"
#include "geometry/null_space.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Vec3;

constexpr uint64_t kSeed = 8;

struct Sample {
  Vec3 rays0[8], rays1[8];
  Mat3 truth;
};

Sample make_sample(tv::Random* random) {
  Sample s;
  const Mat3 R = tv::rotation_about(scene::direction(random), uniform(random, 0, 0.3));
  const Vec3 t = scene::direction(random);
  for (int k = 0; k < 8; ++k) {
    const Vec3 point(uniform(random, -2, 2), uniform(random, -2, 2), uniform(random, 3, 8));
    const Vec3 moved = R * point + t;
    s.rays0[k] = point / point[2];
    s.rays1[k] = moved / moved[2];
  }
  s.truth = tv::essential_from_pose({R, t}).normalized();
  return s;
}

double distance(const Mat3& a, const Mat3& b) { return std::fmin((a - b).norm(), (a + b).norm()); }

void test_eight_exact_points_give_the_matrix(void) {
  tv::Random random = tv::random_seeded(kSeed);
  int missed = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Sample s = make_sample(&random);
    Mat3 M;
    TEST_ASSERT_TRUE(tv::fundamental_8pt(s.rays0, s.rays1, &M));
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1, M.norm());
    TEST_ASSERT_DOUBLE_WITHIN(1e-12, 0, M.determinant());
    // Samples near a critical configuration lose digits, so a few may miss the tolerance.
    missed += distance(M, s.truth) > 1e-7;
  }
  TEST_ASSERT_LESS_OR_EQUAL_INT(5, missed);
}

void test_seven_exact_points_have_the_matrix_among_three(void) {
  tv::Random random = tv::random_seeded(kSeed + 1);
  int missed = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Sample s = make_sample(&random);
    Mat3 models[3];
    const int count = tv::fundamental_7pt(s.rays0, s.rays1, models);
    TEST_ASSERT_TRUE(count >= 1 && count <= 3);
    double best = 2;
    for (int k = 0; k < count; ++k) {
      best = std::fmin(best, distance(models[k], s.truth));
      TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, models[k].determinant());
      for (int i = 0; i < 7; ++i) {
        TEST_ASSERT_DOUBLE_WITHIN(1e-9, 0, s.rays1[i].dot(models[k] * s.rays0[i]));
      }
    }
    missed += best > 1e-7;
  }
  TEST_ASSERT_LESS_OR_EQUAL_INT(5, missed);
}

void test_repeated_points_give_nothing(void) {
  tv::Random random = tv::random_seeded(kSeed + 2);
  Sample s = make_sample(&random);
  s.rays0[6] = s.rays0[0], s.rays1[6] = s.rays1[0];
  Mat3 models[3];
  TEST_ASSERT_FALSE(tv::fundamental_8pt(s.rays0, s.rays1, models));
  TEST_ASSERT_EQUAL_INT(0, tv::fundamental_7pt(s.rays0, s.rays1, models));
  for (int k = 0; k < 8; ++k) s.rays0[k] = s.rays1[k] = Vec3::Zero();
  TEST_ASSERT_FALSE(tv::fundamental_8pt(s.rays0, s.rays1, models));
}

void test_singular_values_rebuild_their_matrix(void) {
  tv::Random random = tv::random_seeded(kSeed + 3);
  for (int trial = 0; trial < 500; ++trial) {
    Mat3 M;
    for (int k = 0; k < 9; ++k) M(k / 3, k % 3) = uniform(&random, -1, 1);
    if (trial % 5 == 1) M.row(2) = M.row(0) - 2 * M.row(1);
    if (trial % 5 == 2) M = M.col(0) * M.row(1);
    if (trial % 5 == 3) M = tv::rotation_about(scene::direction(&random), 1.0);
    if (trial == 4) M.setZero();
    const tv::Svd3 svd = tv::svd3(M);
    const Mat3 rebuilt = svd.U * svd.s.asDiagonal() * svd.V.transpose();
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0, (rebuilt - M).norm());
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0, (svd.U.transpose() * svd.U - Mat3::Identity()).norm());
    TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0, (svd.V.transpose() * svd.V - Mat3::Identity()).norm());
    TEST_ASSERT_TRUE(svd.U.determinant() > 0 && svd.V.determinant() > 0);
    TEST_ASSERT_TRUE(svd.s[0] >= svd.s[1] && svd.s[1] >= std::fabs(svd.s[2]) - 1e-15);
  }
}

void test_null_space_is_orthonormal_and_orthogonal_to_the_rows(void) {
  tv::Random random = tv::random_seeded(kSeed + 4);
  for (int trial = 0; trial < 100; ++trial) {
    double rows[5][9], kept[5][9], basis[4][9];
    for (int r = 0; r < 5; ++r) {
      for (int i = 0; i < 9; ++i) rows[r][i] = kept[r][i] = uniform(&random, -1, 1);
    }
    TEST_ASSERT_TRUE(tv::null_space(rows, 5, basis));
    for (int b = 0; b < 4; ++b) {
      for (int r = 0; r < 5; ++r) {
        double dot = 0;
        for (int i = 0; i < 9; ++i) dot += kept[r][i] * basis[b][i];
        TEST_ASSERT_DOUBLE_WITHIN(1e-13, 0, dot);
      }
      for (int c = 0; c < 4; ++c) {
        double dot = 0;
        for (int i = 0; i < 9; ++i) dot += basis[c][i] * basis[b][i];
        TEST_ASSERT_DOUBLE_WITHIN(1e-13, b == c, dot);
      }
    }
  }
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_eight_exact_points_give_the_matrix);
  RUN_TEST(test_seven_exact_points_have_the_matrix_among_three);
  RUN_TEST(test_repeated_points_give_nothing);
  RUN_TEST(test_singular_values_rebuild_their_matrix);
  RUN_TEST(test_null_space_is_orthonormal_and_orthogonal_to_the_rows);
  return UNITY_END();
}
