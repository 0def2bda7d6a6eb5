#include "odometry/doubts.h"

#include "odometry/map_check.h"
#include "odometry/metric.h"

namespace tv {
namespace {

// Velocities are believed against the map once so many of its ways agreed with them. The map is
// wrong where so many frames in a row contradict velocities that are believed.
constexpr int32_t kLeastTrust = 5, kMostContrary = 5;

}  // namespace

uint32_t reasons_of(uint32_t map_reasons) {
  constexpr uint32_t kParallax =
      TV_MAP_REASON_UNCONFIRMED | TV_MAP_REASON_JUMPED | TV_MAP_REASON_UNSURE_ATTITUDE;
  constexpr uint32_t kPlanar = TV_MAP_REASON_CONTRADICTED | TV_MAP_REASON_ONE_PLANE;
  uint32_t reasons = 0;
  if ((map_reasons & kParallax) != 0) reasons |= TV_REASON_LOW_PARALLAX;
  if ((map_reasons & kPlanar) != 0) reasons |= TV_REASON_TWO_PLANAR_SOLUTIONS;
  if ((map_reasons & TV_MAP_REASON_VELOCITIES_DISAGREE) != 0) reasons |= TV_REASON_SECOND_MOTION;
  return reasons;
}

void doubt(Odometry* odometry, tv_map_reason reason) {
  odometry->doubts = reason;
  odometry->doubtful_segment = odometry->segment;
}

void add_doubts(const Odometry& odometry, tv_odometry_state* state) {
  if (odometry.doubtful_segment == odometry.segment) state->map_reasons |= odometry.doubts;
}

namespace {

// Removes the segment's keyframes that were made since the last confirmed one, and what only they
// saw. Frames are doubtful until one is confirmed. Of a segment that is removed as a whole nothing
// is left but its number, until the frame is found in another one or begins another.
void remove_unconfirmed(Odometry* odometry) {
  Map& map = odometry->map;
  int32_t last = newest_of(map, odometry->segment, map.num_keyframes);
  while (last >= 0 && map.keyframes[last].id > odometry->confirmed_id) {
    const int32_t before = newest_of(map, odometry->segment, last);
    remove_keyframe(&map, last, before);
    last = before;
  }
  remove_lone_points(&map);
  gather_ways(odometry);  // what was wrong says nothing of the scale
  doubt(odometry, TV_MAP_REASON_CONTRADICTED);
  odometry->reference_id = last >= 0 ? map.keyframes[last].id : -1;
}

}  // namespace

bool heed_velocities(Odometry* odometry, const Frame& frame, uint32_t* map_reasons) {
  if (!is_contrary(*odometry, frame)) {
    odometry->num_contrary = 0;
    return true;
  }
  *map_reasons |= TV_MAP_REASON_VELOCITIES_DISAGREE;
  odometry->travel.is_contrary = true;
  if (odometry->velocity_trust < kLeastTrust || ++odometry->num_contrary < kMostContrary)
    return true;
  odometry->velocity_trust -= odometry->velocity_trust / 4;
  if (!odometry->scale.was_known && !odometry->scale.is_contradicted) odometry->confirmed_id = -1;
  remove_unconfirmed(odometry);
  return false;
}

bool heed_check(Odometry* odometry) {
  const MapVerdict verdict = verdict_of(odometry->check.vote);
  if (verdict == MapVerdict::kAgrees && odometry->num_contrary == 0) {
    odometry->confirmed_id = odometry->check.keyframe_id;
    measure_reach(*odometry, odometry->frame, &odometry->confirmed);
    if (odometry->doubtful_segment == odometry->segment) odometry->doubts = 0;
  } else if (verdict == MapVerdict::kContradicts) {
    remove_unconfirmed(odometry);
  } else if (verdict == MapVerdict::kOnePlane && !is_checking(odometry->check)) {
    doubt(odometry, TV_MAP_REASON_ONE_PLANE);
  } else if (is_unconfirmed(odometry->check)) {
    doubt(odometry, TV_MAP_REASON_UNCONFIRMED);
  }
  return verdict != MapVerdict::kContradicts;
}

}  // namespace tv
