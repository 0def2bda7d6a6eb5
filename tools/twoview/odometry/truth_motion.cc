#include "odometry/truth_motion.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/core.hpp>
#include <optional>

#include "base/median.h"
#include "odometry/accuracy.h"

namespace cli {
namespace {

constexpr size_t kFewest = 10;    // compared poses
constexpr double kClear = 3;      // how much smaller the errors of another reading must be
constexpr double kStands = 0.05;  // of the path's length, that it moves while the truth stands
constexpr double kJump = 0.01;    // of the path's length, in one step that it does not make
constexpr double kLonger = 1.5;   // the truth's way over the path's

// The positions of compared poses, and the steps from one to the next: those of the path are in
// the truth's unit, by the ratio that half of the steps exceed, so that a few wrong poses do not
// change it.
struct Steps {
  std::vector<double> times_s;
  std::vector<Vector3> path, truth;
  std::vector<double> own, given;  // lengths; one fewer than positions
  double length = 0;               // of all own steps
  double scale = 0;                // from the path's unit to the truth's; 0: neither moves
};

Steps steps_of(const Trajectory& estimate, const Trajectory& truth,
               const std::vector<Association>& pairs) {
  Steps steps;
  std::vector<double> ratios;
  for (const Association& pair : pairs) {
    steps.times_s.push_back(estimate[pair.idx_estimate].time_s);
    steps.path.push_back(estimate[pair.idx_estimate].pose.t);
    steps.truth.push_back(truth[pair.idx_truth].pose.t);
    const size_t at = steps.path.size() - 1;
    if (at == 0) continue;
    steps.own.push_back(norm(minus(steps.path[at], steps.path[at - 1])));
    steps.given.push_back(norm(minus(steps.truth[at], steps.truth[at - 1])));
    if (steps.own.back() > 0 && steps.given.back() > 0)
      ratios.push_back(steps.given.back() / steps.own.back());
  }
  steps.scale = ratios.empty() ? 0 : median_of(ratios);
  for (double& step : steps.own) steps.length += step *= steps.scale;
  for (Vector3& position : steps.path)
    for (double& value : position) value *= steps.scale;
  return steps;
}

// What is wrong where positions of the truth are exactly equal to the one before although the path
// moves.
std::string standing_words(const Steps& steps) {
  double moved = 0;
  size_t num_poses = 0, first = 0;
  for (size_t begin = 0, end = 0; begin < steps.given.size(); begin = end + 1) {
    for (end = begin; end < steps.given.size() && steps.given[end] == 0;) ++end;
    if (end == begin) continue;
    if (num_poses == 0) first = begin;
    num_poses += end - begin;
    moved += norm(minus(steps.path[end], steps.path[begin]));
  }
  if (!(moved > kStands * steps.length)) return "";
  char text[300];
  std::snprintf(text, sizeof text,
                "the truth stands in %zu of %zu poses, first at %.4g s, while the path moves (%.2g "
                "%% of its length): poses that were held or not recorded, or too few digits. Its "
                "errors are in those of the path",
                num_poses, steps.path.size(), steps.times_s[first], 100 * moved / steps.length);
  return text;
}

// What is wrong where some steps of the truth are far longer than their neighbours and than the
// path's.
std::string jump_words(const Steps& steps) {
  constexpr size_t kAround = 5;
  size_t count = 0, longest = 0;
  for (size_t i = 0; i < steps.given.size(); ++i) {
    const size_t begin = i < kAround ? 0 : i - kAround;
    const size_t end = std::min(steps.given.size(), i + kAround + 1);
    const double around = median_of({steps.given.begin() + static_cast<std::ptrdiff_t>(begin),
                                     steps.given.begin() + static_cast<std::ptrdiff_t>(end)});
    if (steps.given[i] < kClear * std::max(around, steps.own[i]) ||
        steps.given[i] - steps.own[i] < kJump * steps.length)
      continue;
    if (count++ == 0 || steps.given[i] > steps.given[longest]) longest = i;
  }
  if (count == 0) return "";
  char text[300];
  std::snprintf(text, sizeof text,
                "the truth jumps in %zu of %zu steps, farthest between %.4g and %.4g s: by %.3g, "
                "where the path moves by %.2g of its unit. Its errors are in those of the path",
                count, steps.given.size(), steps.times_s[longest], steps.times_s[longest + 1],
                steps.given[longest], steps.own[longest]);
  return text;
}

// What is wrong where the truth's path is far longer than the path that fits it best, as it is with
// noise.
std::string noise_words(const Steps& steps, const Accuracy& accuracy) {
  double own = 0;
  for (size_t i = 1; i < steps.path.size(); ++i)
    own += norm(minus(steps.path[i], steps.path[i - 1]));
  own *= accuracy.similarity.scale / steps.scale;
  if (!(accuracy.path_length > kLonger * own)) return "";
  char text[300];
  std::snprintf(text, sizeof text,
                "the truth's way from pose to pose is %.2g times as long as the path's: noise of "
                "the truth's positions? Its errors are in those of the path, and percentages are "
                "of the longer way",
                accuracy.path_length / own);
  return text;
}

Vector3 moved(const Similarity& fit, const Vector3& x) {
  Vector3 y = applied(fit.R, x);
  for (size_t k = 0; k < 3; ++k) y[k] = fit.scale * y[k] + fit.t[k];
  return y;
}

double rms_of(const Similarity& fit, const std::vector<Vector3>& from,
              const std::vector<Vector3>& to) {
  double sum = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    const Vector3 d = minus(moved(fit, from[i]), to[i]);
    sum += dot(d, d);
  }
  return std::sqrt(sum / static_cast<double>(from.size()));
}

// What is wrong where a coordinate of the truth is the same in all poses, and the path fits far
// better without it. The missing coordinate is taken from the fitted path, in turn with the fit.
std::string plane_words(const Steps& steps, const Accuracy& accuracy) {
  constexpr int kRounds = 50;
  for (size_t k = 0; k < 3; ++k) {
    const auto is_same = [&](const Vector3& at) { return at[k] == steps.truth[0][k]; };
    if (!std::all_of(steps.truth.begin(), steps.truth.end(), is_same)) continue;
    std::vector<Vector3> to = steps.truth;
    Similarity fit = fitted(steps.path, to, true);
    for (int round = 0; round < kRounds; ++round) {
      for (size_t i = 0; i < to.size(); ++i) to[i][k] = moved(fit, steps.path[i])[k];
      fit = fitted(steps.path, to, true);
    }
    const double rest = rms_of(fit, steps.path, to);
    if (!(kClear * rest < accuracy.ate_rmse)) return "";
    char text[300];
    std::snprintf(text, sizeof text,
                  "the truth's %c is %.6g in all poses: the path is off by %.2g %% with it, and by "
                  "%.2g %% of the two other coordinates alone. Was it not recorded?",
                  "xyz"[k], steps.truth[0][k], 100 * accuracy.ate_rmse / accuracy.path_length,
                  100 * rest / accuracy.path_length);
    return text;
  }
  return "";
}

// The lever and a shift that explain best what the similarity leaves of truth = fit(path + R
// lever).
std::optional<Vector3> lever_of(const std::vector<Matrix3>& R, const std::vector<Vector3>& path,
                                const std::vector<Vector3>& truth, const Similarity& fit) {
  cv::Matx66d normal = cv::Matx66d::zeros();
  cv::Matx61d side = cv::Matx61d::zeros(), found;
  for (size_t i = 0; i < path.size(); ++i) {
    const Matrix3 turn = product(fit.R, R[i]);
    const Vector3 left = minus(truth[i], moved(fit, path[i]));
    for (size_t k = 0; k < 3; ++k) {
      cv::Matx16d row = cv::Matx16d::zeros();
      for (size_t c = 0; c < 3; ++c) row(static_cast<int>(c)) = fit.scale * turn[3 * k + c];
      row(static_cast<int>(3 + k)) = 1;
      normal += row.t() * row;
      side += row.t() * left[k];
    }
  }
  if (!cv::solve(normal, side, found, cv::DECOMP_CHOLESKY)) return {};  // a path without turns
  return Vector3{found(0), found(1), found(2)};
}

// A truth of another point of the vehicle, for which lever and similarity are found in turn.
std::string lever_words(const Trajectory& estimate, const Steps& steps, const Accuracy& accuracy) {
  constexpr int kRounds = 100;
  std::vector<Matrix3> R;
  for (const Association& pair : accuracy.pairs) R.push_back(estimate[pair.idx_estimate].pose.R);
  std::vector<Vector3> points = steps.path;
  Similarity fit = fitted(points, steps.truth, true);
  Vector3 lever{0, 0, 0};
  for (int round = 0; round < kRounds; ++round) {
    const std::optional<Vector3> found = lever_of(R, steps.path, steps.truth, fit);
    if (!found) return "";
    lever = *found;
    for (size_t i = 0; i < points.size(); ++i) {
      const Vector3 arm = applied(R[i], lever);
      for (size_t k = 0; k < 3; ++k) points[i][k] = steps.path[i][k] + arm[k];
    }
    fit = fitted(points, steps.truth, true);
  }
  const double rest = rms_of(fit, points, steps.truth);
  if (!(kClear * rest < accuracy.ate_rmse)) return "";
  char text[360];
  std::snprintf(text, sizeof text,
                "the truth seems to be of another point than the camera: the path is off by %.2g "
                "%% of it, and by %.2g %% of a point %.3g of its units away (right %.3g, down "
                "%.3g, ahead %.3g). Give the camera's own poses",
                100 * accuracy.ate_rmse / accuracy.path_length, 100 * rest / accuracy.path_length,
                fit.scale * norm(lever), fit.scale * lever[0], fit.scale * lever[1],
                fit.scale * lever[2]);
  return text;
}

}  // namespace

std::vector<std::string> motion_doubts(const Trajectory& estimate, const Trajectory& truth) {
  const Accuracy accuracy = accuracy_of(estimate, truth);
  if (accuracy.num_poses < kFewest || !accuracy.has_errors()) return {};
  const Steps steps = steps_of(estimate, truth, accuracy.pairs);
  if (!(steps.scale > 0)) return {};
  std::vector<std::string> doubts;
  const auto add = [&](const std::string& words) {
    if (!words.empty()) doubts.push_back(words);
    return !words.empty();
  };
  // A truth that stands still jumps afterwards, and one that jumps has a longer path: only the
  // first of these faults is named.
  if (!add(standing_words(steps)) && !add(jump_words(steps))) add(noise_words(steps, accuracy));
  if (!add(plane_words(steps, accuracy))) add(lever_words(estimate, steps, accuracy));
  return doubts;
}

}  // namespace cli
