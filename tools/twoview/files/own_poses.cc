#include "files/own_poses.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <vector>

#include "base/error.h"
#include "base/matrix.h"
#include "base/output.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = size_t{64} << 20;
constexpr size_t kRows = 12, kMatrix = 16, kOfPairs = 36;  // numbers behind the two names

double number_of(const std::string& text) {
  double value = 0;
  const char* const begin = text.data() + (text[0] == '+' ? 1 : 0);
  const auto read = std::from_chars(begin, text.data() + text.size(), value);
  if (read.ec != std::errc() || read.ptr != text.data() + text.size() || !std::isfinite(value))
    throw BadInput("'" + text + "' is no finite number");
  return value;
}

std::optional<OwnPose> pose_of(const std::vector<std::string>& fields) {
  const size_t count = fields.size() - 2;
  if (count == 0) return {};
  if (count != kRows && count != kMatrix && count != kOfPairs)
    throw BadInput(std::to_string(count) +
                   " numbers behind the names, not 12 ([R t] in rows), 16 (4x4) or none (no pose)");
  std::vector<double> m;
  const size_t first = count == kOfPairs ? fields.size() - kMatrix : 2;
  for (size_t i = first; i < fields.size(); ++i) m.push_back(number_of(fields[i]));
  if (m.size() == kMatrix && (m[12] != 0 || m[13] != 0 || m[14] != 0 || m[15] != 1))
    throw BadInput("the last row of the matrix is not 0 0 0 1");
  OwnPose pose;
  pose.R = made_rotation({m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, "the matrix");
  pose.t = {m[3], m[7], m[11]};
  return pose;
}

OwnPose inverse(const OwnPose& pose) {
  OwnPose result;
  result.R = transposed(pose.R);
  const Vector3 t = applied(result.R, pose.t);
  for (size_t i = 0; i < 3; ++i) result.t[i] = -t[i];
  return result;
}

}  // namespace

std::optional<OwnPose> OwnPoses::of(const std::string& name0, const std::string& name1,
                                    bool* is_listed) const {
  auto found = of_pairs.find({name0, name1});
  const bool is_exchanged = found == of_pairs.end();
  if (is_exchanged) found = of_pairs.find({name1, name0});
  *is_listed = found != of_pairs.end();
  if (!*is_listed || !found->second) return {};
  return is_exchanged ? inverse(*found->second) : *found->second;
}

OwnPoses parse_own_poses(const std::string& text, const std::string& file) {
  OwnPoses poses;
  std::istringstream stream(text.compare(0, 3, "\xef\xbb\xbf") == 0 ? text.substr(3) : text);
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    std::vector<std::string> fields;
    for (std::string field; words >> field;) fields.push_back(field);
    if (fields.empty() || fields[0][0] == '#') continue;
    try {
      if (fields.size() < 2) throw BadInput("one field, where two names are needed");
      const bool is_new =
          poses.of_pairs.emplace(std::pair(fields[0], fields[1]), pose_of(fields)).second;
      const bool is_other =
          fields[0] == fields[1] || poses.of_pairs.count({fields[1], fields[0]}) == 0;
      if (!is_new || !is_other) throw BadInput("the pair is there already");
    } catch (const BadInput& e) {
      throw BadInput(file + ": line " + std::to_string(number) + ": " + e.what());
    }
  }
  if (poses.of_pairs.empty()) throw BadInput(file + ": no pair in it");
  return poses;
}

// A file whose name contains an equals sign can be given without NAME=.
std::string file_of_poses(const std::string& given) {
  std::error_code error;
  const size_t equals = given.find('=');
  const bool has_name = equals != std::string::npos && !std::filesystem::exists(given, error);
  return has_name ? given.substr(equals + 1) : given;
}

OwnPoses load_own_poses(const std::string& given) {
  const std::string file = file_of_poses(given);
  OwnPoses poses = parse_own_poses(read_file(file, kMaxFileBytes), file);
  poses.name = file.size() < given.size() ? given.substr(0, given.size() - file.size() - 1)
                                          : std::filesystem::path(file).stem().string();
  if (poses.name.empty()) throw BadInput("--poses: no name before =");
  return poses;
}

}  // namespace cli
