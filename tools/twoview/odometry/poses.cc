#include "odometry/poses.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/error.h"
#include "base/output.h"
#include "odometry/numbers.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 28;
constexpr size_t kTum = 8, kKitti = 12, kEuroc = 8;

[[noreturn]] void refuse_line(const std::string& file, int line, const std::string& why) {
  throw BadInput(file + ": line " + std::to_string(line) + " " + why);
}

Pose pose_of_12(const double* m) {
  return {{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[3], m[7], m[11]}};
}

// The nearest rotation to a matrix that is one but for the rounding of its printed numbers.
Matrix3 orthonormal(const Matrix3& m) {
  const std::array<double, 4> q = quaternion_of(m);
  return rotation_of_quaternion(q[0], q[1], q[2], q[3]);
}

std::vector<double> numbers_in(const std::string& file, const TextLine& line) {
  std::vector<double> numbers;
  for (const std::string_view word : words_of(line.text, ",")) {
    double value = 0;
    if (!to_number(word, value))
      refuse_line(file, line.number, "has '" + std::string(word) + "', which is no finite number");
    numbers.push_back(value);
  }
  return numbers;
}

}  // namespace

Pose composed(const Pose& a, const Pose& b) {
  Pose pose{product(a.R, b.R), applied(a.R, b.t)};
  for (size_t k = 0; k < 3; ++k) pose.t[k] += a.t[k];
  return pose;
}

Pose inverse(const Pose& pose) {
  Pose result{transposed(pose.R), {}};
  const Vector3 t = applied(result.R, pose.t);
  for (size_t k = 0; k < 3; ++k) result.t[k] = -t[k];
  return result;
}

std::array<double, 4> quaternion_of(const Matrix3& m) {
  const double trace = m[0] + m[4] + m[8];
  const double squares[4] = {1 + trace, 1 + 2 * m[0] - trace, 1 + 2 * m[4] - trace,
                             1 + 2 * m[8] - trace};
  const size_t largest = static_cast<size_t>(std::max_element(squares, squares + 4) - squares);
  const double x = m[7] - m[5], y = m[2] - m[6], z = m[3] - m[1];
  const double xy = m[1] + m[3], xz = m[2] + m[6], yz = m[5] + m[7];
  const double rows[4][4] = {{squares[0], x, y, z},
                             {x, squares[1], xy, xz},
                             {y, xy, squares[2], yz},
                             {z, xz, yz, squares[3]}};
  const double* q = rows[largest];
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double s = (q[0] < 0 ? -1 : 1) / length;
  return {q[1] * s + 0.0, q[2] * s + 0.0, q[3] * s + 0.0, q[0] * s + 0.0};
}

Matrix3 rotation_of_quaternion(double x, double y, double z, double w) {
  const double s = 2 / (x * x + y * y + z * z + w * w);
  return {1 - s * (y * y + z * z), s * (x * y - w * z),     s * (x * z + w * y),
          s * (x * y + w * z),     1 - s * (x * x + z * z), s * (y * z - w * x),
          s * (x * z - w * y),     s * (y * z + w * x),     1 - s * (x * x + y * y)};
}

double angle_of(const Matrix3& R) {
  const std::array<double, 4> q = quaternion_of(R);
  return 2 * std::atan2(std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]), q[3]);
}

std::string tum_line(double time_s, const Pose& pose) {
  const std::array<double, 4> q = quaternion_of(pose.R);
  char line[320];
  std::snprintf(line, sizeof line, "%.9f %.9g %.9g %.9g %.9f %.9f %.9f %.9f\n", time_s,
                pose.t[0] + 0.0, pose.t[1] + 0.0, pose.t[2] + 0.0, q[0], q[1], q[2], q[3]);
  return line;
}

Trajectory load_trajectory(const std::string& file, const std::vector<double>& frame_times,
                           const std::optional<std::array<double, 12>>& body_from_camera) {
  const std::string text = read_file(file, kMaxFileBytes);
  const std::vector<TextLine> lines = lines_of(text);
  if (lines.empty()) throw BadInput(file + ": no pose in it");
  const bool is_euroc = lines[0].text.find(',') != std::string_view::npos;
  const size_t count = words_of(lines[0].text, ",").size();
  const bool is_kitti = !is_euroc && count == kKitti;
  const bool fits = is_euroc ? count >= kEuroc : is_kitti || count == kTum;
  if (!fits)
    refuse_line(file, lines[0].number,
                "has " + std::to_string(count) +
                    " numbers: neither TUM's 8, EuRoC's with commas, nor KITTI's 12");
  if (is_kitti && frame_times.empty())
    throw BadInput(file + " has KITTI's poses without times, and the frames' times are not known");
  Trajectory trajectory;
  for (const TextLine& line : lines) {
    const std::vector<double> n = numbers_in(file, line);
    if (n.size() != count)
      refuse_line(file, line.number,
                  "has " + std::to_string(n.size()) + " numbers, not " + std::to_string(count));
    TimedPose at;
    if (is_kitti) {
      const size_t idx = trajectory.size();
      if (idx >= frame_times.size()) break;  // the poses of frames beyond those that are here
      at = {frame_times[idx], pose_of_12(n.data())};
      at.pose.R = orthonormal(at.pose.R);
    } else {
      const double* q = &n[4];
      if (!(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 1e-12))
        refuse_line(file, line.number, "has a quaternion of length 0");
      at.time_s = is_euroc ? n[0] * 1e-9 : n[0];
      at.pose.t = {n[1], n[2], n[3]};
      at.pose.R = is_euroc ? rotation_of_quaternion(q[1], q[2], q[3], q[0])
                           : rotation_of_quaternion(q[0], q[1], q[2], q[3]);
      if (is_euroc && body_from_camera)
        at.pose = composed(at.pose, pose_of_12(body_from_camera->data()));
    }
    if (!trajectory.empty() && !(at.time_s > trajectory.back().time_s))
      refuse_line(file, line.number, "has a time that is not later than that of the line before");
    trajectory.push_back(at);
  }
  return trajectory;
}

}  // namespace cli
