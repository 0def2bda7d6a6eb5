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
  std::vector<std::string> names;  // in the order of sort_sequence
  std::vector<LeftOut> left_out;
  std::string note;  // on names of copies that are none (files/copies.h); may be empty
};

// The pictures of a folder by their endings, without those of its subfolders. Files that begin with
// a dot (as ._0000.jpg, which macOS writes beside 0000.jpg) and pictures of formats that are not
// read are left out, and so are second pictures of a name (0000.png beside 0000.jpg: the same
// picture, its mask or its depths), of the ending that fewer have, and copies ("0000 (1).jpg"
// beside 0000.jpg, files/copies.h); tools/python/twoview_tools/folders.py is the twin of both. A
// link to a file that is not there is among the names, since its picture is missing. Other files
// are no pictures, and not mentioned. Throws BadInput where the folder cannot be read.
FolderPictures pictures_of(const std::filesystem::path& folder);

// Whether the file's ending is that of an image format that the program reads.
bool has_picture_ending(const std::filesystem::path& path);

// A line where the numbers of a sequence's names jump, so that pictures may be missing; else empty.
std::string jump_words(const std::vector<std::string>& names);

// The place in a sequence of names where a camera's counter jumps, as if it had begun anew after
// 9999: the names from that place on were then taken first. 0: there is no such place.
size_t begun_anew_at(const std::vector<std::string>& names);

// The first bytes of a picture's file, in which its size and its EXIF data stand.
std::string picture_head(const std::string& path);

// The size in pixels by the file's header; 0x0 where it does not tell.
cv::Size header_size(const std::string& path);

// The size that most of these have, the first one's on a tie; sizes of 0x0 do not count.
cv::Size most_frequent(const std::vector<cv::Size>& sizes);

// Why a picture of this size is left out of those of another: "is 10x10, not 320x240 as most are".
std::string other_size_words(cv::Size own, cv::Size usual);

}  // namespace cli
