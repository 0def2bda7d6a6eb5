// Poses of pairs that another program estimated.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace cli {

struct OwnPose {
  std::array<double, 9> R{};  // cam1_from_cam0, row-major
  std::array<double, 3> t{};
};

// A system of the user's: its name, and the pose of each pair, empty where it found none.
struct OwnPoses {
  std::string name;
  std::map<std::pair<std::string, std::string>, std::optional<OwnPose>> of_pairs;
  // The pose of a pair, the inverse one where the file has the pair in the other order; empty where
  // the file has none. *is_listed: whether it has the pair.
  std::optional<OwnPose> of(const std::string& name0, const std::string& name1,
                            bool* is_listed) const;
};

// A line holds name0 name1, and the pose x1 = R x0 + t as 12 numbers (the rows of [R t]), as 16 (a
// 4x4 matrix) or as a line of PAIRS.txt; or nothing more, where no pose was found. Lines that begin
// with # are skipped. `given`: [NAME=]FILE; without NAME that of the file. Throws BadInput that
// names the broken line.
OwnPoses load_own_poses(const std::string& given);
std::string file_of_poses(const std::string& given);
OwnPoses parse_own_poses(const std::string& text, const std::string& file);

}  // namespace cli
