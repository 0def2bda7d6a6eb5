#include "files/pairs_file.h"

#include <charconv>
#include <cmath>
#include <sstream>

#include "base/error.h"
#include "base/matrix.h"
#include "base/output.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = size_t{64} << 20;

double parse_number(const std::string& text) {
  double value = 0;
  const bool plus = text[0] == '+';
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data() + (plus ? 1 : 0), end, value);
  if (result.ec != std::errc() || result.ptr != end || (plus && text[1] == '-'))
    throw BadInput("'" + text + "' is no number");
  if (!std::isfinite(value)) throw BadInput("'" + text + "' is not finite");
  return value;
}

int parse_turns(const std::string& text) {
  const double value = parse_number(text);
  if (value != std::floor(value) || std::abs(value) > 1e6)
    throw BadInput("'" + text + "' is no number of quarter turns");
  constexpr double kDegrees = 45;  // nobody turns a picture so often
  if (std::abs(value) >= kDegrees)
    throw BadInput("'" + text + "' is no number of quarter turns (1 is 90 degrees)");
  return static_cast<int>(value) & 3;
}

void check_K(const std::array<double, 9>& K, const char* name) {
  const std::string what = name;
  if (K[0] <= 0 || K[4] <= 0) throw BadInput(what + " has a focal length that is not above 0");
  if (K[1] != 0) throw BadInput(what + " has skew, which is not supported");
  if (K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
    throw BadInput(what + " is not [fx 0 cx 0 fy cy 0 0 1]");
  // A matrix within these limits is in units of the image size: in pixels it would be of a picture
  // of a few pixels.
  constexpr double kMostFocal = 20, kMostCentre = 2;
  if (K[0] < kMostFocal && K[4] < kMostFocal && std::abs(K[2]) <= kMostCentre &&
      std::abs(K[5]) <= kMostCentre)
    throw BadInput(what + " is normalised: pixels are needed");
}

Pair parse_line(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> fields;
  for (std::string field; stream >> field;) fields.push_back(field);
  const size_t count = fields.size();
  if (count != 2 && count != 4 && count != 22 && count != 38)
    throw BadInput(std::to_string(count) + " fields, not 38 (name0 name1 rot0 rot1 K0 K1 T_0to1)");
  Pair pair;
  pair.name0 = fields[0];
  pair.name1 = fields[1];
  if (count >= 4) {
    pair.turns0 = parse_turns(fields[2]);
    pair.turns1 = parse_turns(fields[3]);
  }
  if (count >= 22) {
    pair.has_K = true;
    for (size_t i = 0; i < 9; ++i) {
      pair.K0[i] = parse_number(fields[4 + i]);
      pair.K1[i] = parse_number(fields[13 + i]);
    }
    check_K(pair.K0, "K0");
    check_K(pair.K1, "K1");
  }
  if (count == 38) {
    pair.has_truth = true;
    for (size_t row = 0; row < 3; ++row) {
      for (size_t column = 0; column < 3; ++column)
        pair.R[3 * row + column] = parse_number(fields[22 + 4 * row + column]);
      pair.t[row] = parse_number(fields[22 + 4 * row + 3]);
    }
    pair.R = made_rotation(pair.R, "T_0to1");
    for (size_t column = 0; column < 4; ++column)
      if (parse_number(fields[34 + column]) != (column == 3 ? 1 : 0))
        throw BadInput("the last row of T_0to1 is not 0 0 0 1");
  }
  return pair;
}

}  // namespace

std::vector<Pair> parse_pairs(const std::string& text, const std::string& name) {
  std::vector<Pair> pairs;
  std::istringstream stream(text.compare(0, 3, "\xef\xbb\xbf") == 0 ? text.substr(3) : text);
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    const size_t start = line.find_first_not_of(" \t\r\v\f");
    if (start == std::string::npos || line[start] == '#') continue;
    try {
      pairs.push_back(parse_line(line));
    } catch (const BadInput& e) {
      throw BadInput(name + ": line " + std::to_string(number) + ": " + e.what());
    }
  }
  if (pairs.empty()) throw BadInput(name + ": no pair in it");
  return pairs;
}

std::vector<Pair> load_pairs(const std::string& path) {
  return parse_pairs(read_file(path, kMaxFileBytes), path);
}

}  // namespace cli
