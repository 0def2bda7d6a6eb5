#include "report/ply.h"

#include <cstring>

#include "twoview/twoview.h"

namespace cli {

std::string ply_header(const std::vector<std::string>& comments, size_t num_points,
                       const PlyColumns& columns, std::optional<size_t> num_triangles) {
  std::string text = "ply\nformat binary_little_endian 1.0\ncomment twoview " +
                     std::string(tv_version_string()) + "\n";
  for (const std::string& comment : comments) text += "comment " + comment + "\n";
  text += "element vertex " + std::to_string(num_points) + "\n";
  for (const auto& [type, names] : columns)
    for (const char* name : names)
      text += std::string(type == PlyType::kFloat ? "property float " : "property uchar ") + name +
              "\n";
  if (num_triangles)
    text += "element face " + std::to_string(*num_triangles) +
            "\nproperty list uchar int vertex_indices\n";
  return text + "end_header\n";
}

void append_float(std::string& bytes, float value) {
  uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  for (int shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(bits >> shift & 255);
}

}  // namespace cli
