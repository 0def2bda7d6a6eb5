// The order of names whose numbers count as numbers: frame2 before frame10.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace cli {

// Whether name a comes before name b. The names are compared piece by piece from the left: where
// both have digits (0 to 9 of ASCII), the runs of digits compare as whole numbers of any length;
// else the bytes compare, and / is the lowest, the dot the second. Names that are equal by this,
// such as "a01" and "a1", compare by their bytes, so that the order is total.
// tools/python/twoview_tools/folders.py is its twin; both run the cases of test/formats/names.json.
bool comes_before(std::string_view a, std::string_view b);

// Sorts the names of a sequence's pictures, which may be numbers with a sign or a fraction. A
// single name does not decide that (t-1 is no negative number, and 1.10 may be the tenth or 1.1),
// but all of them do: where they differ in one number only, which has a fraction of several
// lengths that never ends in 0, as programs print times (0.5, 0.53333), its fraction counts as
// decimals; and where that number begins each name, a minus before it is its sign. Else as
// comes_before.
void sort_sequence(std::vector<std::string>& names);

// The whole number that alone differs between the names, of each name; empty where they differ
// otherwise, or where one is too long for 64 bits.
std::vector<int64_t> counters_of(const std::vector<std::string>& names);

}  // namespace cli
