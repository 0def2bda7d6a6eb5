// The order of names whose numbers count as numbers: frame2 before frame10.
#pragma once

#include <string_view>

namespace cli {

// Whether name a comes before name b. The names are compared piece by piece from the left: where
// both have digits (0 to 9 of ASCII), the runs of digits compare as whole numbers of any length;
// else the bytes compare, and / is the lowest. Names that are equal by this, such as "a01" and
// "a1", compare by their bytes, so that the order is total. tools/python/twoview_tools/folders.py
// is its twin; both run the cases of test/formats/names.json.
bool comes_before(std::string_view a, std::string_view b);

}  // namespace cli
