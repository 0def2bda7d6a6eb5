// The five-point solver and its polynomial's roots, checked against their definitions.
#include <cmath>

#include "geometry/polynomial.h"
#include "geometry/relpose_5pt.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Vec2;
using tv::Vec3;

constexpr uint64_t kSeed = 5;

struct Sample {
  Vec3 rays0[5], rays1[5];
  Mat3 truth;  // the true E, with norm 1
};

Sample make_sample(tv::Random* random, const Mat3& R, const Vec3& t) {
  Sample s;
  for (int k = 0; k < 5; ++k) {
    const double depth = uniform(random, 2, 8);
    const Vec2 xy = scene::uniform2(random, 2, 2);
    const Vec3 point(xy[0], xy[1], depth);
    s.rays0[k] = point.normalized();
    s.rays1[k] = R * point + t;  // rays of any length are allowed
  }
  s.truth = tv::essential_from_pose({R, t}).normalized();
  return s;
}

double distance(const Mat3& a, const Mat3& b) { return std::fmin((a - b).norm(), (a + b).norm()); }

double nearest_model(const Sample& s, const Mat3* models, int count) {
  double best = 2;
  for (int k = 0; k < count; ++k) best = std::fmin(best, distance(models[k], s.truth));
  return best;
}

// The largest residual of the ten cubic and five linear constraints, in long double, at |E| = 1.
double residual(const Sample& s, const Mat3& E) {
  using Long3 = Eigen::Matrix<long double, 3, 3>;
  const Long3 e = E.cast<long double>();
  const Long3 gram = e * e.transpose();
  const Long3 trace = 2 * gram * e - gram.trace() * e;
  const long double det = e.row(0).dot(e.row(1).cross(e.row(2)));
  long double worst = std::fmax(static_cast<double>(std::fabs(det)),
                                static_cast<double>(trace.cwiseAbs().maxCoeff()));
  for (int k = 0; k < 5; ++k) {
    const long double c = s.rays1[k].normalized().cast<long double>().dot(
        e * s.rays0[k].normalized().cast<long double>());
    worst = std::fmax(static_cast<double>(worst), static_cast<double>(std::fabs(c)));
  }
  return static_cast<double>(worst);
}

void test_the_true_motion_is_among_the_models(void) {
  tv::Random random = tv::random_seeded(kSeed);
  constexpr int kTrials = 2000;
  int missed = 0, total = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Mat3 R = scene::rotation(&random, 0, 0.8);
    const Sample s = make_sample(&random, R, scene::direction(&random));
    Mat3 models[tv::kMaxRelpose5pt];
    const int count = tv::relpose_5pt(s.rays0, s.rays1, models);
    TEST_ASSERT_TRUE(count <= tv::kMaxRelpose5pt);
    total += count;
    missed += nearest_model(s, models, count) > 1e-6;
  }
  // A double root loses half of the digits; it is rare, so 1 of 500 trials may miss the tolerance.
  TEST_ASSERT_LESS_OR_EQUAL_INT(kTrials / 500, missed);
  TEST_ASSERT_GREATER_THAN_INT(3 * kTrials, total);
}

void test_every_model_satisfies_the_constraints(void) {
  tv::Random random = tv::random_seeded(kSeed + 1);
  int models_seen = 0, poor = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const Mat3 R = scene::rotation(&random, 0, 0.8);
    Sample s = make_sample(&random, R, scene::direction(&random));
    if (trial % 2 == 1) {  // five wrong matches
      for (int k = 0; k < 5; ++k) s.rays1[k] = scene::direction(&random);
    }
    Mat3 models[tv::kMaxRelpose5pt];
    const int count = tv::relpose_5pt(s.rays0, s.rays1, models);
    for (int k = 0; k < count; ++k) {
      ++models_seen;
      poor += residual(s, models[k]) > 1e-8;
      TEST_ASSERT_DOUBLE_WITHIN(1e-12, 1, models[k].norm());
    }
  }
  TEST_ASSERT_GREATER_THAN_INT(1500, models_seen);
  TEST_ASSERT_LESS_OR_EQUAL_INT(models_seen / 200, poor);
}

void test_motions_along_the_axes_are_found(void) {
  tv::Random random = tv::random_seeded(kSeed + 2);
  for (int axis = 0; axis < 3; ++axis) {
    for (int quarter = 0; quarter < 4; ++quarter) {
      Vec3 t = Vec3::Zero();
      t[axis] = quarter % 2 == 0 ? 1 : -1;
      const Mat3 R = tv::rotation_about(Vec3(0, 0, 1), quarter * tv::kPi / 2);
      int missed = 0;
      for (int trial = 0; trial < 50; ++trial) {
        const Sample s = make_sample(&random, R, t);
        Mat3 models[tv::kMaxRelpose5pt];
        const int count = tv::relpose_5pt(s.rays0, s.rays1, models);
        missed += nearest_model(s, models, count) > 1e-6;
      }
      TEST_ASSERT_LESS_OR_EQUAL_INT(2, missed);
    }
  }
}

void test_degenerate_samples_give_finite_models_or_none(void) {
  tv::Random random = tv::random_seeded(kSeed + 3);
  Mat3 models[tv::kMaxRelpose5pt];
  for (int kind = 0; kind < 5; ++kind) {
    Sample s = make_sample(&random, Mat3::Identity(), Vec3(1, 0, 0));
    for (int k = 0; k < 5; ++k) {
      if (kind == 0) s.rays0[k] = s.rays0[0], s.rays1[k] = s.rays1[0];  // five copies of one match
      if (kind == 1) s.rays1[k] = s.rays0[k];                           // equal rays: no motion
      if (kind == 2) s.rays0[k] = s.rays1[k] = Vec3::Zero();
      // All rays of a view lie in one plane.
      if (kind == 3) s.rays0[k] = s.rays1[k] = Vec3(0.1 * k, 0.2 * k, 1);
      if (kind == 4 && k == 4) s.rays0[4] = s.rays0[3], s.rays1[4] = s.rays1[3];
    }
    const int count = tv::relpose_5pt(s.rays0, s.rays1, models);
    for (int k = 0; k < count; ++k) TEST_ASSERT_TRUE(models[k].allFinite());
    if (kind == 0 || kind == 2 || kind == 4) {
      TEST_ASSERT_EQUAL_INT(0, count);
    }
  }
}

void test_roots_of_known_polynomials_are_found(void) {
  const double wanted[6] = {-1000, -2.5, -0.125, 0.5, 3, 4e4};
  double p[11] = {1};
  int degree = 0;
  for (double root : wanted) {  // multiplies p by (z - root)
    for (int i = ++degree; i > 0; --i) p[i] = p[i - 1] - root * p[i];
    p[0] *= -root;
  }
  for (int k = 0; k < 2; ++k) {  // multiplies p by z^2 + z + 1, which has no real root
    for (int i = degree += 2; i >= 0; --i) {
      p[i] = p[i] + (i > 0 ? p[i - 1] : 0) + (i > 1 ? p[i - 2] : 0);
    }
  }
  double roots[10];
  TEST_ASSERT_EQUAL_INT(6, tv::real_roots(p, 10, roots));
  for (int k = 0; k < 6; ++k) {
    TEST_ASSERT_DOUBLE_WITHIN(1e-8 * std::fabs(wanted[k]), wanted[k], roots[k]);
  }
}

void test_polynomials_without_a_leading_coefficient_have_no_roots(void) {
  const double zero[4] = {1, 2, 3, 0}, nan[4] = {1, 2, 3, NAN}, huge[4] = {1, 2, 3, INFINITY};
  double roots[3];
  TEST_ASSERT_EQUAL_INT(0, tv::real_roots(zero, 3, roots));
  TEST_ASSERT_EQUAL_INT(0, tv::real_roots(nan, 3, roots));
  TEST_ASSERT_EQUAL_INT(0, tv::real_roots(huge, 3, roots));
}

void test_a_repeated_root_ends_the_search(void) {
  const double p[4] = {-1, 3, -3, 1};  // (z - 1)^3, with a triple root at 1
  double roots[3];
  const int count = tv::real_roots(p, 3, roots);
  TEST_ASSERT_LESS_OR_EQUAL_INT(3, count);
  for (int k = 0; k < count; ++k) TEST_ASSERT_DOUBLE_WITHIN(1e-4, 1, roots[k]);
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_true_motion_is_among_the_models);
  RUN_TEST(test_every_model_satisfies_the_constraints);
  RUN_TEST(test_motions_along_the_axes_are_found);
  RUN_TEST(test_degenerate_samples_give_finite_models_or_none);
  RUN_TEST(test_roots_of_known_polynomials_are_found);
  RUN_TEST(test_polynomials_without_a_leading_coefficient_have_no_roots);
  RUN_TEST(test_a_repeated_root_ends_the_search);
  return UNITY_END();
}
