// Matches in arrays of numpy, as the common matchers are saved: .npz and .npy.
#pragma once

#include <string>
#include <string_view>

#include "files/match_list.h"

namespace cli {

// Whether the bytes are a binary file, which parse_match_arrays reads or refuses by its name.
bool holds_arrays(std::string_view bytes);

// Reads matched pixels, or keypoints and the indices that match them. Throws BadInput, with the
// name of the array, for shapes and indices that do not fit.
MatchList parse_match_arrays(std::string_view bytes, const std::string& name);

}  // namespace cli
