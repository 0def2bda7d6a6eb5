// Matches of one place: which of them stays, compared with a search over all pairs.

#include "match/witness.h"

#include <unity.h>

#include <algorithm>
#include <cstdint>

#include "match/rank.h"
#include "support/random.h"

namespace {

constexpr int kMost = 600;
tv_keypoint keypoints[2][kMost];
tv_correspondence matches[kMost], expected[kMost];
float variances[kMost];
alignas(64) uint8_t arena_memory[1 << 17];

int keep(int num) {
  const tv_keypoint* const both[2] = {keypoints[0], keypoints[1]};
  TEST_ASSERT_LESS_OR_EQUAL(sizeof arena_memory, tv::witness_bytes(num));
  tv::Arena arena = tv::arena_over(arena_memory, tv::witness_bytes(num));
  const int left = tv::keep_witnesses(both, variances, matches, num, arena);
  TEST_ASSERT_TRUE(arena.used_bytes == 0);
  TEST_ASSERT_LESS_OR_EQUAL(tv::witness_bytes(num), arena.high_water_bytes);
  return left;
}

void make_matches(uint64_t* seed, int num, int side) {
  for (int k = 0; k < num; ++k) {
    for (int v = 0; v < 2; ++v) {
      keypoints[v][k] = tv_keypoint{};
      keypoints[v][k].x = static_cast<float>(random_int(seed, -side, side)) / 4;
      keypoints[v][k].y = static_cast<float>(random_int(seed, -side, side)) / 4;
    }
    variances[k] = static_cast<float>(random_int(seed, 1, 5));
    matches[k] = {k, num - 1 - k, 0, static_cast<float>(random_int(seed, 0, 3)) / 4};
  }
}

bool one_place(const tv_correspondence& a, const tv_correspondence& b) {
  const auto near = [](const tv_keypoint& p, const tv_keypoint& q) {
    return std::abs(p.x - q.x) < tv::kOnePlacePx && std::abs(p.y - q.y) < tv::kOnePlacePx;
  };
  return near(keypoints[0][a.idx0], keypoints[0][b.idx0]) &&
         near(keypoints[1][a.idx1], keypoints[1][b.idx1]);
}

// Of all matches that are not of the place of one that is kept, the best one is kept next.
int expect(int num) {
  bool open[kMost];
  bool kept[kMost] = {};
  std::fill(open, open + num, true);
  for (;;) {
    int best = -1;
    for (int k = 0; k < num; ++k) {
      if (!open[k]) continue;
      const bool better =
          best < 0 || variances[k] < variances[best] ||
          (variances[k] == variances[best] && tv::rank_of(matches[k]) < tv::rank_of(matches[best]));
      if (better) best = k;
    }
    if (best < 0) break;
    kept[best] = true;
    for (int k = 0; k < num; ++k) open[k] = open[k] && !one_place(matches[k], matches[best]);
  }
  int count = 0;
  for (int k = 0; k < num; ++k) {
    if (kept[k]) expected[count++] = matches[k];
  }
  return count;
}

void test_the_most_precise_match_of_each_place_stays() {
  uint64_t seed = 5320;
  for (int round = 0; round < 200; ++round) {
    const int num = random_int(&seed, 0, kMost);
    make_matches(&seed, num, round % 3 == 0 ? 400 : random_int(&seed, 1, 40));
    const int count = expect(num);
    TEST_ASSERT_EQUAL_INT(count, keep(num));
    for (int k = 0; k < count; ++k) {
      TEST_ASSERT_EQUAL_INT(expected[k].idx0, matches[k].idx0);
      TEST_ASSERT_EQUAL_INT(expected[k].idx1, matches[k].idx1);
    }
  }
}

void test_matches_that_share_one_end_only_are_two() {
  for (int shared = 0; shared < 2; ++shared) {
    uint64_t seed = 5321;
    make_matches(&seed, 2, 400);
    for (int v = 0; v < 2; ++v) {
      keypoints[v][0].x = keypoints[v][1].x = keypoints[v][0].y = keypoints[v][1].y = 50;
    }
    keypoints[1 - shared][1].x = 50 + tv::kOnePlacePx;
    TEST_ASSERT_EQUAL_INT(2, keep(2));
  }
}

void test_exchanged_images_keep_the_same_matches() {
  uint64_t seed = 5322;
  for (int round = 0; round < 50; ++round) {
    const int num = random_int(&seed, 2, 300);
    make_matches(&seed, num, 60);
    static tv_correspondence first[kMost];
    tv_correspondence exchanged[kMost];
    float their_variances[kMost];
    for (int k = 0; k < num; ++k) {  // in ascending order of the other image's index
      const tv_correspondence& m = matches[num - 1 - k];
      exchanged[k] = {m.idx1, m.idx0, m.dist_sq, m.ratio};
      their_variances[k] = variances[num - 1 - k];
    }
    const int count = keep(num);
    std::copy(matches, matches + count, first);
    std::copy(exchanged, exchanged + num, matches);
    std::copy(their_variances, their_variances + num, variances);
    std::swap_ranges(keypoints[0], keypoints[0] + kMost, keypoints[1]);
    TEST_ASSERT_EQUAL_INT(count, keep(num));
    for (int k = 0; k < count; ++k) {
      TEST_ASSERT_EQUAL_INT(first[count - 1 - k].idx0, matches[k].idx1);
      TEST_ASSERT_EQUAL_INT(first[count - 1 - k].idx1, matches[k].idx0);
    }
  }
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_the_most_precise_match_of_each_place_stays);
  RUN_TEST(test_matches_that_share_one_end_only_are_two);
  RUN_TEST(test_exchanged_images_keep_the_same_matches);
  return UNITY_END();
}
