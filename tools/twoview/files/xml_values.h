// Reads the XML that OpenCV writes (opencv_storage) as the YAML that it would have written.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>

namespace cli {

// Whether the text is XML: its first character that is not blank is "<".
bool is_xml(const std::string& text);

// Parses OpenCV's XML: a map of names and values, in which a matrix is a map with rows, cols and
// data. Throws BadInput for XML of another root, a name that occurs twice, and a declaration (<!),
// with which a small file can expand to an unlimited number of values.
YAML::Node parse_xml(const std::string& text, const std::string& file);

}  // namespace cli
