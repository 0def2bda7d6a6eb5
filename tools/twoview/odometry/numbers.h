// Lines of text and the numbers in them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace cli {

// A line with its number in the file, from 1.
struct TextLine {
  int number = 0;
  std::string_view text;  // without blanks at both ends
};

// The lines of a text but for blank ones and those that begin with #. The views are into `text`.
std::vector<TextLine> lines_of(std::string_view text);

// The words of a line, which blanks or any character of `separators` separate.
std::vector<std::string_view> words_of(std::string_view line, std::string_view separators = "");

// Parses the whole word as one finite number.
bool to_number(std::string_view word, double& value);

}  // namespace cli
