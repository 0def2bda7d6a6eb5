// Reads numbers from YAML; messages name the file and the entry.
#pragma once

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <string>
#include <vector>

namespace cli {

// Parses one document of YAML or JSON, which must be a map. OpenCV's first line, "%YAML:1.0", which
// is no valid YAML directive, is accepted. Throws BadInput for a name that occurs twice and for an
// alias.
YAML::Node parse_yaml(const std::string& text, const std::string& file);

// Parses a number, which may be NaN or infinite. Returns false if the text is none.
bool parse_number(std::string text, double& value);

// Returns a finite number. Throws BadInput that names `entry` if it is missing, no number, NaN or
// infinite.
double number_at(const YAML::Node& map, const std::string& entry, const std::string& file);
double number_of(const YAML::Node& value, const std::string& entry, const std::string& file);

// The width or height of an image: a whole number of pixels from 1 to 10^6.
int32_t side_of(double value, const std::string& entry, const std::string& file);

// Throws BadInput unless the focal length `value` is above 0.
void require_focal(double value, const std::string& entry, const std::string& file);

// The sides of a matrix: `rows` and `cols` (OpenCV, ROS), or `sizes` (OpenCV 5); empty where the
// value has none.
std::vector<double> shape_of(const YAML::Node& value, const std::string& entry,
                             const std::string& file);

// Returns the numbers of an entry: a list, a list of lists, or a map with `data` (OpenCV, ROS). If
// the map has a shape, its product must equal the number of values, but for the 8 numbers that
// ROS's calibrator writes below `cols: 5` (image_pipeline's issue 278).
std::vector<double> numbers_at(const YAML::Node& map, const std::string& entry,
                               const std::string& file);
std::vector<double> numbers_of(const YAML::Node& value, const std::string& entry,
                               const std::string& file);

}  // namespace cli
