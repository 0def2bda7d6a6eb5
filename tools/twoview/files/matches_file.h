// Reads a list of matched pixels: the output of `match`, or any table with x0 y0 x1 y1.
#pragma once

#include <string>
#include <vector>

namespace cli {

struct MatchList {
  std::vector<double> pixels[2];  // [image]: x y of each match
  size_t size() const { return pixels[0].size() / 2; }
};

// Reads numbers that are separated by commas, semicolons or blanks. If the first line holds names,
// they say which columns are x0, y0, x1 and y1; otherwise these are the first four columns. Blank
// lines and lines that begin with # are skipped. "nan" and "inf" are accepted, and such a match
// gets no point. Throws BadInput with the number of the wrong line.
MatchList load_matches(const std::string& path);
MatchList parse_matches(const std::string& text, const std::string& name);

}  // namespace cli
