// A lattice of points is recognised; random points are not taken for one.
#include "robust/lattice.h"
#include "support/scene.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using scene::uniform;

constexpr int kSide = 12, kNum = kSide * kSide;

tv::Lattice lattice_of(const double* xy) {
  alignas(64) static unsigned char memory[1 << 16];
  TEST_ASSERT_TRUE(tv::lattice_bytes(kNum) <= sizeof memory);
  tv::Arena arena = tv::arena_over(memory, sizeof memory);
  return tv::find_lattice(xy, kNum, nullptr, 0, arena);
}

void test_points_of_a_skewed_lattice_are_recognised(void) {
  tv::Random random = tv::random_seeded(1);
  double xy[2 * kNum];
  for (int i = 0; i < kNum; ++i) {
    const int column = i % kSide, row = i / kSide;
    xy[2 * i] = 30 * column + 7 * row + uniform(&random, -0.5, 0.5);
    xy[2 * i + 1] = 25 * row - 4 * column + uniform(&random, -0.5, 0.5);
  }
  const tv::Lattice lattice = lattice_of(xy);
  TEST_ASSERT_TRUE(lattice.share > 0.6);
  TEST_ASSERT_TRUE(lattice.sigmas > 10);
}

void test_random_points_are_no_lattice(void) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    tv::Random random = tv::random_seeded(seed);
    double xy[2 * kNum];
    for (double& x : xy) x = uniform(&random, 0, 400);
    const tv::Lattice lattice = lattice_of(xy);
    TEST_ASSERT_TRUE(lattice.share < 0.15);
    TEST_ASSERT_TRUE(lattice.sigmas < 5);
  }
}

// On points between a lattice and random ones.
void test_the_opposite_share_bounds_the_share_of_the_lattice(void) {
  alignas(64) static unsigned char memory[1 << 16];
  tv::Arena arena = tv::arena_over(memory, sizeof memory);
  int32_t listed[kNum];
  for (int i = 0; i < kNum; ++i) listed[i] = i;
  int num_above = 0;
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    tv::Random random = tv::random_seeded(seed);
    double xy[2 * kNum];
    for (int i = 0; i < kNum; ++i) {
      const double noise = 0.15 * static_cast<double>(seed);
      xy[2 * i] = 30 * (i % kSide) + uniform(&random, -noise, noise);
      xy[2 * i + 1] = 25 * (i / kSide) + uniform(&random, -noise, noise);
    }
    const double share = tv::find_lattice(xy, kNum, listed, kNum, arena).share;
    const double opposite = tv::opposite_share(xy, kNum, listed, kNum, 0, arena);
    TEST_ASSERT_TRUE(opposite >= share && opposite <= 1);
    for (const double least : {0.1, 0.5, 0.9}) {
      const double bound = tv::opposite_share(xy, kNum, listed, kNum, least, arena);
      TEST_ASSERT_TRUE(bound == opposite || (bound == 0 && opposite <= least));
      num_above += bound > 0;
    }
  }
  TEST_ASSERT_TRUE(num_above > 30 && num_above < 100);
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_points_of_a_skewed_lattice_are_recognised);
  RUN_TEST(test_random_points_are_no_lattice);
  RUN_TEST(test_the_opposite_share_bounds_the_share_of_the_lattice);
  return UNITY_END();
}
