// Numbers out of YAML, with messages that name the file and the entry.
#pragma once

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <string>
#include <vector>

namespace cli {

// Parses one document; OpenCV's "%YAML:1.0" line, which is no valid YAML directive, is let pass.
// The result is a map; a name given twice and an alias are refused. Throws BadInput.
YAML::Node parse_yaml(const std::string& text, const std::string& file);

// A finite number; BadInput names `entry` when it is missing, no number, NaN or infinite.
double number_at(const YAML::Node& map, const std::string& entry, const std::string& file);

// The width or height of an image: a whole number of pixels from 1 to 10^6.
int32_t side_at(const YAML::Node& map, const std::string& entry, const std::string& file);

// Throws BadInput unless the focal length `value` is above 0.
void require_focal(double value, const std::string& entry, const std::string& file);

// The numbers of an entry: a list, a list of lists, or a map with `data` (OpenCV, ROS), whose
// `rows` and `cols`, where it has both, must multiply to how many there are.
std::vector<double> numbers_at(const YAML::Node& map, const std::string& entry,
                               const std::string& file);

}  // namespace cli
