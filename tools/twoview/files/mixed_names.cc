#include "files/mixed_names.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <map>
#include <set>

namespace cli {
namespace {

constexpr size_t kFewest = 3;  // names of a kind

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Whether the text ends in "cam" or "camera", in letters of any case.
bool ends_in_camera(const std::string& text) {
  std::string lower = text;
  for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const std::string word : {"cam", "camera"})
    if (lower.size() >= word.size() &&
        lower.compare(lower.size() - word.size(), word.size(), word) == 0)
      return true;
  return false;
}

// A name without its numbers, "#" in place of each, and these, without zeros before them; a minus
// at the beginning is the sign of a number.
struct Parts {
  std::string kind, numbers;
};
Parts parts_of(const std::string& stem) {
  Parts parts;
  const bool is_negative = stem.size() > 1 && stem[0] == '-' && is_digit(stem[1]);
  if (is_negative) parts.numbers = '-';
  for (size_t at = is_negative ? 1 : 0; at < stem.size();) {
    size_t end = at;
    while (end < stem.size() && is_digit(stem[end])) ++end;
    if (end == at) {
      parts.kind += stem[at++];
    } else if (ends_in_camera(parts.kind)) {
      parts.kind += stem.substr(at, end - at);
      at = end;
    } else {
      while (at + 1 < end && stem[at] == '0') ++at;
      parts.kind += '#';
      parts.numbers += stem.substr(at, end - at) + '/';
      at = end;
    }
  }
  return parts;
}

bool is_hexadecimal(const std::string& stem) {
  return std::all_of(stem.begin(), stem.end(),
                     [](unsigned char c) { return std::isxdigit(c) != 0; });
}

}  // namespace

std::string mixed_names(const std::vector<std::string>& names) {
  std::map<std::string, std::set<std::string>> kinds;
  bool all_hexadecimal = true;
  for (const std::string& name : names) {
    const std::string stem = std::filesystem::path(name).stem().string();
    all_hexadecimal = all_hexadecimal && is_hexadecimal(stem);
    const Parts parts = parts_of(stem);
    if (!parts.numbers.empty()) kinds[parts.kind].insert(parts.numbers);
  }
  if (all_hexadecimal) return "";
  for (auto a = kinds.begin(); a != kinds.end(); ++a)
    for (auto b = std::next(a); b != kinds.end() && a->second.size() >= kFewest; ++b) {
      const size_t fewer = std::min(a->second.size(), b->second.size());
      const auto shared = static_cast<size_t>(
          std::count_if(a->second.begin(), a->second.end(),
                        [&b](const std::string& number) { return b->second.count(number) != 0; }));
      if (fewer < kFewest || 2 * shared < fewer) continue;
      return "as " + a->first + " (" + std::to_string(a->second.size()) + ") and as " + b->first +
             " (" + std::to_string(b->second.size()) + ")";
    }
  return "";
}

}  // namespace cli
