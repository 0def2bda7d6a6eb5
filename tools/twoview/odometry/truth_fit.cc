#include "odometry/truth_fit.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <map>
#include <set>

#include "files/natural_order.h"
#include "odometry/accuracy.h"

namespace cli {
namespace {

constexpr double kDegrees = 57.29577951308232;
constexpr size_t kFewest = 3;  // poses of which a comparison is made

// How many poses have a pose of the other trajectory near in time: counted in each trajectory, and
// the smaller count.
size_t num_met(const Trajectory& estimate, const Trajectory& truth) {
  std::set<size_t> own, others;
  for (const Association& pair : associated(estimate, truth)) {
    own.insert(pair.idx_estimate);
    others.insert(pair.idx_truth);
  }
  return std::min(own.size(), others.size());
}

// The most pairs of poses that are possible: within the times that both trajectories cover, the
// number of poses of the one that has fewer.
size_t num_that_could_meet(const Trajectory& a, const Trajectory& b) {
  const double begin = std::max(a.front().time_s, b.front().time_s);
  const double end = std::min(a.back().time_s, b.back().time_s);
  const auto within = [&](const TimedPose& pose) {
    return pose.time_s >= begin && pose.time_s <= end;
  };
  return static_cast<size_t>(std::min(std::count_if(a.begin(), a.end(), within),
                                      std::count_if(b.begin(), b.end(), within)));
}

// A truth with its times read in another way.
struct Reading {
  std::string words;
  double unit_s = 1;
  Trajectory poses;
};

std::vector<Reading> readings_of_units(const TruePoses& truth, double film_start_s) {
  struct Unit {
    const char* words;
    double unit_s, start_s;
  };
  const Unit units[] = {{"seconds", 1, 0},
                        {"milliseconds", 1e-3, 0},
                        {"microseconds", 1e-6, 0},
                        {"nanoseconds", 1e-9, 0},
                        {"seconds of the film's own clock", 1, film_start_s}};
  std::vector<Reading> readings;
  for (const Unit& unit : units) {
    Reading reading{unit.words, unit.unit_s, truth.poses};
    for (TimedPose& at : reading.poses)
      at.time_s = at.time_s / truth.unit_s * unit.unit_s - unit.start_s;
    readings.push_back(std::move(reading));
  }
  return readings;
}

// Empty where the truth's times are no whole numbers from 0 on.
std::vector<Reading> readings_of_numbers(const TruePoses& truth, const FrameClock& clock) {
  constexpr double kMost = 1e9;
  std::vector<int64_t> counted;
  for (const TimedPose& at : truth.poses) {
    const double number = std::round(at.time_s / truth.unit_s);
    if (!(number >= 0 && number < kMost) || std::abs(at.time_s / truth.unit_s - number) > 1e-6)
      return {};
    counted.push_back(static_cast<int64_t>(number));
  }
  const auto reading = [&](const std::string& words, const std::vector<int64_t>& numbers) {
    std::map<int64_t, double> time_of;
    for (size_t k = 0; k < std::min(numbers.size(), clock.times_s.size()); ++k)
      time_of.emplace(numbers[k], clock.times_s[k]);
    Reading made{words, truth.unit_s, {}};
    for (size_t k = 0; k < counted.size(); ++k)
      if (const auto at = time_of.find(counted[k]); at != time_of.end())
        made.poses.push_back({at->second, truth.poses[k].pose});
    return made;
  };
  std::vector<int64_t> from_0(clock.numbers.begin(), clock.numbers.end()), from_1 = from_0;
  for (int64_t& number : from_1) ++number;
  // A truth that begins with 1 counts from 1. The numbers in names are the surer ones: they are
  // tried first, and of readings that fit equally well the first one counts.
  std::vector<Reading> readings;
  if (const auto in_names = counters_of(clock.names); !in_names.empty())
    readings.push_back(reading("the numbers in the pictures' names", in_names));
  if (counted.front() == 1)
    readings.push_back(reading("the frames' numbers, counted from 1", from_1));
  readings.push_back(reading("the frames' numbers, counted from 0", from_0));
  return readings;
}

// The rotation of the same four numbers in the other order of a quaternion.
Matrix3 in_other_order(const Matrix3& R, TruePoses::Order order) {
  const auto [x, y, z, w] = quaternion_of(R);
  return order == TruePoses::Order::kScalarLast ? rotation_of_quaternion(y, z, w, x)
                                                : rotation_of_quaternion(w, x, y, z);
}

}  // namespace

std::string fit_times(const Trajectory& estimate, TruePoses& truth, const FrameClock& clock) {
  if (truth.unit_s == 0 || estimate.size() < kFewest || truth.poses.size() < kFewest) return "";
  const size_t met = num_met(estimate, truth.poses);
  const size_t fewer = std::min(estimate.size(), truth.poses.size());
  if (2 * met >= fewer && met >= kFewest) return "";
  std::vector<Reading> readings;
  if (met < kFewest) readings = readings_of_units(truth, clock.film_start_s);
  for (Reading& reading : readings_of_numbers(truth, clock)) readings.push_back(std::move(reading));
  Reading* best = nullptr;
  size_t most = std::max(kFewest, 2 * met) - 1;
  for (Reading& reading : readings) {
    const size_t count = num_met(estimate, reading.poses);
    if (count <= most) continue;
    most = count;
    best = &reading;
  }
  if (best != nullptr) {
    truth.poses = std::move(best->poses);
    truth.unit_s = best->unit_s;
    return "the truth's times were taken as " + best->words + ": then " + std::to_string(most) +
           " of its poses have a time of the path";
  }
  const size_t could = num_that_could_meet(estimate, truth.poses);
  char text[240];
  if (met >= kFewest && 2 * met >= could)
    std::snprintf(text, sizeof text,
                  "the truth is of %.6g to %.6g s, the path of %.6g to %.6g s: only %zu of its %zu "
                  "poses are compared (a clock of another rate, or numbers in place of times?)",
                  truth.poses.front().time_s, truth.poses.back().time_s, estimate.front().time_s,
                  estimate.back().time_s, met, estimate.size());
  else if (met >= kFewest)
    std::snprintf(text, sizeof text,
                  "only %zu poses of the truth have a time of the path (to 0.01 s), of %zu within "
                  "the time of both: are the times of one clock?",
                  met, could);
  else
    std::snprintf(
        text, sizeof text,
        "the truth's times, %.15g to %.15g s, and the path's, %.15g to %.15g s, do not meet "
        "(to 0.01 s), in s, ms, us or ns: are they of one clock?",
        truth.poses.front().time_s, truth.poses.back().time_s, estimate.front().time_s,
        estimate.back().time_s);
  return text;
}

namespace {

// A line where all of the truth's rotations are one and the same and the path turns.
std::string no_turn_words(const Trajectory& estimate, const Trajectory& truth,
                          const std::vector<Association>& pairs) {
  constexpr double kSame = 1e-6, kTurns = 2 / kDegrees;  // radians
  double own = 0, given = 0;
  for (const Association& pair : pairs) {
    const auto turn = [](const Trajectory& path, size_t from, size_t to) {
      return angle_of(product(transposed(path[from].pose.R), path[to].pose.R));
    };
    own = std::max(own, turn(estimate, pairs[0].idx_estimate, pair.idx_estimate));
    given = std::max(given, turn(truth, pairs[0].idx_truth, pair.idx_truth));
  }
  if (pairs.size() < kFewest || given > kSame || own < kTurns) return "";
  char text[240];
  std::snprintf(text, sizeof text,
                "the truth's rotations are one and the same in all %zu poses, while the path turns "
                "by %.2g deg: they were not recorded, and rpe_rotation_deg is no error of the path",
                pairs.size(), kDegrees * own);
  return text;
}

}  // namespace

std::string rotation_words(const Trajectory& estimate, const TruePoses& truth) {
  // Turns are compared over a twentieth of the path, over which they are well above their errors.
  constexpr size_t kSteps = 20;
  constexpr double kSameAngle = 0.2, kOtherAxis = 0.5;  // errors as shares of the turns
  constexpr double kClear = 3;  // how much smaller the errors of the right order must be
  const std::vector<Association> pairs = associated(estimate, truth.poses);
  if (const std::string words = no_turn_words(estimate, truth.poses, pairs); !words.empty())
    return words;
  const size_t step = std::max<size_t>(1, pairs.size() / kSteps);
  double turn = 0, of_angle = 0, of_axis = 0, of_other = 0;
  size_t count = 0;
  for (size_t i = 0; i + step < pairs.size(); ++i, ++count) {
    const auto turn_of = [&](const Matrix3& a, const Matrix3& b) {
      return product(transposed(a), b);
    };
    const Matrix3 own = turn_of(estimate[pairs[i].idx_estimate].pose.R,
                                estimate[pairs[i + step].idx_estimate].pose.R);
    const Matrix3& from = truth.poses[pairs[i].idx_truth].pose.R;
    const Matrix3& to = truth.poses[pairs[i + step].idx_truth].pose.R;
    const Matrix3 right = turn_of(from, to);
    const auto add = [](double& sum, double angle) { sum += angle * angle; };
    add(turn, angle_of(right));
    add(of_angle, angle_of(right) - angle_of(own));
    add(of_axis, angle_of(product(transposed(right), own)));
    const Matrix3 other =
        turn_of(in_other_order(from, truth.order), in_other_order(to, truth.order));
    add(of_other, angle_of(product(transposed(other), own)));
  }
  if (count < kSteps / 2) return "";
  const auto n = static_cast<double>(count);
  turn = std::sqrt(turn / n);
  of_angle = std::sqrt(of_angle / n);
  of_axis = std::sqrt(of_axis / n);
  of_other = std::sqrt(of_other / n);
  if (!(of_angle < kSameAngle * turn && of_axis > kOtherAxis * turn)) return "";
  char text[400];
  const bool is_other = truth.order != TruePoses::Order::kKnown && kClear * of_other < of_axis;
  if (is_other)
    std::snprintf(text, sizeof text,
                  "the truth's quaternions, read as %s, turn about other axes than the path (%.2g "
                  "deg off), and as %s they fit (%.2g deg): a line of names above the poses says "
                  "which, such as # timestamp tx ty tz %s; rpe_rotation_deg is of the first",
                  truth.order == TruePoses::Order::kScalarLast ? "qx qy qz qw" : "qw qx qy qz",
                  kDegrees * of_axis,
                  truth.order == TruePoses::Order::kScalarLast ? "qw qx qy qz" : "qx qy qz qw",
                  kDegrees * of_other,
                  truth.order == TruePoses::Order::kScalarLast ? "qw qx qy qz" : "qx qy qz qw");
  else
    std::snprintf(text, sizeof text,
                  "the truth turns by the path's angles (to %.2g deg), but about other axes (%.2g "
                  "deg off), which rpe_rotation_deg has in it: are its rotations those of another "
                  "body than the camera, camera_from_world, or of left-handed axes?",
                  kDegrees * of_angle, kDegrees * of_axis);
  return text;
}

std::vector<PoseReading> other_readings(const std::vector<Pose>& poses, TruePoses::Order order) {
  std::vector<PoseReading> readings;
  const auto add = [&](const std::string& words, const auto& read) {
    readings.push_back({words, {}});
    for (const Pose& pose : poses) readings.back().poses.push_back(read(pose));
  };
  const auto with_opengl_axes = [](const Pose& pose) {
    return Pose{product(pose.R, {1, 0, 0, 0, -1, 0, 0, 0, -1}), pose.t};
  };
  if (order != TruePoses::Order::kKnown) {
    const bool is_last = order == TruePoses::Order::kScalarLast;
    add(is_last ? "quaternions with w first: put a line above the poses, # timestamp tx ty tz qw "
                  "qx qy qz"
                : "quaternions with w last: put a line above the poses, # timestamp tx ty tz qx qy "
                  "qz qw",
        [&](const Pose& pose) {
          return Pose{in_other_order(pose.R, order), pose.t};
        });
  }
  add("camera_from_world: write the inverse poses", inverse);
  add("with OpenGL's axes (y up, z backwards): change the sign of the second and the third column "
      "of each rotation",
      with_opengl_axes);
  add("camera_from_world with OpenGL's axes (y up, z backwards): write the inverse poses with the "
      "sign of the second and the third column of each rotation changed",
      [&](const Pose& pose) { return with_opengl_axes(inverse(pose)); });
  for (const size_t axis : {size_t{1}, size_t{0}, size_t{2}}) {
    const auto mirrored = [axis](const Pose& pose) {
      Matrix3 flip{1, 0, 0, 0, 1, 0, 0, 0, 1};
      flip[4 * axis] = -1;
      return Pose{product(product(flip, pose.R), flip), applied(flip, pose.t)};
    };
    add(std::string("of left-handed axes, ") + "xyz"[axis] + " the other way" +
            (axis == 1 ? " (Unity's)" : "") + ": change the signs of " + "xyz"[axis] +
            " of the positions and of the two other quaternion components but w",
        mirrored);
  }
  return readings;
}

}  // namespace cli
