// Tests the solver for three points: the true pose is among its solutions, all of them satisfy the
// equations, and they are those of another method, Grunert's quartic in extended precision (R.
// Haralick et al., "Review and analysis of solutions of the three point perspective pose estimation
// problem", IJCV 1994).
#include <cmath>
#include <complex>

#include "pose/absolute_pose_3pt.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;
using tv::Mat3;
using tv::Pose;
using tv::Vec3;

constexpr uint64_t kSeed = 23;

struct Sample {
  double rays[3][3], points[3][3];
  Pose truth;
};

Mat3 any_rotation(tv::Random* random) {
  return tv::rotation_about(scene::direction(random), uniform(random, -tv::kPi, tv::kPi)) *
         tv::rotation_about(scene::direction(random), uniform(random, -tv::kPi, tv::kPi));
}

// A sample of these points of the camera's frame.
Sample sample_of(const Vec3 seen[3], const Pose& truth) {
  Sample s;
  s.truth = truth;
  for (int k = 0; k < 3; ++k) {
    const Vec3 ray = seen[k].normalized(), point = truth.R.transpose() * (seen[k] - truth.t);
    for (int d = 0; d < 3; ++d) {
      s.rays[k][d] = ray[d];
      s.points[k][d] = point[d];
    }
  }
  return s;
}

Sample any_sample(tv::Random* random, double nearest, double farthest) {
  const Pose truth{any_rotation(random), 3 * scene::direction(random)};
  Vec3 seen[3];
  for (Vec3& x : seen) {
    x = uniform(random, nearest, farthest) *
        Vec3(uniform(random, -1, 1), uniform(random, -1, 1), 1);
  }
  return sample_of(seen, truth);
}

double distance(const Pose& a, const Pose& b) { return (a.R - b.R).norm() + (a.t - b.t).norm(); }

double nearest_pose(const Sample& s, const Pose* poses, int count) {
  double best = 10;
  for (int k = 0; k < count; ++k) best = std::fmin(best, distance(poses[k], s.truth));
  return best;
}

// How far the poses are from a rotation, and how far they move each point from its ray's direction.
double violation(const Sample& s, const Pose* poses, int count) {
  double worst = 0;
  for (int k = 0; k < count; ++k) {
    worst = std::fmax(worst, (poses[k].R * poses[k].R.transpose() - Mat3::Identity()).norm());
    worst = std::fmax(worst, std::fabs(poses[k].R.determinant() - 1));
    for (int i = 0; i < 3; ++i) {
      const Vec3 point(s.points[i][0], s.points[i][1], s.points[i][2]);
      const Vec3 ray(s.rays[i][0], s.rays[i][1], s.rays[i][2]);
      worst = std::fmax(worst, ((poses[k].R * point + poses[k].t).normalized() - ray).norm());
    }
  }
  return worst;
}

// ---- Grunert's method ----

using Complex = std::complex<long double>;

// The roots of a quartic, leading coefficient first, by Durand and Kerner's method.
void quartic_roots(const long double* a, Complex roots[4]) {
  for (int k = 0; k < 4; ++k) roots[k] = std::pow(Complex(0.4L, 0.9L), k);
  long double largest = 1;  // the largest step of an iteration
  for (int iteration = 0; iteration < 2000 && largest > 1e-17L; ++iteration) {
    largest = 0;
    for (int k = 0; k < 4; ++k) {
      Complex value = a[0], others = a[0];
      for (int i = 1; i <= 4; ++i) value = value * roots[k] + a[i];
      for (int j = 0; j < 4; ++j) {
        if (j != k) others *= roots[k] - roots[j];
      }
      const Complex step = value / others;
      roots[k] -= step;
      largest = std::fmax(largest, std::abs(step));
    }
  }
}

struct Depths {
  long double d[3];
};

// The depths of all solutions. *clear is false where some are so close to each other, or to losing
// a positive depth, that rounding decides how many there are.
int grunert(const Sample& s, Depths* solutions, bool* clear) {
  const auto squared_side = [&s](int i, int j) {
    long double sum = 0;
    for (int d = 0; d < 3; ++d) {
      const long double x = static_cast<long double>(s.points[i][d]) - s.points[j][d];
      sum += x * x;
    }
    return sum;
  };
  const auto cosine = [&s](int i, int j) {
    long double sum = 0;
    for (int d = 0; d < 3; ++d) sum += static_cast<long double>(s.rays[i][d]) * s.rays[j][d];
    return sum;
  };
  const long double a = squared_side(1, 2), b = squared_side(0, 2), c = squared_side(0, 1);
  const long double ca = cosine(1, 2), cb = cosine(0, 2), cg = cosine(0, 1);
  const long double q = (a - c) / b, p = (a + c) / b, r = c / b, o = a / b;
  const long double quartic[5] = {
      (q - 1) * (q - 1) - 4 * r * ca * ca,
      4 * (q * (1 - q) * cb - (1 - p) * ca * cg + 2 * r * ca * ca * cb),
      2 * (q * q - 1 + 2 * q * q * cb * cb + 2 * ((b - c) / b) * ca * ca - 4 * p * ca * cb * cg +
           2 * ((b - a) / b) * cg * cg),
      4 * (-q * (1 + q) * cb + 2 * o * cg * cg * cb - (1 - p) * ca * cg),
      (1 + q) * (1 + q) - 4 * o * cg * cg};
  Complex roots[4];
  quartic_roots(quartic, roots);
  int count = 0;
  *clear = std::fabs(quartic[0]) > 1e-6L;
  for (int k = 0; k < 4; ++k) {
    for (int j = 0; j < k; ++j) *clear = *clear && std::abs(roots[k] - roots[j]) > 1e-4L;
    if (std::fabs(roots[k].imag()) > 1e-9L * (1 + std::abs(roots[k]))) continue;
    const long double v = roots[k].real(), under = 2 * (cg - v * ca);
    const long double u = ((q - 1) * v * v - 2 * q * cb * v + 1 + q) / under;
    *clear = *clear && std::fabs(v) > 1e-6L && std::fabs(u) > 1e-6L && std::fabs(under) > 1e-6L;
    if (!(v > 0) || !(u > 0)) continue;
    const long double first = std::sqrt(b / (1 + v * v - 2 * v * cb));
    solutions[count++] = Depths{{first, u * first, v * first}};
  }
  return count;
}

// Whether the poses have just the depths of Grunert's solutions.
bool same_solutions(const Sample& s, const Pose* poses, int count, const Depths* solutions,
                    int num_solutions) {
  if (count != num_solutions) return false;
  for (int k = 0; k < num_solutions; ++k) {
    bool found = false;
    for (int j = 0; j < count; ++j) {
      long double worst = 0;
      for (int i = 0; i < 3; ++i) {
        const Vec3 point(s.points[i][0], s.points[i][1], s.points[i][2]);
        const long double d = (poses[j].R * point + poses[j].t).norm();
        worst = std::fmax(worst, std::fabs(d - solutions[k].d[i]) / solutions[k].d[i]);
      }
      found = found || worst < 1e-7L;
    }
    if (!found) return false;
  }
  return true;
}

// ---- tests ----

void test_the_true_pose_is_found(void) {
  tv::Random random = tv::random_seeded(kSeed);
  for (int k = 0; k < 100000; ++k) {
    const Sample s = any_sample(&random, 0.1, 10);
    Pose poses[tv::kMaxAbsolutePose3pt];
    const int count = tv::absolute_pose_3pt(s.rays, s.points, poses);
    // At the danger cylinder two solutions meet, and the error is the root of the rounding error.
    TEST_ASSERT_TRUE(nearest_pose(s, poses, count) < 1e-6);
    TEST_ASSERT_TRUE(violation(s, poses, count) < 1e-9);
  }
}

void test_the_solutions_are_those_of_grunert(void) {
  tv::Random random = tv::random_seeded(kSeed + 1);
  int compared = 0, with[5] = {};
  for (int k = 0; k < 3000; ++k) {
    const Sample s = any_sample(&random, 0.5, 4);
    Pose poses[tv::kMaxAbsolutePose3pt];
    Depths solutions[4];
    bool clear;
    const int count = tv::absolute_pose_3pt(s.rays, s.points, poses);
    const int num_solutions = grunert(s, solutions, &clear);
    if (!clear) continue;
    ++compared;
    ++with[num_solutions];
    TEST_ASSERT_TRUE(same_solutions(s, poses, count, solutions, num_solutions));
  }
  // Samples with one, two, three and four solutions were among them.
  TEST_ASSERT_TRUE(compared > 2000 && with[1] > 10 && with[2] > 100 && with[3] > 2 && with[4] > 2);
}

void test_rays_to_all_sides_are_solved(void) {
  tv::Random random = tv::random_seeded(kSeed + 2);
  for (int k = 0; k < 20000; ++k) {
    Vec3 seen[3];
    for (Vec3& x : seen) x = uniform(&random, 0.5, 5) * scene::direction(&random);
    const Sample s = sample_of(seen, Pose{any_rotation(&random), scene::direction(&random)});
    Pose poses[tv::kMaxAbsolutePose3pt];
    const int count = tv::absolute_pose_3pt(s.rays, s.points, poses);
    TEST_ASSERT_TRUE(nearest_pose(s, poses, count) < 1e-5);
    TEST_ASSERT_TRUE(violation(s, poses, count) < 1e-8);
  }
}

// The error that the sample's conditioning permits, for each.
void test_difficult_samples_are_solved(void) {
  tv::Random random = tv::random_seeded(kSeed + 3);
  for (int k = 0; k < 2000; ++k) {
    const Pose truth{any_rotation(&random), scene::direction(&random)};
    const double a = uniform(&random, 0, 6.28);
    // An equilateral triangle across the axis: two lines of the pencil, and two solutions,
    // coincide.
    Vec3 symmetric[3], narrow[3], thin[3], far[3], small[3];
    for (int i = 0; i < 3; ++i) {
      const double angle = a + i * (2 * tv::kPi / 3);
      symmetric[i] = Vec3(std::cos(angle), std::sin(angle), 3);
      narrow[i] = Vec3(0.01 * std::cos(angle), 0.02 * std::sin(2 * angle), 2 + 0.1 * i);
      thin[i] = Vec3(i - 1, 1e-3 * (i == 1), 4 + 0.3 * i);
      far[i] = Vec3(uniform(&random, -1, 1), uniform(&random, -1, 1), 1000 + i);
      small[i] = 1e-9 * Vec3(uniform(&random, -1, 1), uniform(&random, -1, 1), 1 + i);
    }
    const struct {
      const Vec3* seen;
      double t_scale, limit;
    } cases[] = {{symmetric, 1, 1e-6},
                 {narrow, 1, 1e-5},
                 {thin, 1, 1e-3},
                 {far, 1, 3e-3},
                 {small, 1e-9, 1e-8}};
    for (const auto& c : cases) {
      const Sample s = sample_of(c.seen, Pose{truth.R, c.t_scale * truth.t});
      Pose poses[tv::kMaxAbsolutePose3pt];
      const int count = tv::absolute_pose_3pt(s.rays, s.points, poses);
      TEST_ASSERT_TRUE(nearest_pose(s, poses, count) < c.limit);
    }
  }
}

void test_degenerate_and_invalid_samples_give_no_pose(void) {
  tv::Random random = tv::random_seeded(kSeed + 4);
  const Sample good = any_sample(&random, 1, 4);
  Pose poses[tv::kMaxAbsolutePose3pt];
  const double bad[] = {NAN, INFINITY, -INFINITY};
  for (int k = 0; k < 9; ++k) {
    for (const double value : bad) {
      Sample s = good;
      s.points[k / 3][k % 3] = value;
      TEST_ASSERT_EQUAL_INT(0, tv::absolute_pose_3pt(s.rays, s.points, poses));
      s = good;
      s.rays[k / 3][k % 3] = value;
      TEST_ASSERT_EQUAL_INT(0, tv::absolute_pose_3pt(s.rays, s.points, poses));
    }
  }
  Sample line = good, twice = good, one = good;
  for (int d = 0; d < 3; ++d) {
    line.points[0][d] = d;
    line.points[1][d] = 2 * d;
    line.points[2][d] = 5 * d;
    twice.points[1][d] = twice.points[0][d];
    one.points[1][d] = one.points[2][d] = one.points[0][d];
  }
  TEST_ASSERT_EQUAL_INT(0, tv::absolute_pose_3pt(line.rays, line.points, poses));
  TEST_ASSERT_EQUAL_INT(0, tv::absolute_pose_3pt(twice.rays, twice.points, poses));
  TEST_ASSERT_EQUAL_INT(0, tv::absolute_pose_3pt(one.rays, one.points, poses));
  // Equal rays, and opposite ones, with points that no camera sees there: what is returned is
  // finite and a rotation.
  for (int k = 0; k < 1000; ++k) {
    Sample s = any_sample(&random, 1, 4);
    for (int d = 0; d < 3; ++d) s.rays[1][d] = k % 2 != 0 ? s.rays[0][d] : -s.rays[0][d];
    const int count = tv::absolute_pose_3pt(s.rays, s.points, poses);
    for (int j = 0; j < count; ++j) {
      TEST_ASSERT_TRUE((poses[j].R * poses[j].R.transpose() - Mat3::Identity()).norm() < 1e-9);
      TEST_ASSERT_TRUE(std::isfinite(poses[j].t.norm()));
    }
  }
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_the_true_pose_is_found);
  RUN_TEST(test_the_solutions_are_those_of_grunert);
  RUN_TEST(test_rays_to_all_sides_are_solved);
  RUN_TEST(test_difficult_samples_are_solved);
  RUN_TEST(test_degenerate_and_invalid_samples_give_no_pose);
  return UNITY_END();
}
