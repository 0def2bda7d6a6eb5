#include "files/match_folder.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>
#include <vector>

#include "base/error.h"

namespace cli {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

const Names kBetween = {"_", "-", "__", "--", "+", " "};
const Names kBehind = {"_matches", "-matches", ""};
const Names kEndings = {".npz", ".npy", ".csv", ".txt", ".tsv"};

std::string with_slashes_as(std::string name, const std::string& replacement) {
  for (size_t at; (at = name.find('/')) != std::string::npos;) name.replace(at, 1, replacement);
  return name;
}

std::string without_extension(const std::string& name) {
  const size_t slash = name.rfind('/'), dot = name.rfind('.');
  const bool has_one = dot != std::string::npos && (slash == std::string::npos || dot > slash + 1);
  return has_one ? name.substr(0, dot) : name;
}

// How the two names of a pair are written in a file's name: whole, with its folders as part of the
// name, or without them; each with and without the pictures' extension.
std::vector<std::pair<std::string, std::string>> forms_of(const std::string& name0,
                                                          const std::string& name1) {
  std::vector<std::pair<std::string, std::string>> forms;
  for (const bool has_extension : {false, true}) {
    const std::string a = has_extension ? name0 : without_extension(name0);
    const std::string b = has_extension ? name1 : without_extension(name1);
    for (const char* const slash : {"-", "_"})
      forms.emplace_back(with_slashes_as(a, slash), with_slashes_as(b, slash));
    const std::string base0 = a.substr(a.rfind('/') + 1), base1 = b.substr(b.rfind('/') + 1);
    forms.emplace_back(base0, base1);
    if (a.find('/') == std::string::npos) continue;
    const std::string folder = a.substr(0, a.rfind('/') + 1);
    forms.emplace_back(folder + base0, base1);  // in the same folder as the first picture
  }
  std::sort(forms.begin(), forms.end());
  forms.erase(std::unique(forms.begin(), forms.end()), forms.end());
  return forms;
}

Names fitting(const std::set<std::string>& files, const std::string& name0,
              const std::string& name1) {
  std::set<std::string> found;
  for (const auto& [a, b] : forms_of(name0, name1))
    for (const std::string& between : kBetween)
      for (const std::string& behind : kBehind)
        for (const std::string& ending : kEndings) {
          const std::string file = a + between + b + behind + ending;
          if (files.count(file) != 0) found.insert(file);
        }
  return {found.begin(), found.end()};
}

}  // namespace

std::string match_file_of(const std::set<std::string>& files, const std::string& name0,
                          const std::string& name1) {
  const Names found = fitting(files, name0, name1);
  if (found.size() > 1)
    throw BadInput(found[0] + " and " + found[1] + " both fit " + name0 + " and " + name1);
  return found.empty() ? std::string() : found[0];
}

MatchFolder::MatchFolder(const std::string& folder) : folder_(folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error))
    throw BadInput("--matches: " + folder + " is not a folder: it needs a file for each pair");
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder, error)) {
    const std::string ending = entry.path().extension().string();
    if (std::find(kEndings.begin(), kEndings.end(), ending) != kEndings.end())
      files_.insert(fs::relative(entry.path(), folder, error).generic_string());
  }
  if (files_.empty())
    throw BadInput("--matches: " + folder +
                   " has no file of matches (.npz, .npy, .csv, .txt) in "
                   "it");
}

std::string MatchFolder::file_of(const std::string& name0, const std::string& name1,
                                 bool* is_exchanged) {
  std::string file = match_file_of(files_, name0, name1);
  *is_exchanged = file.empty() && name0 != name1;
  if (file.empty()) file = match_file_of(files_, name1, name0);
  if (file.empty())
    throw BadInput("no file of matches for " + name0 + " and " + name1 + " in " + folder_ +
                   ", such as " + fs::path(name0).stem().string() + "_" +
                   fs::path(name1).stem().string() + "_matches.npz");
  const std::pair<std::string, std::string> pair = std::minmax(name0, name1);
  const auto [used, is_new] = used_.emplace(file, pair);
  if (!is_new && used->second != pair)
    throw BadInput((fs::path(folder_) / file).string() + " fits " + name0 + " and " + name1 +
                   " as well as " + used->second.first + " and " + used->second.second);
  return file;
}

MatchList MatchFolder::matches_of(const std::string& name0, const std::string& name1,
                                  std::string* name) {
  bool is_exchanged = false;
  *name = (fs::path(folder_) / file_of(name0, name1, &is_exchanged)).string();
  MatchList matches = load_matches(*name);
  if (is_exchanged) std::swap(matches.pixels[0], matches.pixels[1]);
  return matches;
}

}  // namespace cli
