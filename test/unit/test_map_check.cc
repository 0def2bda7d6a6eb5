// Pairs of keyframes that check the map's relative poses (odometry/map_check.h), with the pixels of
// a scene whose motion is known.

#include <unity.h>

#include <cmath>
#include <cstdint>
#include <cstring>

#include "odometry/keyframe.h"
#include "odometry/map_check.h"
#include "support/random.h"

namespace {

constexpr int kNum = 300;
alignas(64) uint8_t memory[24 << 20];
tv_odometry* odometry;
tv_keypoint keypoints0[kNum], keypoints1[kNum];
tv_correspondence matches[kNum];
uint64_t random_state;

double uniform(double low, double high) { return low + (high - low) * random_unit(&random_state); }

// A camera that moves sideways and turns by 0.1 radians to the right.
tv::Rigid motion() {
  const double c = std::cos(0.1), s = std::sin(0.1);
  return tv::Rigid{{c, 0, -s, 0, 1, 0, s, 0, c}, {-0.4, 0.02, 0.05}};
}

tv::Rigid turned(const tv::Rigid& pose, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return tv::compose(tv::Rigid{{c, 0, -s, 0, 1, 0, s, 0, c}, {0, 0, 0}}, pose);
}

tv_keypoint seen(const double x[3]) {
  tv_keypoint k{};
  k.x = static_cast<float>(500 * x[0] / x[2] + 320 + uniform(-0.3, 0.3));
  k.y = static_cast<float>(500 * x[1] / x[2] + 240 + uniform(-0.3, 0.3));
  k.size = tv::kFinestSize;
  return k;
}

// Points between `nearest` and 4 in depth, within `reach` of the axis per unit of depth.
void draw(double nearest, double reach) {
  const tv::Rigid pose = motion();
  for (int n = 0; n < kNum; ++n) {
    const double z = uniform(nearest, 4);
    const double x[3] = {z * uniform(-reach, reach), z * uniform(-reach, reach), z};
    double moved[3];
    tv::transform(pose, x, moved);
    keypoints0[n] = seen(x);
    keypoints1[n] = seen(moved);
    matches[n] = tv_correspondence{};
    matches[n].idx0 = matches[n].idx1 = n;
    matches[n].ratio = 0.5f;
  }
}

tv::MapVote vote_on(const tv::Rigid& cam1_from_cam0, int num_votes) {
  tv::MapVote vote{};
  for (int n = 0; n < num_votes; ++n) {
    tv::add_vote(odometry, keypoints0, keypoints1, matches, kNum, cam1_from_cam0, &vote);
  }
  return vote;
}

void test_a_right_pose_is_confirmed_by_one_pair() {
  draw(1.5, 0.5);
  const tv::MapVote vote = vote_on(motion(), 1);
  TEST_ASSERT_TRUE(tv::verdict_of(vote) == tv::MapVerdict::kAgrees);
  TEST_ASSERT_FALSE(tv::needs_vote(vote));
  // Neither does an error of the turn of less than a degree contradict, nor another length of t.
  TEST_ASSERT_TRUE(tv::verdict_of(vote_on(turned(motion(), 0.015), 1)) == tv::MapVerdict::kAgrees);
  tv::Rigid longer = motion();
  for (double& t : longer.t) t *= 7;
  TEST_ASSERT_TRUE(tv::verdict_of(vote_on(longer, 1)) == tv::MapVerdict::kAgrees);
}

void test_two_pairs_contradict_a_wrong_turn() {
  draw(1.5, 0.5);
  for (const double angle : {-0.08, 0.05, 0.5}) {
    const tv::MapVote one = vote_on(turned(motion(), angle), 1);
    TEST_ASSERT_TRUE(tv::verdict_of(one) == tv::MapVerdict::kUnknown && tv::needs_vote(one));
    const tv::MapVote two = vote_on(turned(motion(), angle), 2);
    TEST_ASSERT_TRUE(tv::verdict_of(two) == tv::MapVerdict::kContradicts && !tv::needs_vote(two));
  }
}

void test_one_agreeing_pair_is_enough() {
  draw(1.5, 0.5);
  tv::MapVote vote = vote_on(turned(motion(), 0.2), 1);
  tv::add_vote(odometry, keypoints0, keypoints1, matches, kNum, motion(), &vote);
  TEST_ASSERT_TRUE(tv::verdict_of(vote) == tv::MapVerdict::kAgrees);
}

// One plane in a small part of the picture: two motions explain it, whatever the map says.
void test_a_plane_decides_nothing() {
  draw(4, 0.12);
  for (const double angle : {0.0, 0.1}) {
    const tv::MapVote vote = vote_on(turned(motion(), angle), 3);
    TEST_ASSERT_EQUAL_INT(3, vote.num_planar);
    TEST_ASSERT_TRUE(tv::verdict_of(vote) == tv::MapVerdict::kOnePlane && !tv::needs_vote(vote));
  }
}

void test_few_matches_decide_nothing() {
  draw(1.5, 0.5);
  tv::MapVote vote{};
  tv::add_vote(odometry, keypoints0, keypoints1, matches, 29, motion(), &vote);
  tv::add_vote(odometry, keypoints0, keypoints1, matches, 0, motion(), &vote);
  TEST_ASSERT_TRUE(tv::verdict_of(vote) == tv::MapVerdict::kUnknown && tv::needs_vote(vote));
  TEST_ASSERT_EQUAL_INT(2, vote.num_pairs);
}

// A keyframe of the map that sees these keypoints, each with a descriptor of its own.
int32_t keyframe_of(const tv_keypoint* keypoints, const tv::Rigid& cam_from_world) {
  tv::Frame* frame = &odometry->frame;
  uint64_t state = 9;
  frame->num = kNum;
  frame->cam_from_world = cam_from_world;
  for (int n = 0; n < kNum; ++n) {
    frame->keypoints[n] = keypoints[n];
    frame->points[n] = tv::kNoPoint;
    frame->greys[n] = static_cast<uint8_t>(n);
    for (int b = 0; b < TV_DESCRIPTOR_BYTES; ++b) {
      frame->descriptors[n * TV_DESCRIPTOR_BYTES + b] =
          static_cast<uint8_t>(90 * random_unit(&state));
    }
  }
  return odometry->map.keyframes[tv::make_keyframe(odometry, *frame)].id;
}

// The map's keyframes 0 to 2 see what keypoints0 are, the last one keypoints1, turned by `angle`
// too much; each of the first three is matched with it, one a call.
tv::MapVote check_of_keyframes(double angle, int num_pairs) {
  tv_odometry_reset(odometry);
  draw(1.5, 0.5);
  int32_t ids[3];
  for (int32_t& id : ids) id = keyframe_of(keypoints0, tv::kIdentity);
  tv::begin_check(odometry, keyframe_of(keypoints1, turned(motion(), angle)));
  for (const int32_t id : ids) tv::add_pair(&odometry->check, id);
  for (int n = 0; n < num_pairs && tv::is_checking(odometry->check); ++n) {
    tv::check_next_pair(odometry);
  }
  return odometry->check.vote;
}

void test_waiting_pairs_are_estimated_one_a_call() {
  tv::MapVote vote = check_of_keyframes(0, 1);
  TEST_ASSERT_TRUE(tv::verdict_of(vote) == tv::MapVerdict::kAgrees);
  TEST_ASSERT_FALSE(tv::is_checking(odometry->check));
  vote = check_of_keyframes(0.2, 1);
  TEST_ASSERT_EQUAL_INT(1, vote.num_disagree);
  TEST_ASSERT_TRUE(tv::is_urgent(vote) && tv::is_checking(odometry->check));
  vote = check_of_keyframes(0.2, 3);
  TEST_ASSERT_TRUE(tv::verdict_of(vote) == tv::MapVerdict::kContradicts);
  TEST_ASSERT_FALSE(tv::is_checking(odometry->check));
}

// Four keyframes that see what keypoints0 are, and the newest one, turned by `angle` too much,
// whose points are made in one call or begun in one that can wait.
void begin_points(double angle, bool can_wait) {
  tv_odometry_reset(odometry);
  for (int n = 0; n < 4; ++n) keyframe_of(keypoints0, tv::kIdentity);
  tv::begin_check(odometry, keyframe_of(keypoints1, turned(motion(), angle)));
  tv::make_points(odometry, 4, odometry->frame, can_wait);
}

void test_points_that_wait_are_those_of_one_call() {
  tv::Map& map = odometry->map;
  static int32_t points[5][kNum];
  draw(1.5, 0.5);
  begin_points(0, false);
  const int32_t num_points = map.num_points;
  TEST_ASSERT_TRUE(num_points > kNum / 2);
  for (int k = 0; k < 5; ++k) {
    TEST_ASSERT_EQUAL_INT(num_points, map.keyframes[k].num_observations);
    for (int n = 0; n < kNum; ++n) {
      points[k][n] = tv::seen_by(map, map.keyframes[k])[n];
      if (k == 4 && points[k][n] != tv::kNoPoint) {
        TEST_ASSERT_EQUAL_UINT8(n & 255, map.points[points[k][n]].grey);
      }
    }
  }
  begin_points(0, true);
  const int expected[5] = {0, 0, num_points, num_points, num_points};
  for (int k = 0; k < 5; ++k) {
    TEST_ASSERT_EQUAL_INT(expected[k], map.keyframes[k].num_observations);
  }
  for (int call = 0; call < 2; ++call) {  // after the second one nothing is left
    tv::make_points(odometry, 4, odometry->frame, false);
    TEST_ASSERT_EQUAL_INT(num_points, map.num_points);
    TEST_ASSERT_EQUAL_INT(4, odometry->unfinished.next_neighbour);
    for (int k = 0; k < 5; ++k) {
      for (int n = 0; n < kNum; ++n) {
        TEST_ASSERT_EQUAL_INT(points[k][n], tv::seen_by(map, map.keyframes[k])[n]);
      }
    }
  }
}

void test_points_do_not_wait_where_a_pair_disagrees() {
  draw(1.5, 0.5);
  begin_points(0.2, true);
  TEST_ASSERT_EQUAL_INT(2, odometry->check.vote.num_disagree);
}

// Nobody would heed the votes of the points that waited, which are made before a frame is tracked:
// their pairs are estimated when it was.
void test_pairs_of_points_that_wait_vote_later() {
  const tv::MapCheck& check = odometry->check;
  draw(4, 0.12);
  begin_points(0, true);
  TEST_ASSERT_EQUAL_INT(1, check.vote.num_planar);
  TEST_ASSERT_TRUE(tv::is_urgent(check.vote) && check.num_others == 0);
  tv::make_points(odometry, 4, odometry->frame, false);
  TEST_ASSERT_EQUAL_INT(1, check.vote.num_pairs);
  TEST_ASSERT_EQUAL_INT(2, check.num_others);
}

void test_a_removed_keyframe_does_not_vote() {
  check_of_keyframes(0.2, 0);
  tv::remove_keyframe(&odometry->map, 0, 1);
  tv::check_next_pair(odometry);
  TEST_ASSERT_EQUAL_INT(0, odometry->check.vote.num_pairs);
  TEST_ASSERT_TRUE(tv::is_checking(odometry->check));
  tv::check_next_pair(odometry);
  TEST_ASSERT_EQUAL_INT(1, odometry->check.vote.num_pairs);
  TEST_ASSERT_FALSE(tv::is_checking(odometry->check));
}

void test_a_disagreement_lasts_until_a_pair_agrees() {
  check_of_keyframes(0.2, 1);
  tv::begin_check(odometry, 4);
  TEST_ASSERT_EQUAL_INT(1, odometry->check.vote.num_disagree);
  TEST_ASSERT_EQUAL_INT(0, odometry->check.vote.num_pairs);
  odometry->check.vote.num_agree = 1;
  tv::begin_check(odometry, 5);
  TEST_ASSERT_EQUAL_INT(0, odometry->check.vote.num_disagree);
  // A contradiction mends the map: what follows begins anew.
  odometry->check.vote.num_disagree = 2;
  tv::begin_check(odometry, 6);
  TEST_ASSERT_EQUAL_INT(0, odometry->check.vote.num_disagree);
}

// Four keyframes in a row: this one and the three before it.
void test_keyframes_that_no_pair_confirms_are_counted() {
  odometry->check.vote.num_agree = 1;
  for (int n = 0; n < 6; ++n) {
    tv::begin_check(odometry, 4 + n);
    TEST_ASSERT_EQUAL_INT(n, odometry->check.num_unconfirmed);
    TEST_ASSERT_EQUAL_INT(n >= 3, tv::is_unconfirmed(odometry->check));
  }
  odometry->check.vote.num_agree = 1;
  TEST_ASSERT_FALSE(tv::is_unconfirmed(odometry->check));
  tv::begin_check(odometry, 10);
  TEST_ASSERT_EQUAL_INT(0, odometry->check.num_unconfirmed);
}

}  // namespace

extern "C" void setUp(void) {
  const tv_camera camera = {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {0}};
  random_state = 5;
  size_t size = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_size(&camera, nullptr, &size));
  TEST_ASSERT_TRUE(size <= sizeof memory);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_init(&odometry, &camera, nullptr, memory, size));
}

extern "C" void tearDown(void) {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_right_pose_is_confirmed_by_one_pair);
  RUN_TEST(test_two_pairs_contradict_a_wrong_turn);
  RUN_TEST(test_one_agreeing_pair_is_enough);
  RUN_TEST(test_a_plane_decides_nothing);
  RUN_TEST(test_few_matches_decide_nothing);
  RUN_TEST(test_waiting_pairs_are_estimated_one_a_call);
  RUN_TEST(test_points_that_wait_are_those_of_one_call);
  RUN_TEST(test_points_do_not_wait_where_a_pair_disagrees);
  RUN_TEST(test_pairs_of_points_that_wait_vote_later);
  RUN_TEST(test_a_removed_keyframe_does_not_vote);
  RUN_TEST(test_a_disagreement_lasts_until_a_pair_agrees);
  RUN_TEST(test_keyframes_that_no_pair_confirms_are_counted);
  return UNITY_END();
}
