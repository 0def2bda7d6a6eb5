#include "odometry/map_check.h"

#include "odometry/move_principal_point.h"

namespace tv {
namespace {

// A map contradicts a pair whose turns differ by more than three standard deviations of the pair's
// and this angle, in radians. Measured: docs/algorithms/odometry.md.
constexpr double kTurnSigmas = 3, kTurnAllowed = 0.026;
constexpr int32_t kContradicting = 2;    // pairs that disagree
constexpr int32_t kMostUnconfirmed = 3;  // keyframes in a row that no pair confirmed

}  // namespace

void add_vote(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
              const tv_correspondence* matches, int32_t num, const Rigid& cam1_from_cam0,
              MapVote* vote) {
  ArenaScope scope(odometry->scratch);
  Pair pair;
  ++vote->num_pairs;
  if (!estimate_pair(odometry, keypoints0, keypoints1, matches, num, &pair)) return;
  const tv_two_view& view = *pair.view;
  if (view.verdict == TV_VERDICT_DOUBTFUL && (view.reasons & TV_REASON_TWO_PLANAR_SOLUTIONS) != 0) {
    ++vote->num_planar;
  }
  if (view.verdict != TV_VERDICT_OK || !view.has_R || !view.has_covariance) return;
  if (odometry->options.refine != 0) {
    add_evidence(*pair.evidence, odometry->camera.model.fx, &odometry->camera_evidence);
  }
  const double difference = turn_between(cam1_from_cam0, rigid_of(view.R, view.t));
  if (difference <= kTurnSigmas * turn_sigma_of(view.covariance, 5) + kTurnAllowed)
    ++vote->num_agree;
  else
    ++vote->num_disagree;
}

bool needs_vote(const MapVote& vote) {
  return vote.num_agree == 0 && vote.num_disagree < kContradicting && vote.num_pairs < kMostPairs;
}

MapVerdict verdict_of(const MapVote& vote) {
  if (vote.num_agree > 0) return MapVerdict::kAgrees;
  if (vote.num_disagree >= kContradicting) return MapVerdict::kContradicts;
  return 2 * vote.num_planar > vote.num_pairs ? MapVerdict::kOnePlane : MapVerdict::kUnknown;
}

bool is_urgent(const MapVote& vote) {
  return needs_vote(vote) && vote.num_disagree + vote.num_planar > 0;
}

bool is_unconfirmed(const MapCheck& check) {
  return check.vote.num_agree == 0 && check.num_unconfirmed >= kMostUnconfirmed;
}

void begin_check(Odometry* odometry, int32_t keyframe_id) {
  // A disagreement counts until a pair agrees, or the map was mended.
  const MapVote before = odometry->check.vote;
  const int32_t num_unconfirmed = before.num_agree == 0 ? odometry->check.num_unconfirmed + 1 : 0;
  const int32_t num_disagree =
      before.num_agree == 0 && before.num_disagree < kContradicting ? before.num_disagree : 0;
  odometry->check = MapCheck{};
  odometry->check.keyframe_id = keyframe_id;
  odometry->check.vote.num_disagree = num_disagree;
  odometry->check.num_unconfirmed = num_unconfirmed;
}

void add_pair(MapCheck* check, int32_t other_id) {
  if (check->num_others < kMostPairs - 1) check->other_ids[check->num_others++] = other_id;
}

bool is_checking(const MapCheck& check) {
  return check.next < check.num_others && needs_vote(check.vote);
}

void check_next_pair(Odometry* odometry) {
  ArenaScope scope(odometry->scratch);
  Arena& arena = odometry->scratch;
  const Map& map = odometry->map;
  MapCheck* check = &odometry->check;
  const int32_t keyframe = find_keyframe(map, check->keyframe_id);
  const int32_t other = find_keyframe(map, check->other_ids[check->next++]);
  if (keyframe < 0 || other < 0) return;
  const MapKeyframe &k0 = map.keyframes[other], &k1 = map.keyframes[keyframe];
  if (k0.described < 0 || k1.described < 0 || k0.segment != k1.segment) return;
  const int32_t room = map.sizes.max_keypoints;
  const size_t n = static_cast<size_t>(room);
  const tv_features theirs = features_of(map, k0, arena_alloc<tv_keypoint>(arena, n));
  const tv_features mine = features_of(map, k1, arena_alloc<tv_keypoint>(arena, n));
  tv_correspondence* found = arena_alloc<tv_correspondence>(arena, n);
  int32_t num = 0;
  tv_match(odometry->context, &theirs, &mine, nullptr, found, room, &num);
  add_vote(odometry, theirs.keypoints, mine.keypoints, found, num,
           motion_between(k0.cam_from_world, k1.cam_from_world), &check->vote);
}

}  // namespace tv
