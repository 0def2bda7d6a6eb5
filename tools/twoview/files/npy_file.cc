// The format: numpy.lib.format, "The .npy file format", versions 1 to 3.
#include "files/npy_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "base/error.h"

namespace cli {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr size_t kMostValues = size_t{1} << 26;
constexpr size_t kMostAxes = 8;

// The text behind 'key': in the header, which is a Python dict; empty without it.
std::string_view entry_of(std::string_view header, const std::string& key) {
  const size_t at = header.find("'" + key + "'");
  if (at == header.npos) return {};
  const size_t colon = header.find(':', at);
  if (colon == header.npos) return {};
  const size_t begin = header.find_first_not_of(' ', colon + 1);
  return begin == header.npos ? std::string_view() : header.substr(begin);
}

// Reads "(3, 2)". Returns false for anything else.
bool read_shape(std::string_view text, std::vector<size_t>& shape) {
  if (text.empty() || text[0] != '(') return false;
  size_t at = 1;
  while (true) {
    at = std::min(text.find_first_not_of(" ,", at), text.size());
    if (at == text.size()) return false;
    if (text[at] == ')') return true;
    size_t axis = 0;
    const auto read = std::from_chars(text.data() + at, text.data() + text.size(), axis);
    if (read.ec != std::errc() || shape.size() == kMostAxes) return false;
    shape.push_back(axis);
    at = static_cast<size_t>(read.ptr - text.data());
  }
}

struct Type {
  char kind = 0;  // as numpy has it: f, i, u or b
  size_t bytes = 0;
  bool is_big_endian = false;
};

Type read_type(std::string_view text, const std::string& name) {
  const std::string_view descr =
      text.substr(0, 1) == "'" ? text.substr(1, text.find('\'', 1) - 1) : std::string_view();
  if (descr.size() >= 2 && descr[1] == 'O')
    throw BadInput(name + " holds pickled objects and no numbers");
  Type type;
  if (descr.size() == 3) {
    type.kind = descr[1];
    type.bytes = static_cast<size_t>(descr[2] - '0');
    type.is_big_endian = descr[0] == '>';
  }
  const bool is_float = type.kind == 'f' && (type.bytes == 2 || type.bytes == 4 || type.bytes == 8);
  const bool is_integer =
      (type.kind == 'i' || type.kind == 'u') &&
      (type.bytes == 1 || type.bytes == 2 || type.bytes == 4 || type.bytes == 8);
  const bool is_truth = type.kind == 'b' && type.bytes == 1;
  if (!is_float && !is_integer && !is_truth)
    throw BadInput(name + " holds no numbers that are read here: " +
                   std::string(text.substr(0, std::min(text.find(", 'fortran"), size_t{40}))));
  return type;
}

double half_value(uint64_t bits) {
  const int exponent = static_cast<int>(bits >> 10 & 31);
  const auto fraction = static_cast<double>(bits & 1023);
  const double sign = bits >> 15 & 1 ? -1 : 1;
  if (exponent == 31) return fraction == 0 ? sign * HUGE_VAL : std::nan("");
  if (exponent == 0) return sign * std::ldexp(fraction, -24);
  return sign * std::ldexp(1024 + fraction, exponent - 25);
}

double value_at(const char* bytes, const Type& type) {
  uint64_t bits = 0;
  for (size_t i = 0; i < type.bytes; ++i) {
    const size_t at = type.is_big_endian ? i : type.bytes - 1 - i;
    bits = bits << 8 | static_cast<unsigned char>(bytes[at]);
  }
  if (type.kind == 'u' || type.kind == 'b') return static_cast<double>(bits);
  if (type.kind == 'i') {
    const uint64_t sign = uint64_t{1} << (8 * type.bytes - 1);
    return static_cast<double>(static_cast<int64_t>((bits ^ sign) - sign));
  }
  if (type.bytes == 2) return half_value(bits);
  if (type.bytes == 4) {
    const auto narrow = static_cast<uint32_t>(bits);
    float value;
    std::memcpy(&value, &narrow, sizeof value);
    return static_cast<double>(value);
  }
  double value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

// The place in the file, in values, of the value that is number `index` row by row.
size_t fortran_place(size_t index, const std::vector<size_t>& shape) {
  size_t place = 0, stride = 1;
  std::vector<size_t> coordinates(shape.size());
  for (size_t axis = shape.size(); axis-- > 0; index /= shape[axis])
    coordinates[axis] = index % shape[axis];
  for (size_t axis = 0; axis < shape.size(); stride *= shape[axis++])
    place += coordinates[axis] * stride;
  return place;
}

}  // namespace

std::string NpyArray::shape_in_words() const {
  std::string text;
  for (const size_t axis : shape) text += (text.empty() ? "" : ", ") + std::to_string(axis);
  return "(" + text + (shape.size() == 1 ? ",)" : ")");
}

bool is_npy(std::string_view bytes) { return bytes.substr(0, kMagic.size()) == kMagic; }

NpyArray parse_npy(std::string_view bytes, const std::string& name) {
  const BadInput damaged(name + " is damaged: it is no whole array of numpy");
  if (!is_npy(bytes) || bytes.size() < 12) throw damaged;
  const bool is_first_version = bytes[6] == 1;
  const size_t begin = is_first_version ? 10 : 12;
  size_t header_bytes = 0;
  for (size_t i = begin; i-- > 8;)
    header_bytes = header_bytes << 8 | static_cast<unsigned char>(bytes[i]);
  if (header_bytes > bytes.size() - begin) throw damaged;
  const std::string_view header = bytes.substr(begin, header_bytes);
  const std::string_view data = bytes.substr(begin + header_bytes);
  const Type type = read_type(entry_of(header, "descr"), name);
  NpyArray array;
  array.is_integer = type.kind != 'f';
  if (!read_shape(entry_of(header, "shape"), array.shape)) throw damaged;
  size_t count = 1;
  for (const size_t axis : array.shape) {
    if (axis != 0 && count > kMostValues / axis)
      throw BadInput(name + " holds more than " + std::to_string(kMostValues) + " numbers");
    count *= axis;
  }
  if (data.size() / type.bytes < count) throw damaged;
  const bool is_fortran = entry_of(header, "fortran_order").substr(0, 4) == "True";
  array.values.resize(count);
  for (size_t i = 0; i < count; ++i) {
    const size_t place = is_fortran ? fortran_place(i, array.shape) : i;
    array.values[i] = value_at(data.data() + place * type.bytes, type);
  }
  return array;
}

}  // namespace cli
