// Reads numbers from YAML; messages name the file and the entry.
#pragma once

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <string>
#include <vector>

namespace cli {

// Parses one document, which must be a map. OpenCV's line "%YAML:1.0", which is no valid YAML
// directive, is accepted. Throws BadInput for a name that occurs twice and for an alias.
YAML::Node parse_yaml(const std::string& text, const std::string& file);

// Returns a finite number. Throws BadInput that names `entry` if it is missing, no number, NaN or
// infinite.
double number_at(const YAML::Node& map, const std::string& entry, const std::string& file);

// The width or height of an image: a whole number of pixels from 1 to 10^6.
int32_t side_at(const YAML::Node& map, const std::string& entry, const std::string& file);

// Throws BadInput unless the focal length `value` is above 0.
void require_focal(double value, const std::string& entry, const std::string& file);

// Returns the numbers of an entry: a list, a list of lists, or a map with `data` (OpenCV, ROS). If
// the map has `rows` and `cols`, their product must equal the number of values.
std::vector<double> numbers_at(const YAML::Node& map, const std::string& entry,
                               const std::string& file);

}  // namespace cli
