#include "files/matches_file.h"

#include <algorithm>
#include <charconv>
#include <optional>

#include "base/error.h"
#include "base/output.h"
#include "files/match_scores.h"
#include "files/matches_arrays.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = size_t{256} << 20;

using Names = std::vector<std::string>;
// The names of the columns of a match's pixels, counted from 0, or from 1.
const Names kColumns[2] = {{"x0", "y0", "x1", "y1"}, {"x1", "y1", "x2", "y2"}};
// Further columns of `match`, which need not be named where they are left out.
const Names kOwnColumns = {"dist_sq", "idx0", "idx1"};

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

bool contains(const Names& names, std::string_view name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

// The index, in a line, of each field that is used.
struct Columns {
  std::vector<size_t> pixels = {0, 1, 2, 3};
  std::optional<size_t> score;
  bool lower_is_better = false;
  bool have_names = false;
};

// The columns by the line of names; adds those of no use to `left_out`.
Columns columns_of(const std::vector<std::string_view>& names, Names& left_out) {
  const bool from_one = std::find(names.begin(), names.end(), "x0") == names.end() &&
                        std::find(names.begin(), names.end(), "x2") != names.end();
  Columns columns;
  columns.have_names = true;
  columns.pixels.clear();
  for (const std::string& column : kColumns[from_one ? 1 : 0]) {
    const auto found = std::find(names.begin(), names.end(), column);
    if (found == names.end()) throw BadInput("no column " + column + " among the names");
    columns.pixels.push_back(static_cast<size_t>(found - names.begin()));
  }
  for (const bool lower : {true, false})
    for (size_t i = 0; i < names.size() && !columns.score; ++i)
      if (contains(score_names(lower), names[i])) {
        columns.score = i;
        columns.lower_is_better = lower;
      }
  for (size_t i = 0; i < names.size(); ++i)
    if (std::find(columns.pixels.begin(), columns.pixels.end(), i) == columns.pixels.end() &&
        columns.score != i && !contains(kOwnColumns, names[i]))
      left_out.emplace_back(names[i]);
  return columns;
}

double number_in(const std::vector<std::string_view>& fields, size_t column,
                 const std::string& what) {
  if (column >= fields.size())
    throw BadInput(std::to_string(fields.size()) + " fields, " + what + " is missing");
  double value = 0;
  if (!read_number(fields[column], value))
    throw BadInput(what + " is no number: '" + std::string(fields[column].substr(0, 40)) + "'");
  return value;
}

MatchList parse_table(std::string_view rest, const std::string& name) {
  MatchList matches;
  Columns columns;
  std::vector<double> scores, fifths;
  size_t most_fields = 0;
  bool is_first = true;
  size_t number = 0;
  if (rest.substr(0, 3) == "\xef\xbb\xbf") rest.remove_prefix(3);
  while (!rest.empty()) {
    const size_t end = std::min(rest.find('\n'), rest.size());
    const std::vector<std::string_view> fields = fields_of(rest.substr(0, end));
    rest.remove_prefix(std::min(end + 1, rest.size()));
    ++number;
    if (fields.empty() || (!fields[0].empty() && fields[0][0] == '#')) continue;
    try {
      double value;
      if (is_first && !read_number(fields[0], value)) {
        columns = columns_of(fields, matches.left_out);
      } else {
        for (size_t i = 0; i < 4; ++i)
          matches.pixels[i / 2].push_back(number_in(fields, columns.pixels[i], kColumns[0][i]));
        if (columns.score) scores.push_back(number_in(fields, *columns.score, "the score"));
        if (fields.size() == 5 && read_number(fields[4], value)) fifths.push_back(value);
        most_fields = std::max(most_fields, fields.size());
      }
      if (matches.size() > kMaxMatches)
        throw BadInput("more than " + std::to_string(kMaxMatches) + " matches");
    } catch (const BadInput& e) {
      throw BadInput(name + ": line " + std::to_string(number) + ": " + e.what());
    }
    is_first = false;
  }
  if (matches.size() == 0) throw BadInput(name + ": no match in it");
  if (!columns.have_names && most_fields == 5 && fifths.size() == matches.size())
    scores = fifths;
  else if (!columns.have_names && most_fields > 4)
    matches.left_out.emplace_back("the columns behind the fourth");
  if (!scores.empty()) matches.ratios = ratios_of(scores, columns.lower_is_better, name);
  return matches;
}

}  // namespace

MatchList parse_matches(std::string_view bytes, const std::string& name) {
  return holds_arrays(bytes) ? parse_match_arrays(bytes, name) : parse_table(bytes, name);
}

MatchList load_matches(const std::string& path) {
  return parse_matches(read_file(path, kMaxFileBytes), path);
}

}  // namespace cli
