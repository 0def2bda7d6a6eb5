#include "odometry/poses.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>

#include "base/error.h"
#include "base/median.h"
#include "base/output.h"
#include "odometry/numbers.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 28;
constexpr size_t kTum = 8, kKitti = 12, kKitti4x4 = 16;
constexpr const char* kSeparators = ",;";
constexpr double kUnitError = 0.1;  // by how much a quaternion's length may differ from 1

[[noreturn]] void refuse_line(const std::string& file, int line, const std::string& why) {
  throw BadInput(file + ": line " + std::to_string(line) + " " + why);
}

// Whether a pose is exactly that of the origin.
bool is_origin(const Pose& pose) {
  return pose.t == Vector3{0, 0, 0} && pose.R == Matrix3{1, 0, 0, 0, 1, 0, 0, 0, 1};
}

// Leaves out the poses that are marked, where the step to them is no step of the path: a motion
// capture writes zeros where it sees no body. A path that begins at the origin keeps its pose.
void leave_out_zeros(const std::vector<bool>& is_zero, TruePoses& truth) {
  constexpr double kFar = 10;  // median steps of the path
  Trajectory& poses = truth.poses;
  std::vector<double> steps;
  double nearest = HUGE_VAL;  // of the steps to a pose that is zero
  for (size_t i = 1; i < poses.size(); ++i) {
    if (is_zero[i] && is_zero[i - 1]) continue;
    const double step = norm(minus(poses[i].pose.t, poses[i - 1].pose.t));
    if (is_zero[i] || is_zero[i - 1])
      nearest = std::min(nearest, step);
    else
      steps.push_back(step);
  }
  if (steps.empty() || nearest == HUGE_VAL) return;
  const double usual = median_of(steps);
  if (!(usual > 0 && nearest > kFar * usual)) return;
  Trajectory kept;
  for (size_t i = 0; i < poses.size(); ++i)
    if (!is_zero[i]) kept.push_back(poses[i]);
  truth.notes.push_back("the truth: " + std::to_string(poses.size() - kept.size()) + " of " +
                        std::to_string(poses.size()) +
                        " poses are exactly 0 among others that are far from it, as a motion "
                        "capture writes them where it sees nothing, and were left out");
  poses = std::move(kept);
}

std::string count_words(size_t num_poses, size_t num_frames) {
  return "the truth has " + std::to_string(num_poses) + " poses without times, but there are " +
         std::to_string(num_frames) +
         " frames: pose k was taken as that of frame k, from the first on";
}

Pose pose_of_12(const double* m) {
  return {{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[3], m[7], m[11]}};
}

std::vector<double> numbers_in(const std::string& file, const TextLine& line) {
  std::vector<double> numbers;
  for (const std::string_view word : words_of(line.text, kSeparators)) {
    double value = 0;
    if (!to_number(word, value))
      refuse_line(file, line.number, "has '" + std::string(word) + "', which is no finite number");
    numbers.push_back(value);
  }
  return numbers;
}

// How the numbers of a line make a pose.
struct Layout {
  size_t count = 0;  // numbers of a line
  bool is_matrix = false, is_body = false;
  double unit_s = 1;
  std::array<size_t, 8> at{0, 1, 2, 3, 4, 5, 6, 7};  // of time, x y z, qx qy qz qw
};

const std::array<std::vector<std::string>, 8> kNames = {{
    {"timestamp", "time", "t", "stamp", "sec", "secs", "seconds"},
    {"tx", "x", "px", "p_x", "pos_x", "position_x", "p_rs_r_x"},
    {"ty", "y", "py", "p_y", "pos_y", "position_y", "p_rs_r_y"},
    {"tz", "z", "pz", "p_z", "pos_z", "position_z", "p_rs_r_z"},
    {"qx", "q_x", "quat_x", "rot_x", "orientation_x", "q_rs_x"},
    {"qy", "q_y", "quat_y", "rot_y", "orientation_y", "q_rs_y"},
    {"qz", "q_z", "quat_z", "rot_z", "orientation_z", "q_rs_z"},
    {"qw", "q_w", "quat_w", "rot_w", "orientation_w", "q_rs_w"},
}};
struct Unit {
  const char* name;
  double seconds;
};
constexpr Unit kUnits[] = {{"s", 1}, {"ms", 1e-3}, {"us", 1e-6}, {"ns", 1e-9}};

// A column's name in small letters, without its unit in brackets or behind "_", which goes to
// `unit`.
std::string plain_name(std::string_view word, std::string& unit) {
  std::string name;
  for (const char c : word)
    if (c != '"' && c != '#' && c != '\'')
      name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  unit.clear();
  if (const size_t open = name.find_first_of("[("); open != name.npos) {
    unit = name.substr(open + 1, name.find_first_of("])", open) - open - 1);
    name.resize(open);
  }
  while (!name.empty() && (name.back() == ' ' || name.back() == '_')) name.pop_back();
  while (!name.empty() && name.front() == ' ') name.erase(0, 1);
  for (const Unit& known : kUnits) {
    const std::string tail = std::string("_") + known.name;
    if (name.size() <= tail.size() || name.substr(name.size() - tail.size()) != tail) continue;
    unit = known.name;
    name.resize(name.size() - tail.size());
    break;
  }
  return name;
}

// The layout by a line of names.
Layout layout_of_names(const std::string& file, const TextLine& line) {
  std::vector<std::string> words;
  const bool has_separators = line.text.find_first_of(kSeparators) != std::string_view::npos;
  std::string_view rest = line.text;
  if (has_separators) {  // a name may hold blanks
    for (size_t end = 0; end != rest.npos; rest.remove_prefix(std::min(end + 1, rest.size()))) {
      end = rest.find_first_of(kSeparators);
      words.emplace_back(rest.substr(0, end));
      if (end == rest.npos) break;
    }
  } else {
    for (const std::string_view word : words_of(rest)) words.emplace_back(word);
  }
  Layout layout;
  layout.count = words.size();
  std::array<bool, 8> found{};
  for (size_t k = 0; k < words.size(); ++k) {
    std::string unit;
    const std::string name = plain_name(words[k], unit);
    for (size_t column = 0; column < 8; ++column) {
      const auto& names = kNames[column];
      if (found[column] || std::find(names.begin(), names.end(), name) == names.end()) continue;
      found[column] = true;
      layout.at[column] = k;
      if (column > 0) continue;
      for (const Unit& known : kUnits)
        if (unit == known.name) layout.unit_s = known.seconds;
    }
  }
  for (size_t column = 0; column < 8; ++column)
    if (!found[column])
      refuse_line(file, line.number,
                  "names columns, but none is " + kNames[column][0] + ": " +
                      std::string(line.text.substr(0, 80)));
  return layout;
}

// The columns by a comment above the poses, such as "# timestamp tx ty tz qw qx qy qz"; none where
// it does not name each of them among as many words as a line has numbers.
std::optional<std::array<size_t, 8>> columns_of_comment(std::string_view comment, size_t count) {
  std::vector<std::string> names;
  for (const std::string_view word : words_of(comment, kSeparators)) {
    std::string unit;
    std::string name = plain_name(word, unit);
    if (!name.empty()) names.push_back(std::move(name));  // units in brackets are dropped
  }
  std::array<size_t, 8> at{};
  for (size_t column = 0; column < 8; ++column) {
    const auto found = std::find_if(names.begin(), names.end(), [&](const std::string& name) {
      const auto& known = kNames[column];
      return std::find(known.begin(), known.end(), name) != known.end();
    });
    at[column] = static_cast<size_t>(found - names.begin());
    if (at[column] >= std::min(count, names.size())) return {};
  }
  return at;
}

// The last comment before the line `first` of the text.
std::string_view comment_above(std::string_view text, int first) {
  std::string_view comment;
  for (int number = 1; number < first && !text.empty(); ++number) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    const size_t begin = line.find_first_not_of(" \t");
    if (begin != line.npos && line[begin] == '#') comment = line;
  }
  return comment;
}

bool is_whole(std::string_view word) { return word.find_first_of(".eE") == word.npos; }

// The layout by the first line of numbers.
Layout layout_of_numbers(const std::string& file, const TextLine& line) {
  const std::vector<std::string_view> words = words_of(line.text, kSeparators);
  const bool has_separators = line.text.find_first_of(kSeparators) != std::string_view::npos;
  Layout layout;
  layout.count = words.size();
  if (!has_separators && (layout.count == kKitti || layout.count == kKitti4x4)) {
    layout.is_matrix = true;
    layout.unit_s = 0;
  } else if (has_separators &&
             (layout.count > kTum || (layout.count == kTum && is_whole(words[0])))) {
    layout.is_body = true;
    layout.at = {0, 1, 2, 3, 5, 6, 7, 4};
    layout.unit_s = is_whole(words[0]) ? 1e-9 : 1;
  } else if (layout.count != kTum) {
    refuse_line(file, line.number,
                "has " + std::to_string(layout.count) +
                    " numbers: neither TUM's 8 (timestamp tx ty tz qx qy qz qw), EuRoC's with "
                    "commas, nor KITTI's 12; angles in place of a quaternion are not read");
  }
  return layout;
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

void require_unit_quaternion(const double* q, const std::string& file, int line) {
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 1e-6)) refuse_line(file, line, "has a quaternion of length 0");
  if (std::abs(length - 1) > kUnitError)
    refuse_line(file, line,
                "has a quaternion of length " + std::to_string(length) +
                    ", not 1: is it another quantity?");
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

TruePoses load_trajectory(const std::string& file, const std::vector<double>& frame_times,
                          const std::optional<std::array<double, 12>>& body_from_camera) {
  const std::string text = read_file(file, kMaxFileBytes);
  if (text.find('\0') != text.npos)
    throw BadInput(file + " is a binary file, no text of poses (TUM's, EuRoC's or KITTI's lines)");
  std::vector<TextLine> lines = lines_of(text);
  if (lines.empty()) throw BadInput(file + ": no pose in it");
  double ignored = 0;
  const bool has_names = !to_number(words_of(lines[0].text, kSeparators)[0], ignored) &&
                         std::isdigit(static_cast<unsigned char>(lines[0].text[0])) == 0;
  Layout layout = has_names ? layout_of_names(file, lines[0]) : layout_of_numbers(file, lines[0]);
  TruePoses truth;
  truth.unit_s = layout.unit_s;
  const auto named = has_names || layout.is_matrix
                         ? std::nullopt
                         : columns_of_comment(comment_above(text, lines[0].number), layout.count);
  if (named) {
    layout.at = *named;
  } else if (!has_names && !layout.is_matrix && !(layout.is_body && body_from_camera)) {
    truth.order = layout.is_body ? TruePoses::Order::kScalarFirst : TruePoses::Order::kScalarLast;
  }
  if (has_names) lines.erase(lines.begin());
  if (lines.empty()) throw BadInput(file + ": no pose in it");
  if (layout.is_matrix && frame_times.empty())
    throw BadInput(file + " has KITTI's poses without times, and the frames' times are not known");
  if (layout.is_matrix && lines.size() != frame_times.size())
    truth.notes.push_back(count_words(lines.size(), frame_times.size()));
  std::vector<bool> is_zero;
  for (const TextLine& line : lines) {
    const std::vector<double> n = numbers_in(file, line);
    if (n.size() != layout.count)
      refuse_line(
          file, line.number,
          "has " + std::to_string(n.size()) + " numbers, not " + std::to_string(layout.count));
    TimedPose at;
    if (layout.is_matrix) {
      const size_t idx = truth.poses.size();
      if (idx >= frame_times.size()) break;  // the poses of frames beyond those that are here
      at = {frame_times[idx], pose_of_12(n.data())};
      is_zero.push_back(is_origin(at.pose));
      at.pose.R = made_rotation(at.pose.R, file + ": line " + std::to_string(line.number));
    } else {
      const auto value = [&](size_t column) { return n[layout.at[column]]; };
      const double q[4] = {value(4), value(5), value(6), value(7)};
      require_unit_quaternion(q, file, line.number);
      at.time_s = value(0) * layout.unit_s;
      at.pose.t = {value(1), value(2), value(3)};
      at.pose.R = rotation_of_quaternion(value(4), value(5), value(6), value(7));
      is_zero.push_back(is_origin(at.pose));
      if (layout.is_body && body_from_camera)
        at.pose = composed(at.pose, pose_of_12(body_from_camera->data()));
    }
    if (!truth.poses.empty() && !(at.time_s > truth.poses.back().time_s))
      refuse_line(file, line.number, "has a time that is not later than that of the line before");
    truth.poses.push_back(at);
  }
  leave_out_zeros(is_zero, truth);
  return truth;
}

}  // namespace cli
