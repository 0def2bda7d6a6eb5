// Folders of pictures, and lists of pictures that the user names: which of them are used, in which
// order, and one line on those that are not. Every verb that reads several pictures of one camera
// follows this rule: what cannot be used is left out and named, and a run is refused only where
// nothing is left.
#pragma once

#include <filesystem>
#include <opencv2/core/types.hpp>
#include <string>
#include <vector>

namespace cli {

// A file that is not used, and why: `reason` continues its name, such as "begins with a dot".
struct LeftOut {
  std::string name, reason;
};

// One line without an end: how many pictures of `where` are left out, and for each reason the first
// of them; empty if there are none.
std::string left_out_words(const std::vector<LeftOut>& left_out, const std::string& where);

struct FolderPictures {
  std::vector<std::string> names;  // in their natural order
  std::vector<LeftOut> left_out;
};

// The pictures of a folder by their endings, without those of its subfolders. Files that begin with
// a dot (as ._0000.jpg, which macOS writes beside 0000.jpg) and pictures of formats that are not
// read are left out. Other files are no pictures, and not mentioned. Throws BadInput where the
// folder cannot be read.
FolderPictures pictures_of(const std::filesystem::path& folder);

// The size in pixels by the file's header; 0x0 where it does not tell.
cv::Size header_size(const std::string& path);

// The size that most of these have, the first one's on a tie; sizes of 0x0 do not count.
cv::Size most_frequent(const std::vector<cv::Size>& sizes);

// Why a picture of this size is left out of those of another: "is 10x10, not 320x240 as most are".
std::string other_size_words(cv::Size own, cv::Size usual);

}  // namespace cli
