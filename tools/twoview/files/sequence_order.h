// The order in which the pictures of a folder were taken, where their names and other evidence
// contradict each other.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace cli {

struct SequenceOrder {
  std::vector<std::string> names;
  std::string note;  // names the orders that contradict each other; empty where none do
};

// The order of pictures whose names are given in that of sort_sequence. Other orders are those of
// the EXIF times (DateTimeOriginal with its fraction), of dates and times in the names, of counters
// of letters or of base 16 and 36, and that of a counter that began anew after 9999. Where one of
// these differs, the pictures decide: neighbours of the right order look more alike, and by more
// than chance gives (three standard deviations of what neighbours differ by). Where they do not,
// the names' order stays, and the note names both.
SequenceOrder sequence_order(const std::filesystem::path& folder,
                             const std::vector<std::string>& names);

}  // namespace cli
