// Elementary functions compared with long double libm (64 or more bits on x86 and aarch64): at
// random and special values, and across the boundaries of their intervals.
#include <cfloat>
#include <cmath>
#include <cstdio>
#include <limits>

#include "base/math.h"
#include "base/random.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
const double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr uint64_t kSeed = 20241;
// Where long double is only double, the reference itself may be wrong by half an ulp and more.
constexpr double kReferenceUlp = LDBL_MANT_DIG > 53 ? 0.0 : 1.0;
constexpr int kSamples = 200000;

// std::isnan is not usable here: unity.h defines that name as a macro
bool is_nan(double x) { return x != x; }

double sin_of(double x) {
  double s, c;
  tv::sincos(x, &s, &c);
  return s;
}

double cos_of(double x) {
  double s, c;
  tv::sincos(x, &s, &c);
  return c;
}

double uniform(tv::Random* random, double low, double high) {
  const double share = tv::random_next(*random) * 0x1p-32 + tv::random_next(*random) * 0x1p-64;
  return low + (high - low) * share;
}

double error_ulp(double value, long double exact) {
  int exponent;
  std::frexp(static_cast<double>(exact), &exponent);
  if (exponent < -1021) exponent = -1021;
  return static_cast<double>(fabsl((value - exact) / std::ldexp(1.0L, exponent - 53)));
}

using Function = double (*)(double);
using Reference = long double (*)(long double);

void check(const char* name, Function function, Reference reference, double low, double high,
           double max_ulp, bool by_exponent = false) {
  tv::Random random = tv::random_seeded(kSeed);
  double worst = 0.0, worst_x = low;
  for (int i = 0; i < kSamples; ++i) {
    double x = by_exponent ? std::exp2(uniform(&random, std::log2(low), std::log2(high)))
                           : uniform(&random, low, high);
    if (i == 0) x = low;
    if (i == 1) x = high;
    const double error = error_ulp(function(x), reference(x));
    if (!(error <= worst)) worst = error, worst_x = x;
  }
  char text[160];
  std::snprintf(text, sizeof text, "%s on [%g, %g]: %.3f ulp at %.17g, seed %llu", name, low, high,
                worst, worst_x, static_cast<unsigned long long>(kSeed));
  TEST_ASSERT_TRUE_MESSAGE(worst <= max_ulp + kReferenceUlp, text);
}

void check_rising(const char* name, Function function, double around, double direction) {
  double x = around;
  for (int i = 0; i < 500; ++i) x = std::nextafter(x, -kInf);
  double before = direction * function(x);
  for (int i = 0; i < 1000; ++i) {
    x = std::nextafter(x, kInf);
    const double now = direction * function(x);
    TEST_ASSERT_TRUE_MESSAGE(now >= before, name);
    before = now;
  }
}

}  // namespace

void test_sine_and_cosine_are_within_one_ulp(void) {
  check("sin", sin_of, sinl, -4, 4, 1);
  check("cos", cos_of, cosl, -4, 4, 1);
  check("sin", sin_of, sinl, -1048576, 1048576, 1);
  check("cos", cos_of, cosl, -1048576, 1048576, 1);
  check("sin", sin_of, sinl, 1e-300, 1, 1, true);
}

void test_sine_near_multiples_of_half_pi_keeps_its_digits(void) {
  for (int k = 1; k < 667000; k += 37) {
    const double x = k * 1.5707963267948966;
    TEST_ASSERT_TRUE(error_ulp(sin_of(x), sinl(x)) <= 1 + kReferenceUlp);
    TEST_ASSERT_TRUE(error_ulp(cos_of(x), cosl(x)) <= 1 + kReferenceUlp);
  }
}

void test_tangent_is_within_three_ulp(void) { check("tan", tv::tan, tanl, -1.5707, 1.5707, 2.5); }

void test_arctangent_is_within_one_ulp(void) {
  check("atan", tv::atan, atanl, -4, 4, 1);
  check("atan", tv::atan, atanl, 1e-300, 1e300, 1, true);
  check("atan", tv::atan, atanl, 0.12, 0.13, 1);
}

void test_arctangent_of_two_is_within_two_ulp_in_every_quadrant_and_scale(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (int i = 0; i < kSamples; ++i) {
    const double scale = std::exp2(uniform(&random, -1010, 1010));
    const double y = uniform(&random, -2, 2) * scale;
    const double x = uniform(&random, -2, 2) * scale;
    TEST_ASSERT_TRUE(error_ulp(tv::atan2(y, x), atan2l(y, x)) <= 1.5 + kReferenceUlp);
  }
}

void test_arc_sine_and_arc_cosine_are_within_three_ulp(void) {
  check("acos", tv::acos, acosl, -1, 1, 2.5);
  check("acos", tv::acos, acosl, 0.999, 1, 2.5);
  check("asin", tv::asin, asinl, -1, 1, 2.5);
  check("asin", tv::asin, asinl, 1e-300, 0.1, 2.5, true);
}

void test_exponential_and_logarithm_are_within_one_ulp(void) {
  check("exp", tv::exp, expl, -1, 1, 1);
  check("exp", tv::exp, expl, -708, 709.7, 1);
  check("exp", tv::exp, expl, -745, -708, 1);
  check("log", tv::log, logl, 0.5, 2, 1);
  check("log", tv::log, logl, 1e-307, 1e308, 1, true);
  check("log", tv::log, logl, 4.9e-324, 1e-308, 1, true);
}

void test_functions_do_not_step_back_at_the_seams(void) {
  for (int eighth = 1; eighth < 8; ++eighth) {
    check_rising("atan", tv::atan, (eighth + 0.5) / 8, 1);
  }
  check_rising("atan", tv::atan, 0.125, 1);
  check_rising("atan", tv::atan, 1.0, 1);
  check_rising("sin", sin_of, 0.25 * tv::kPi, 1);
  check_rising("cos", cos_of, 0.25 * tv::kPi, -1);
  check_rising("log", tv::log, 1.4142135623730951, 1);
  check_rising("log", tv::log, 1.0, 1);
  check_rising("log", tv::log, 2.0, 1);
  for (int k = -3; k < 3; ++k) check_rising("exp", tv::exp, (k + 0.5) * 0.6931471805599453, 1);
}

void test_exact_values_are_exact(void) {
  TEST_ASSERT_TRUE(sin_of(0.0) == 0.0 && cos_of(0.0) == 1.0);
  TEST_ASSERT_TRUE(tv::exp(0.0) == 1.0 && tv::log(1.0) == 0.0);
  TEST_ASSERT_TRUE(tv::atan(1.0) == 0.25 * tv::kPi && tv::atan(kInf) == 0.5 * tv::kPi);
  TEST_ASSERT_TRUE(tv::acos(1.0) == 0.0 && tv::acos(0.0) == 0.5 * tv::kPi);
  TEST_ASSERT_TRUE(tv::acos(-1.0) == tv::kPi && tv::asin(-1.0) == -0.5 * tv::kPi);
  TEST_ASSERT_TRUE(tv::acos(1.5) == 0.0 && tv::asin(-7.0) == -0.5 * tv::kPi);
  TEST_ASSERT_TRUE(tv::exp(-kInf) == 0.0 && tv::exp(kInf) == kInf && tv::exp(1000.0) == kInf);
  TEST_ASSERT_TRUE(tv::log(0.0) == -kInf && tv::log(kInf) == kInf);
}

void test_arctangent_of_two_on_axes_and_at_infinity(void) {
  TEST_ASSERT_TRUE(tv::atan2(0.0, 0.0) == 0.0 && tv::atan2(-0.0, -0.0) == 0.0);
  TEST_ASSERT_TRUE(tv::atan2(0.0, -1.0) == tv::kPi && tv::atan2(-0.0, -1.0) == tv::kPi);
  TEST_ASSERT_TRUE(tv::atan2(0.0, 1.0) == 0.0);
  TEST_ASSERT_TRUE(tv::atan2(1.0, 0.0) == 0.5 * tv::kPi && tv::atan2(-1.0, 0.0) == -0.5 * tv::kPi);
  TEST_ASSERT_TRUE(tv::atan2(kInf, kInf) == 0.25 * tv::kPi);
  TEST_ASSERT_TRUE(tv::atan2(-kInf, -kInf) == -0.75 * tv::kPi);
  TEST_ASSERT_TRUE(tv::atan2(1.0, -kInf) == tv::kPi && tv::atan2(1.0, kInf) == 0.0);
  TEST_ASSERT_TRUE(tv::atan2(DBL_MAX, DBL_MAX) == 0.25 * tv::kPi);
  TEST_ASSERT_TRUE(error_ulp(tv::atan2(0.7 * DBL_MAX, DBL_MAX), atanl(0.7L)) <= 1.5);
  TEST_ASSERT_TRUE(tv::atan2(4.9e-324, 4.9e-324) == 0.25 * tv::kPi);
}

void test_odd_functions_are_odd_bit_for_bit(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (int i = 0; i < 10000; ++i) {
    const double x = uniform(&random, 0, 100);
    TEST_ASSERT_TRUE(sin_of(-x) == -sin_of(x) && cos_of(-x) == cos_of(x));
    TEST_ASSERT_TRUE(tv::atan(-x) == -tv::atan(x) && tv::asin(-0.01 * x) == -tv::asin(0.01 * x));
  }
}

void test_nan_and_out_of_range_give_nan_without_harm(void) {
  const double bad[] = {kNaN, kInf, -kInf, 1e300, 1048577, -1048577};
  for (double x : bad) TEST_ASSERT_TRUE(is_nan(sin_of(x)) && is_nan(cos_of(x)));
  TEST_ASSERT_TRUE(is_nan(tv::atan2(kNaN, 1.0)) && is_nan(tv::atan2(1.0, kNaN)));
  TEST_ASSERT_TRUE(is_nan(tv::acos(kNaN)) && is_nan(tv::asin(kNaN)));
  TEST_ASSERT_TRUE(is_nan(tv::exp(kNaN)) && is_nan(tv::log(kNaN)));
  TEST_ASSERT_TRUE(is_nan(tv::log(-1.0)) && is_nan(tv::tan(kInf)));
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_sine_and_cosine_are_within_one_ulp);
  RUN_TEST(test_sine_near_multiples_of_half_pi_keeps_its_digits);
  RUN_TEST(test_tangent_is_within_three_ulp);
  RUN_TEST(test_arctangent_is_within_one_ulp);
  RUN_TEST(test_arctangent_of_two_is_within_two_ulp_in_every_quadrant_and_scale);
  RUN_TEST(test_arc_sine_and_arc_cosine_are_within_three_ulp);
  RUN_TEST(test_exponential_and_logarithm_are_within_one_ulp);
  RUN_TEST(test_functions_do_not_step_back_at_the_seams);
  RUN_TEST(test_exact_values_are_exact);
  RUN_TEST(test_arctangent_of_two_on_axes_and_at_infinity);
  RUN_TEST(test_odd_functions_are_odd_bit_for_bit);
  RUN_TEST(test_nan_and_out_of_range_give_nan_without_harm);
  return UNITY_END();
}
