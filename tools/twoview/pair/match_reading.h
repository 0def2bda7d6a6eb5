// Whether the pixels of another program's matches are those of the pictures: by how alike the
// pictures are there, as the pixels stand and as they may have been meant.
#pragma once

#include <string>

#include "files/image_file.h"
#include "files/match_list.h"

namespace cli {

// Throws BadInput where the pictures are clearly more alike at the matches, which are of the
// pictures as they are used, once their numbers are read in another way: the sides exchanged; row
// before column, y counted from below or, with `may_be_smaller`, of pictures made smaller, in one
// image or in both; of pictures that were cut or framed, in both. The error names that way.
// Returns whether the pictures are alike at enough of the matches. Far views of a scene, and turned
// ones, are not, though their matches may be right.
bool require_reading(const Picture pictures[2], bool may_be_smaller, const std::string& name,
                     const MatchList& matches);

}  // namespace cli
