#include "odometry/numbers.h"

#include <charconv>
#include <cmath>

namespace cli {
namespace {

constexpr std::string_view kBlanks = " \t\r\f\v";

}  // namespace

std::vector<TextLine> lines_of(std::string_view text) {
  std::vector<TextLine> lines;
  constexpr std::string_view mark = "\xef\xbb\xbf";  // of UTF-8, as Windows' editors write it
  if (text.substr(0, mark.size()) == mark) text.remove_prefix(mark.size());
  for (int number = 1; !text.empty(); ++number) {
    const size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
    if (line.empty() || line[0] == '#') continue;
    line = line.substr(0, line.find_last_not_of(kBlanks) + 1);
    lines.push_back({number, line});
  }
  return lines;
}

std::vector<std::string_view> words_of(std::string_view line, std::string_view separators) {
  const std::string both = std::string(kBlanks) + std::string(separators);
  std::vector<std::string_view> words;
  for (;;) {
    line.remove_prefix(std::min(line.find_first_not_of(both), line.size()));
    if (line.empty()) return words;
    const size_t end = std::min(line.find_first_of(both), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
}

bool to_number(std::string_view word, double& value) {
  if (!word.empty() && word[0] == '+') word.remove_prefix(1);
  const auto result = std::from_chars(word.data(), word.data() + word.size(), value);
  return result.ec == std::errc() && result.ptr == word.data() + word.size() &&
         std::isfinite(value);
}

}  // namespace cli
