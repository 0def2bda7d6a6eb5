#include "files/matches_file.h"

#include <algorithm>
#include <charconv>
#include <string_view>

#include "base/error.h"
#include "base/output.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = size_t{256} << 20;
constexpr size_t kMaxMatches = 1000000;  // the library's limit of max_matches of a context
constexpr const char* kColumns[4] = {"x0", "y0", "x1", "y1"};

// The fields of a line; a comma directly followed by another one gives an empty field.
std::vector<std::string_view> fields_of(std::string_view line) {
  std::vector<std::string_view> fields;
  size_t at = 0;
  const auto skip_blanks = [&] { at = std::min(line.find_first_not_of(" \t\r", at), line.size()); };
  skip_blanks();
  while (at < line.size()) {
    const size_t end = std::min(line.find_first_of(" \t\r,;", at), line.size());
    fields.push_back(line.substr(at, end - at));
    at = end;
    skip_blanks();
    if (at < line.size() && (line[at] == ',' || line[at] == ';')) ++at;
    skip_blanks();
  }
  return fields;
}

bool read_number(std::string_view text, double& value) {
  if (!text.empty() && text[0] == '+') text.remove_prefix(1);
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  return result.ec == std::errc() && result.ptr == text.data() + text.size();
}

// The indices of the columns x0, y0, x1 and y1, found in the line of names.
std::vector<size_t> columns_of(const std::vector<std::string_view>& names) {
  std::vector<size_t> columns;
  for (const char* column : kColumns) {
    const auto found = std::find(names.begin(), names.end(), column);
    if (found == names.end())
      throw BadInput(std::string("no column ") + column + " among the names");
    columns.push_back(static_cast<size_t>(found - names.begin()));
  }
  return columns;
}

void append_match(const std::vector<std::string_view>& fields, const std::vector<size_t>& columns,
                  MatchList& matches) {
  double values[4];
  for (size_t i = 0; i < 4; ++i) {
    if (columns[i] >= fields.size())
      throw BadInput(std::to_string(fields.size()) + " fields, " + kColumns[i] + " is missing");
    if (!read_number(fields[columns[i]], values[i]))
      throw BadInput(std::string(kColumns[i]) + " is no number: '" +
                     std::string(fields[columns[i]].substr(0, 40)) + "'");
  }
  for (size_t v = 0; v < 2; ++v)
    matches.pixels[v].insert(matches.pixels[v].end(), {values[2 * v], values[2 * v + 1]});
}

}  // namespace

MatchList parse_matches(const std::string& text, const std::string& name) {
  MatchList matches;
  std::vector<size_t> columns = {0, 1, 2, 3};
  bool is_first = true;
  size_t number = 0;
  std::string_view rest = text;
  if (rest.substr(0, 3) == "\xef\xbb\xbf") rest.remove_prefix(3);
  while (!rest.empty()) {
    const size_t end = std::min(rest.find('\n'), rest.size());
    const std::vector<std::string_view> fields = fields_of(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    ++number;
    if (fields.empty() || (!fields[0].empty() && fields[0][0] == '#')) continue;
    try {
      double value;
      if (is_first && !read_number(fields[0], value))
        columns = columns_of(fields);
      else
        append_match(fields, columns, matches);
      if (matches.size() > kMaxMatches)
        throw BadInput("more than " + std::to_string(kMaxMatches) + " matches");
    } catch (const BadInput& e) {
      throw BadInput(name + ": line " + std::to_string(number) + ": " + e.what());
    }
    is_first = false;
  }
  if (matches.size() == 0) throw BadInput(name + ": no match in it");
  return matches;
}

MatchList load_matches(const std::string& path) {
  return parse_matches(read_file(path, kMaxFileBytes), path);
}

}  // namespace cli
