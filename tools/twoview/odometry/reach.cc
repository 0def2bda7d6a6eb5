#include "odometry/reach.h"

#include <algorithm>
#include <cmath>

namespace cli {
namespace {

// A frame that was followed by its turn alone has the position of the frame before it.
bool is_tracked(const FlightFrame& frame) {
  return frame.origin == PoseOrigin::kTracked && frame.status != TV_ODOMETRY_ROTATION;
}

}  // namespace

Reach::Reach(const std::vector<FlightFrame>& frames) : frames_(frames) {
  for (size_t n = 1; n < frames.size(); ++n) {
    const FlightFrame &before = frames[n - 1], &after = frames[n];
    if (!is_tracked(before) || !is_tracked(after) || before.segment != after.segment) continue;
    const double seconds = std::fabs(after.time_s - before.time_s);
    if (!(seconds > 0)) continue;
    double& speed = speed_[after.segment];
    speed = std::max(speed, norm(minus(before.pose.t, after.pose.t)) / seconds);
  }
}

bool Reach::contains(size_t index, int32_t segment, const Vector3& place) const {
  constexpr double kMargin = 2;  // a camera may fly faster where it could not be followed
  const auto speed = speed_.find(segment);
  if (speed == speed_.end()) return true;
  const auto is_near = [&](const FlightFrame& other) {
    const double seconds = std::fabs(frames_[index].time_s - other.time_s);
    return norm(minus(other.pose.t, place)) <= kMargin * speed->second * seconds;
  };
  const auto is_of_it = [&](size_t n) {
    return is_tracked(frames_[n]) && frames_[n].segment == segment;
  };
  size_t before = index, after = index + 1;
  while (before > 0 && !is_of_it(before - 1)) --before;
  while (after < frames_.size() && !is_of_it(after)) ++after;
  return (before == 0 || is_near(frames_[before - 1])) &&
         (after == frames_.size() || is_near(frames_[after]));
}

}  // namespace cli
