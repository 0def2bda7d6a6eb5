// Lists of matched pixels: what `match` writes, and any table of x0 y0 x1 y1.
#pragma once

#include <string>
#include <vector>

namespace cli {

struct MatchList {
  std::vector<double> pixels[2];  // x y of each match
  size_t size() const { return pixels[0].size() / 2; }
};

// Numbers between commas, semicolons or blanks. A first line of names tells which columns hold x0,
// y0, x1 and y1; without such a line these are the first four columns. Blank lines and lines that
// begin with # are skipped. "nan" and "inf" are numbers: such a match has no point. Throws BadInput
// that names the broken line by its number.
MatchList load_matches(const std::string& path);
MatchList parse_matches(const std::string& text, const std::string& name);

}  // namespace cli
