#include "odometry/tracking_state.h"

namespace tv {
namespace {

constexpr int kNumStates = 4, kNumEvents = 6;

// The most frames in a row that are followed by their turn alone: they keep the position of the
// first, and the errors of the turns add up.
constexpr int32_t kMostTurnedFrames = 60;
// Frames without a pose from the map, before another segment is begun. Of a picture that was
// covered for less, the frames after it are found in the map.
constexpr int32_t kAwayBeforeSegment = 8;

// An event that cannot follow in a state.
constexpr TrackingState kNever = static_cast<TrackingState>(-1);

constexpr TrackingState kStarting = TrackingState::kStarting;
constexpr TrackingState kTracked = TrackingState::kTracked;
constexpr TrackingState kTurned = TrackingState::kTurned;
constexpr TrackingState kLost = TrackingState::kLost;

// By the state of the frame before, what was found out: followed, found, contradicted, turned,
// began, missed.
constexpr TrackingState kTransitions[kNumStates][kNumEvents] = {
    {kNever, kNever, kNever, kNever, kTracked, kStarting},  // starting
    {kTracked, kTracked, kLost, kTurned, kTracked, kLost},  // tracked
    {kTracked, kTracked, kLost, kTurned, kTracked, kLost},  // turned
    {kNever, kTracked, kLost, kNever, kTracked, kLost},     // lost
};

TrackingState next_state(TrackingState state, TrackingEvent event) {
  return kTransitions[static_cast<int>(state)][static_cast<int>(event)];
}

}  // namespace

bool may_try(const Tracking& tracking, TrackingEvent event) {
  if (next_state(tracking.state, event) == kNever) return false;
  if (event == TrackingEvent::kTurned) return tracking.num_away < kMostTurnedFrames;
  if (event == TrackingEvent::kBegan) {
    return tracking.state == kStarting || tracking.num_away >= kAwayBeforeSegment;
  }
  return true;
}

void move_on(TrackingEvent event, Tracking* tracking) {
  tracking->state = next_state(tracking->state, event);
  const bool was_missed = event == TrackingEvent::kTurned || event == TrackingEvent::kMissed;
  if (!was_missed) tracking->num_away = 0;  // the frame had a pose from the map, if a wrong one
  if (tracking->state != kTracked) ++tracking->num_away;
}

bool has_pose(TrackingState state) { return state == kTracked || state == kTurned; }

tv_odometry_status status_of(TrackingState state, uint32_t reasons) {
  switch (state) {
    case kStarting: return TV_ODOMETRY_STARTING;
    case kTracked: return reasons == 0 ? TV_ODOMETRY_TRACKING : TV_ODOMETRY_WEAK;
    case kTurned: return TV_ODOMETRY_ROTATION;
    case kLost: return TV_ODOMETRY_LOST;
  }
  return TV_ODOMETRY_LOST;
}

}  // namespace tv
