// Reads matched pixels: the output of `match`, any table with x0 y0 x1 y1, and the arrays in which
// other matchers are saved.
#pragma once

#include <string>
#include <string_view>

#include "files/match_list.h"

namespace cli {

// Reads a file of one of these kinds; docs/formats.md has the names.
// Text: numbers that are separated by commas, semicolons or blanks. If the first line holds names,
// they say which columns are x0, y0, x1 and y1 (or x1, y1, x2 and y2), and which is a score;
// otherwise these are the first four columns, and a fifth one, where no line has more or fewer, is
// a score. Blank lines and lines that begin with # are skipped. "nan" and "inf" are accepted, and
// such a match gets no point. .npz and .npy of numpy: arrays of matched pixels, or keypoints and
// their indices. Throws BadInput that names the wrong line or array.
MatchList load_matches(const std::string& path);
MatchList parse_matches(std::string_view bytes, const std::string& name);

}  // namespace cli
