#include "odometry/path_order.h"

#include <algorithm>
#include <cstdio>
#include <limits>

#include "base/median.h"

namespace cli {
namespace {

constexpr size_t kWindow = 8;  // frames whose way is compared with the shortest one
constexpr size_t kFewest = 3;  // windows, and steps on each side of a jump
constexpr size_t kBeside = 5;  // steps on each side of a jump that it is compared with
// The least length of a window's path and of a jump that count, in radians as seen from the scene's
// depth: the positions of a camera that stands still are noise.
constexpr double kLeastWay = 0.03;
// Measured 2026-11-30. The way over the shortest one: at most 1.02 in eight sequences, also with
// every fourth frame alone, and seven flights; 1.15 to 6 where neighbours are exchanged, counters
// are words or hashes. A step over the longest of those beside it: at most 1.8; 15 to 43 at a cut.
constexpr double kToAndFro = 1.1, kJump = 5;

struct Place {
  size_t index;  // among the frames
  const FlightFrame* frame;
};

// The median distance of the points from the middle of the camera's places.
double reach_of(const std::vector<Place>& places, const std::vector<tv_map_point>& points,
                int32_t segment) {
  Vector3 middle{};
  for (const Place& place : places)
    for (size_t k = 0; k < 3; ++k)
      middle[k] += place.frame->pose.t[k] / static_cast<double>(places.size());
  std::vector<double> distances;
  for (const tv_map_point& p : points)
    if (p.segment == segment)
      distances.push_back(norm(minus({p.position[0], p.position[1], p.position[2]}, middle)));
  return distances.empty() ? 0 : median_of(distances);
}

// How far the picture moves from one frame to another, in radians, about.
double way(const Place& a, const Place& b, double reach) {
  return norm(minus(b.frame->pose.t, a.frame->pose.t)) / reach +
         angle_of(product(transposed(a.frame->pose.R), b.frame->pose.R));
}

// The length of the shortest tree that joins the places: no way through all of them is shorter.
double tree(const Place* places, size_t count, double reach) {
  std::vector<double> nearest(count, std::numeric_limits<double>::infinity());
  std::vector<bool> is_joined(count, false);
  double length = 0;
  for (size_t last = 0, joined = 1; joined < count; ++joined) {
    is_joined[last] = true;
    size_t next = count;
    for (size_t k = 0; k < count; ++k) {
      if (is_joined[k]) continue;
      nearest[k] = std::min(nearest[k], way(places[last], places[k], reach));
      if (next == count || nearest[k] < nearest[next]) next = k;
    }
    length += nearest[next];
    last = next;
  }
  return length;
}

// How many times as long the frames' own way is as the shortest one, over all windows; 1 where
// there are few.
double to_and_fro(const std::vector<Place>& places, double reach) {
  double own = 0, shortest = 0;
  size_t count = 0;
  for (size_t i = 0; i + kWindow <= places.size(); i += kWindow / 2) {
    if (places[i + kWindow - 1].index - places[i].index > 2 * kWindow) continue;
    const double length = tree(&places[i], kWindow, reach);
    if (length < kLeastWay) continue;
    for (size_t k = i + 1; k < i + kWindow; ++k) own += way(places[k - 1], places[k], reach);
    shortest += length;
    ++count;
  }
  return count >= kFewest && shortest > 0 ? own / shortest : 1;
}

struct Jump {
  size_t to = 0;
  double share = 0;  // of the longest step beside it
};

Jump longest_jump(const std::vector<Place>& places, double reach) {
  std::vector<double> steps, speeds;  // to the place of the same index
  for (size_t k = 0; k < places.size(); ++k) {
    const double seconds = k == 0 ? 0 : places[k].frame->time_s - places[k - 1].frame->time_s;
    steps.push_back(k == 0 ? 0 : way(places[k - 1], places[k], reach));
    speeds.push_back(seconds > 0 ? steps[k] / seconds : 0);
  }
  Jump longest;
  for (size_t k = 1 + kFewest; k + kFewest < places.size(); ++k) {
    if (places[k].index != places[k - 1].index + 1 || steps[k] < kLeastWay) continue;
    double beside = 0;
    for (size_t j = std::max<size_t>(1, k - std::min(k, kBeside));
         j <= std::min(places.size() - 1, k + kBeside); ++j)
      if (j != k) beside = std::max(beside, speeds[j]);
    if (beside > 0 && speeds[k] > longest.share * beside) longest = {k, speeds[k] / beside};
  }
  return longest;
}

}  // namespace

std::string path_order_words(const std::vector<FlightFrame>& frames,
                             const std::vector<tv_map_point>& points, int32_t segment) {
  std::vector<Place> places;
  for (size_t n = 0; n < frames.size(); ++n)
    // A frame that was followed by its turn alone has the position of the frame before it.
    if (frames[n].origin != PoseOrigin::kNone && frames[n].segment == segment &&
        (frames[n].origin == PoseOrigin::kLocated || frames[n].status != TV_ODOMETRY_ROTATION))
      places.push_back({n, &frames[n]});
  const double reach = reach_of(places, points, segment);
  if (!(reach > 0)) return "";
  char text[400];
  if (const double share = to_and_fro(places, reach); share > kToAndFro) {
    std::snprintf(text, sizeof text,
                  "the path goes to and fro: its way is %.2g times the shortest one through the "
                  "places of eight frames. Are the pictures in the order in which they were taken "
                  "(names, list of times, the film's encoder)?",
                  share);
    return text;
  }
  const Jump jump = longest_jump(places, reach);
  if (jump.share <= kJump) return "";
  std::snprintf(text, sizeof text,
                "from %.80s to %.80s the camera moves %.2g times as far as in the frames before "
                "and after: are pictures missing, is the film cut, or is the order another one? "
                "Places are known there, times are not",
                places[jump.to - 1].frame->name.c_str(), places[jump.to].frame->name.c_str(),
                jump.share);
  return text;
}

}  // namespace cli
