// Whether the names of a sequence's pictures are those of several sequences: of two cameras, of
// two takes, or of pictures and what was made of them.
#pragma once

#include <string>
#include <vector>

namespace cli {

// Two kinds of names that count the same numbers, as "left_0001.jpg" and "right_0001.jpg", or
// "0001_rgb.png" and "0001_depth.png", as words: "as left_# (38) and as right_# (38)"; empty where
// there are none. A number behind "cam" or "camera" is a part of the name. Kinds of fewer than
// three names, and those that share fewer than half of their numbers, do not count, nor do names
// that are hexadecimal numbers.
std::string mixed_names(const std::vector<std::string>& names);

}  // namespace cli
