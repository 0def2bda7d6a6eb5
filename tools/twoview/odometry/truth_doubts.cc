#include "odometry/truth_doubts.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/median.h"
#include "odometry/accuracy.h"
#include "odometry/truth_motion.h"

namespace cli {
namespace {

constexpr double kDegrees = 57.29577951308232;
constexpr double kClear = 3;        // how much smaller the errors of another reading must be
constexpr double kSameAngle = 0.2;  // errors of angles that fit, as a share of the angles
constexpr double kStretch_s = 0.5;  // over which turns are compared
constexpr double kLongest_s = 5;    // that a clock is looked for
constexpr size_t kFewest = 10, kMost = 400;  // stretches

struct Stretch {
  double begin_s, end_s, angle;
};

double turn_between(const Pose& a, const Pose& b) {
  return angle_of(product(transposed(a.R), b.R));
}

// The median time from one pose to the next; 0 without two poses.
double median_step(const Trajectory& path) {
  std::vector<double> steps;
  for (size_t i = 1; i < path.size(); ++i) steps.push_back(path[i].time_s - path[i - 1].time_s);
  return steps.empty() ? 0 : median_of(steps);
}

std::vector<Stretch> stretches_of(const Trajectory& path, double frame_s) {
  const size_t step = std::max<size_t>(1, static_cast<size_t>(std::lround(kStretch_s / frame_s)));
  if (path.size() <= step) return {};
  const size_t skip = std::max<size_t>(1, (path.size() - step) / kMost);
  std::vector<Stretch> stretches;
  for (size_t i = 0; i + step < path.size(); i += skip)
    stretches.push_back(
        {path[i].time_s, path[i + step].time_s, turn_between(path[i].pose, path[i + step].pose)});
  return stretches;
}

// The pose of the truth that is nearest in time, to within `nearest_s`.
const Pose* pose_at(const Trajectory& truth, double time_s, double nearest_s) {
  auto at = std::lower_bound(truth.begin(), truth.end(), time_s,
                             [](const TimedPose& pose, double t) { return pose.time_s < t; });
  if (at == truth.end() ||
      (at != truth.begin() && time_s - std::prev(at)->time_s < at->time_s - time_s)) {
    if (at == truth.begin()) return nullptr;
    --at;
  }
  return std::abs(at->time_s - time_s) <= nearest_s ? &at->pose : nullptr;
}

// How well the turns of the truth fit, if its times are later_s later than those of the frames.
struct Fit {
  size_t count = 0;
  double difference = 0, turn = 0;  // rms, radians
};
Fit fit_of(const std::vector<Stretch>& stretches, const Trajectory& truth, double later_s) {
  Fit fit;
  const double nearest_s = 0.51 * median_step(truth);  // there is always one, but at gaps
  for (const Stretch& stretch : stretches) {
    const Pose* const begin = pose_at(truth, stretch.begin_s + later_s, nearest_s);
    const Pose* const end = pose_at(truth, stretch.end_s + later_s, nearest_s);
    if (begin == nullptr || end == nullptr) continue;
    const double angle = turn_between(*begin, *end);
    fit.difference += (angle - stretch.angle) * (angle - stretch.angle);
    fit.turn += angle * angle;
    ++fit.count;
  }
  if (fit.count == 0) return fit;
  fit.difference = std::sqrt(fit.difference / static_cast<double>(fit.count));
  fit.turn = std::sqrt(fit.turn / static_cast<double>(fit.count));
  return fit;
}

bool is_clearly_better(const Fit& fit, const Fit& own, size_t num_stretches) {
  return fit.count >= std::max(kFewest, num_stretches / 2) &&
         kClear * fit.difference < own.difference && fit.difference < kSameAngle * fit.turn;
}

Trajectory earlier(Trajectory truth, double seconds) {
  for (TimedPose& at : truth) at.time_s -= seconds;
  return truth;
}

// The truth with the times of the frames, row for row; empty where it has not as many rows.
Trajectory row_for_row(const Trajectory& truth, const FrameClock& clock) {
  Trajectory made;
  if (clock.numbers.empty() || truth.size() != static_cast<size_t>(clock.numbers.back()) + 1)
    return made;
  for (size_t k = 0; k < clock.numbers.size(); ++k)
    made.push_back({clock.times_s[k], truth[static_cast<size_t>(clock.numbers[k])].pose});
  return made;
}

std::string clock_words(const Trajectory& estimate, const TruePoses& truth,
                        const FrameClock& clock) {
  const double frame_s = median_step(estimate);
  if (!(frame_s > 0)) return "";
  const std::vector<Stretch> stretches = stretches_of(estimate, frame_s);
  const Fit own = fit_of(stretches, truth.poses, 0);
  if (own.count < kFewest) return "";
  const auto ate = [&](const Trajectory& poses) { return accuracy_of(estimate, poses).ate_rmse; };
  const double own_ate = ate(truth.poses);
  Fit best = own;
  std::string words;
  const auto most = static_cast<int>(std::min(kLongest_s / frame_s, double{kMost}));
  for (int k = -most; k <= most; ++k) {
    const double later_s = k * frame_s;
    const Fit fit = fit_of(stretches, truth.poses, later_s);
    if (!is_clearly_better(fit, own, stretches.size()) || fit.difference >= best.difference ||
        ate(earlier(truth.poses, later_s)) > own_ate)
      continue;
    best = fit;
    char text[120];
    std::snprintf(text, sizeof text, "if its times are made %.3g s (%d frame%s) %s",
                  std::abs(later_s), std::abs(k), std::abs(k) == 1 ? "" : "s",
                  k > 0 ? "smaller" : "larger");
    words = text;
  }
  if (const Trajectory rows = row_for_row(truth.poses, clock); !rows.empty()) {
    const Fit fit = fit_of(stretches, rows, 0);
    if (is_clearly_better(fit, own, stretches.size()) && fit.difference < best.difference) {
      best = fit;
      words = "if its rows are those of the frames, one by one (--fps?)";
    }
  }
  if (words.empty()) return "";
  char text[320];
  std::snprintf(text, sizeof text,
                "the truth's turns differ from the path's by %.2g deg, and by %.2g deg %s: are the "
                "times of the frames and of the truth of one clock? The errors are those of the "
                "times as they stand",
                kDegrees * own.difference, kDegrees * best.difference, words.c_str());
  return text;
}

// Positions in degrees, with heights in metres, as metres to the east, to the north and upwards.
Trajectory in_metres(const Trajectory& truth, size_t idx_latitude, double up) {
  constexpr double kMetres = 111320;  // of a degree of latitude
  const Vector3 first = truth.front().pose.t;
  const double shrink = std::cos(first[idx_latitude] / kDegrees);
  Trajectory made = truth;
  for (TimedPose& at : made) {
    const Vector3 d = minus(at.pose.t, first);
    at.pose.t = {kMetres * shrink * d[1 - idx_latitude], kMetres * d[idx_latitude], up * d[2]};
  }
  return made;
}

std::string degrees_words(const Trajectory& estimate, const TruePoses& truth) {
  constexpr double kSmall = 0.1, kFar = 100;  // degrees that a path spans, and its place by these
  if (truth.poses.empty()) return "";
  double lowest[2] = {1e9, 1e9}, highest[2] = {-1e9, -1e9};
  for (const TimedPose& at : truth.poses)
    for (size_t k = 0; k < 2; ++k) {
      lowest[k] = std::min(lowest[k], at.pose.t[k]);
      highest[k] = std::max(highest[k], at.pose.t[k]);
    }
  const double span = std::max(highest[0] - lowest[0], highest[1] - lowest[1]);
  const auto farthest = [&](size_t k) { return std::max(-lowest[k], highest[k]); };
  if (!(span < kSmall && std::max(farthest(0), farthest(1)) > kFar * span)) return "";
  const auto share = [&](const Trajectory& poses) {
    const Accuracy accuracy = accuracy_of(estimate, poses);
    return accuracy.has_errors() ? accuracy.ate_rmse / accuracy.path_length : 1;
  };
  const double own = share(truth.poses);
  for (const size_t idx_latitude : {size_t{0}, size_t{1}})
    for (const double up : {1.0, -1.0}) {
      if (farthest(idx_latitude) > 90 || farthest(1 - idx_latitude) > 180) continue;
      const double other = share(in_metres(truth.poses, idx_latitude, up));
      if (!(kClear * other < own)) continue;
      char text[320];
      std::snprintf(text, sizeof text,
                    "the truth's positions seem to be %s in degrees: the path is off by %.2g %% of "
                    "them, and by %.2g %% of what they are in metres. Give metres to the east, to "
                    "the north and upwards",
                    idx_latitude == 0 ? "latitude and longitude" : "longitude and latitude",
                    100 * own, 100 * other);
      return text;
    }
  return "";
}

// The truth's positions as their mirror image.
std::string mirror_words(const Trajectory& estimate, const TruePoses& truth) {
  Trajectory mirrored = truth.poses;
  for (TimedPose& at : mirrored) at.pose.t[0] = -at.pose.t[0];
  const Accuracy own = accuracy_of(estimate, truth.poses), other = accuracy_of(estimate, mirrored);
  if (!own.has_errors() || !(kClear * other.ate_rmse < own.ate_rmse)) return "";
  char text[240];
  std::snprintf(text, sizeof text,
                "the truth is the path's mirror image: the path is off by %.2g %% of it, and by "
                "%.2g %% of its mirror image. Are its axes left-handed (one axis the other way)?",
                100 * own.ate_rmse / own.path_length, 100 * other.ate_rmse / other.path_length);
  return text;
}

}  // namespace

std::vector<std::string> truth_doubts(const Trajectory& estimate, const TruePoses& truth,
                                      const FrameClock& clock) {
  std::vector<std::string> doubts;
  for (const std::string& words : {clock_words(estimate, truth, clock),
                                   degrees_words(estimate, truth), mirror_words(estimate, truth)})
    if (!words.empty()) doubts.push_back(words);
  if (!doubts.empty()) return doubts;  // which explain the errors already
  return motion_doubts(estimate, truth.poses);
}

}  // namespace cli
