#include "room_model/partners.h"

#include <algorithm>
#include <cmath>

namespace cli {
namespace {

// Of the depths of the points, with room for what has no corner, near and far.
constexpr double kNearShare = 0.7, kFarShare = 1.6;
constexpr size_t kFewestPoints = 20;

// A partner's distance from the keyframe that is aimed at, as a share of the median depth, and on
// which side of the first one it should lie.
struct Wanted {
  double share, side;
};
constexpr Wanted kWanted[] = {{0.1, 1}, {0.1, -1}, {0.2, 1}, {0.2, -1}};
// Views before and after a keyframe among which its partners are looked for: the relative pose of
// frames that are far apart in time has the drift of the path.
constexpr size_t kNeighbours = 120;
constexpr double kLeastCosine =
    0.939372712847379;                // of 0.35 rad, the most that a partner is turned
constexpr double kLeastShare = 0.02;  // of the median depth, the least distance
constexpr double kElsewhereCosine = 0.9993908270190958;  // of 2 degrees

// The cosine of the angle by which one rotation differs from another.
double cosine_between(const Matrix3& a, const Matrix3& b) {
  double trace = 0;
  for (size_t k = 0; k < 9; ++k) trace += a[k] * b[k];
  return std::clamp((trace - 1) / 2, -1.0, 1.0);
}

// What is new enough for a depth map of its own; the cosine is that of 12 degrees. Chosen for time
// on one rendered flight (scripts/room, flight 5), where F at 5 cm is 0.695 in place of 0.701 with
// a twelfth and 10 degrees, in 0.74 of the time; on flight 0 F fell from 0.833 to 0.803.
constexpr double kNewStep = 1.0 / 8, kNewCosine = 0.9781476007338057;

struct Candidate {
  size_t view;
  Vector3 direction;  // from the keyframe to it, in the keyframe's frame, of length 1
  double distance, turn_rad;
};

std::vector<Candidate> candidates(const RoomScene& scene, size_t key, double median_depth) {
  const RoomView& own = scene.views[key];
  const Matrix3 cam_from_world = transposed(own.R);
  const size_t reach = scene.is_flight ? kNeighbours : scene.views.size();
  const size_t first = key > reach ? key - reach : 0;
  const size_t end = std::min(scene.views.size(), key + reach + 1);
  std::vector<Candidate> found;
  for (size_t k = first; k < end; ++k) {
    if (k == key || !scene.views[k].has_picture) continue;
    const RoomView& other = scene.views[k];
    Vector3 away;
    for (size_t axis = 0; axis < 3; ++axis) away[axis] = other.t[axis] - own.t[axis];
    const double distance = norm(away), cosine = cosine_between(own.R, other.R);
    if (!(distance > kLeastShare * median_depth) || cosine < kLeastCosine) continue;
    Vector3 direction = applied(cam_from_world, away);
    for (double& value : direction) value /= distance;
    found.push_back({k, direction, distance, std::acos(cosine)});
  }
  return found;
}

}  // namespace

DepthRange depth_range(const RoomScene& scene, const RoomView& view) {
  const tv_camera& camera = scene.camera;
  const Matrix3 cam_from_world = transposed(view.R);
  std::vector<double> ahead;
  for (const Vector3& point : scene.points) {
    Vector3 x = point;
    for (size_t axis = 0; axis < 3; ++axis) x[axis] -= view.t[axis];
    x = applied(cam_from_world, x);
    if (x[2] > 0) ahead.insert(ahead.end(), x.begin(), x.end());
  }
  const size_t count = ahead.size() / 3;
  std::vector<double> pixels(2 * count), depths;
  std::vector<uint8_t> inside(count);
  if (tv_camera_project_points(&camera, ahead.data(), static_cast<int32_t>(count), pixels.data(),
                               inside.data()) != TV_OK)
    return {};
  for (size_t k = 0; k < count; ++k) {
    const double u = pixels[2 * k], v = pixels[2 * k + 1];
    if (inside[k] != 0 && u >= 0 && v >= 0 && u < camera.width && v < camera.height)
      depths.push_back(ahead[3 * k + 2]);
  }
  if (depths.size() < kFewestPoints) return {};
  std::sort(depths.begin(), depths.end());
  const auto at = [&](double share) {
    return depths[static_cast<size_t>(share * static_cast<double>(depths.size() - 1) + 0.5)];
  };
  return {kNearShare * at(0.01), at(0.5), kFarShare * at(0.99)};
}

bool is_elsewhere(const RoomView& last, const RoomView& view, double median_depth) {
  const Vector3 step{view.t[0] - last.t[0], view.t[1] - last.t[1], view.t[2] - last.t[2]};
  return norm(step) >= kLeastShare * median_depth ||
         cosine_between(view.R, last.R) < kElsewhereCosine;
}

bool is_new_beside(const RoomView& last, const RoomView& view, double median_depth) {
  Vector3 step;
  for (size_t axis = 0; axis < 3; ++axis) step[axis] = view.t[axis] - last.t[axis];
  return norm(step) >= kNewStep * median_depth || cosine_between(view.R, last.R) <= kNewCosine;
}

std::vector<size_t> choose_keyframes(const RoomScene& scene, double median_depth) {
  std::vector<size_t> chosen;
  for (size_t k = 0; k < scene.views.size(); ++k) {
    const RoomView& view = scene.views[k];
    if (!view.is_keyframe || !view.has_picture) continue;
    if (!chosen.empty() && scene.is_flight &&
        !is_new_beside(scene.views[chosen.back()], view, median_depth))
      continue;
    chosen.push_back(k);
  }
  return chosen;
}

std::vector<size_t> choose_partners(const RoomScene& scene, size_t key, double median_depth) {
  const std::vector<Candidate> all = candidates(scene, key, median_depth);
  std::vector<size_t> chosen;
  Vector3 first{0, 0, 0};
  for (const Wanted& wanted : kWanted) {
    const Candidate* best = nullptr;
    double least = INFINITY;
    for (const Candidate& candidate : all) {
      if (std::find(chosen.begin(), chosen.end(), candidate.view) != chosen.end()) continue;
      // A distance that is off by a factor e costs as much as a turn of half a radian, or as two
      // steps straight ahead: along the axis there is no parallax in the middle of the picture.
      const double cost = std::abs(std::log(candidate.distance / (wanted.share * median_depth))) +
                          2 * candidate.turn_rad + 0.5 * std::abs(candidate.direction[2]) -
                          0.6 * wanted.side * dot(candidate.direction, first);
      if (!(cost < least)) continue;
      least = cost;
      best = &candidate;
    }
    if (best == nullptr) break;
    if (chosen.empty()) first = best->direction;
    chosen.push_back(best->view);
  }
  return chosen;
}

}  // namespace cli
