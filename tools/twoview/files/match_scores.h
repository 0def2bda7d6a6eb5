// How certain the matches of a file are.
#pragma once

#include <string>
#include <vector>

namespace cli {

// The names of columns and arrays that hold how certain a match is: the lower the better (a ratio,
// a distance), or the higher.
const std::vector<std::string>& score_names(bool lower_is_better);

// MatchList::ratios of scores: 0 to 1 is kept, a wider range is brought to it. Throws BadInput for
// one that is not finite.
std::vector<float> ratios_of(const std::vector<double>& scores, bool lower_is_better,
                             const std::string& name);

}  // namespace cli
