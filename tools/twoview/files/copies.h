// Copies of pictures that lie beside their originals, as file managers, browsers and clouds leave
// them: "0000 (1).jpg", "0000 - Copy.jpg", "Copy of 0000.jpg", "0000~2.jpg".
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cli {

// The mark by which a file's name says that the file is a copy.
enum class CopyMark {
  kNone,
  kWord,       // "a - Copy (2)", "a (another copy)", "Kopie von a"
  kNumber,     // "a (1)", "a~2": a copy, or one of a series
  kBareNumber  // "a 2", "a_2", "a-2": seldom a copy
};

struct CopyName {
  CopyMark mark = CopyMark::kNone;
  std::string original;  // the name without the mark
};

// Takes one mark off a name without its ending; kNone where there is none. It is the twin of
// copy_name in tools/python/twoview_tools/folders.py; both run the cases of
// test/formats/copies.json.
CopyName copy_name(const std::string& stem);

struct Copies {
  std::vector<std::string> names;  // in the given order
  std::string note;  // on names of copies that show something else; empty where there are none
};

// Which of a folder's pictures are copies. A name alone does not say so, since "a (1)", "a (2)",
// ... may be a series, and a bytewise equal picture alone does not, since a camera or a film may
// stand still: a copy has the name of another picture of the folder with a mark behind it, and
// shows the same. Bytes that are equal show the same unless other pictures of the same original
// name differ; a picture that was stored anew shows the same where the two correlate, as closely as
// the mark is ambiguous, and all the folder's marked names do.
Copies copies_of(const std::filesystem::path& folder, const std::vector<std::string>& names);

// Whether two files hold the same bytes; false where one cannot be read.
bool have_same_bytes(const std::filesystem::path& a, const std::filesystem::path& b);

}  // namespace cli
