#include "odometry/ply_mesh.h"

#include <cmath>
#include <cstring>
#include <string_view>

#include "base/error.h"
#include "base/output.h"
#include "odometry/numbers.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = size_t{1} << 31;

// The types of PLY by both of their names.
enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
struct TypeName {
  const char *name, *other;
  size_t size;
};
constexpr TypeName kTypes[] = {
    {"char", "int8", 1}, {"uchar", "uint8", 1}, {"short", "int16", 2},   {"ushort", "uint16", 2},
    {"int", "int32", 4}, {"uint", "uint32", 4}, {"float", "float32", 4}, {"double", "float64", 8}};

struct Property {
  std::string name;
  Type type = Type::kFloat;
  bool is_list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  int64_t count = 0;
  std::vector<Property> properties;
};

enum class Format { kAscii, kLittle, kBig };

struct Header {
  Format format = Format::kAscii;
  std::vector<Element> elements;
  size_t size = 0;  // bytes
};

class Reader {
 public:
  Reader(std::string path, std::string text)
      : path_(std::move(path)), text_(std::move(text)), header_(read_header()), at_(header_.size) {}

  TriangleMesh mesh() {
    TriangleMesh mesh;
    bool has_faces = false;
    for (const Element& element : header_.elements) {
      if (element.name == "vertex")
        read_vertices(element, mesh);
      else if (element.name == "face")
        has_faces = read_faces(element, mesh);
      else
        read_over(element);
    }
    if (!has_faces || mesh.triangles.empty())
      fail("has no faces: a surface of triangles is needed, not a cloud of points");
    for (const auto& triangle : mesh.triangles)
      for (const int32_t corner : triangle)
        if (corner < 0 || static_cast<size_t>(corner) >= mesh.places.size())
          fail("has a face with a vertex " + std::to_string(corner) + " of " +
               std::to_string(mesh.places.size()));
    return mesh;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { throw BadInput(path_ + " " + what); }

  Type type_of(std::string_view word) const {
    for (size_t k = 0; k < std::size(kTypes); ++k)
      if (word == kTypes[k].name || word == kTypes[k].other) return static_cast<Type>(k);
    fail("has a property of the unknown type " + std::string(word));
  }

  Header read_header() const {
    Header header;
    bool has_format = false;
    size_t at = 0;
    for (int number = 1;; ++number) {
      const size_t end = text_.find('\n', at);
      if (end == std::string::npos) fail(number == 1 ? "is no PLY file" : "ends in its header");
      const auto words = words_of(std::string_view(text_).substr(at, end - at));
      at = end + 1;
      if (number == 1) {
        if (words.size() != 1 || words[0] != "ply") fail("is no PLY file");
      } else if (words.empty() || words[0] == "comment" || words[0] == "obj_info") {
        continue;
      } else if (words[0] == "format" && words.size() == 3) {
        has_format = true;
        if (words[1] == "binary_little_endian")
          header.format = Format::kLittle;
        else if (words[1] == "binary_big_endian")
          header.format = Format::kBig;
        else if (words[1] != "ascii")
          fail("is of the unknown format " + std::string(words[1]));
      } else if (words[0] == "element" && words.size() == 3) {
        double count = 0;
        if (!to_number(words[2], count) || count < 0 || count > INT32_MAX ||
            count != std::floor(count))
          fail("has an element of " + std::string(words[2]) + " rows");
        header.elements.push_back({std::string(words[1]), static_cast<int64_t>(count), {}});
      } else if (words[0] == "property" && words.size() == 3 && !header.elements.empty()) {
        header.elements.back().properties.push_back(
            {std::string(words[2]), type_of(words[1]), false, Type::kUint8});
      } else if (words[0] == "property" && words.size() == 5 && words[1] == "list" &&
                 !header.elements.empty()) {
        header.elements.back().properties.push_back(
            {std::string(words[4]), type_of(words[3]), true, type_of(words[2])});
      } else if (words[0] == "end_header") {
        break;
      } else {
        fail("has a header whose line " + std::to_string(number) + " is not of PLY");
      }
    }
    if (!has_format) fail("does not say its format");
    header.size = at;
    return header;
  }

  double next(Type type) {
    if (header_.format == Format::kAscii) {
      constexpr std::string_view kBlanks = " \t\r\n\f\v";
      const size_t begin = text_.find_first_not_of(kBlanks, at_);
      if (begin == std::string::npos) fail("is truncated");
      at_ = std::min(text_.find_first_of(kBlanks, begin), text_.size());
      const std::string_view word = std::string_view(text_).substr(begin, at_ - begin);
      double value = 0;
      if (!to_number(word, value))
        fail("has '" + std::string(word.substr(0, 40)) + "' for a number");
      return value;
    }
    const size_t size = kTypes[static_cast<size_t>(type)].size;
    if (text_.size() - at_ < size) fail("is truncated");
    uint64_t bits = 0;
    for (size_t k = 0; k < size; ++k) {
      const size_t place = header_.format == Format::kLittle ? size - 1 - k : k;
      bits = bits << 8 | static_cast<uint8_t>(text_[at_ + place]);
    }
    at_ += size;
    switch (type) {
      case Type::kInt8: return static_cast<int8_t>(bits);
      case Type::kInt16: return static_cast<int16_t>(bits);
      case Type::kInt32: return static_cast<int32_t>(bits);
      case Type::kFloat: {
        const uint32_t half = static_cast<uint32_t>(bits);
        float value = 0;
        std::memcpy(&value, &half, sizeof value);
        return static_cast<double>(value);
      }
      case Type::kDouble: {
        double value = 0;
        std::memcpy(&value, &bits, sizeof value);
        return value;
      }
      default: return static_cast<double>(bits);
    }
  }

  // Reads a property of a row; a list's numbers go into `list`, which may be null.
  double read(const Property& property, std::vector<double>* list) {
    if (!property.is_list) return next(property.type);
    const double count = next(property.count_type);
    if (!(count >= 0) || count != std::floor(count) || count > static_cast<double>(text_.size()))
      fail("has a list of a length that cannot be");
    for (double k = 0; k < count; ++k) {
      const double value = next(property.type);
      if (list != nullptr) list->push_back(value);
    }
    return 0;
  }

  void read_over(const Element& element) {
    for (int64_t row = 0; row < element.count; ++row)
      for (const Property& property : element.properties) read(property, nullptr);
  }

  void read_vertices(const Element& element, TriangleMesh& mesh) {
    std::vector<int> axes;  // of each property; -1: none
    int found = 0;
    for (const Property& property : element.properties) {
      const int axis = property.is_list       ? -1
                       : property.name == "x" ? 0
                       : property.name == "y" ? 1
                       : property.name == "z" ? 2
                                              : -1;
      axes.push_back(axis);
      found += axis >= 0;
    }
    if (found != 3) fail("has vertices without x y z");
    for (int64_t row = 0; row < element.count; ++row) {
      Vector3 place{};
      for (size_t k = 0; k < axes.size(); ++k) {
        const double value = read(element.properties[k], nullptr);
        if (axes[k] < 0) continue;
        if (!std::isfinite(value))
          fail("has a vertex " + std::to_string(row) + " that is not finite");
        place[static_cast<size_t>(axes[k])] = value;
      }
      mesh.places.push_back(place);
    }
  }

  // Returns whether faces have corners.
  bool read_faces(const Element& element, TriangleMesh& mesh) {
    bool has_corners = false;
    std::vector<double> corners;
    for (int64_t row = 0; row < element.count; ++row) {
      for (const Property& property : element.properties) {
        const bool wanted = property.is_list &&
                            (property.name == "vertex_indices" || property.name == "vertex_index");
        has_corners = has_corners || wanted;
        corners.clear();
        read(property, wanted ? &corners : nullptr);
        for (const double corner : corners)
          if (corner != std::floor(corner) || corner < 0 || corner > INT32_MAX)
            fail("has a face whose vertex is not a number of one");
        const auto index = [&corners](size_t k) { return static_cast<int32_t>(corners[k]); };
        for (size_t k = 2; k < corners.size(); ++k)
          mesh.triangles.push_back({index(0), index(k - 1), index(k)});
      }
    }
    return has_corners;
  }

  std::string path_, text_;
  Header header_;
  size_t at_;
};

}  // namespace

TriangleMesh load_ply_mesh(const std::string& path) {
  return Reader(path, read_file(path, kMaxFileBytes)).mesh();
}

}  // namespace cli
