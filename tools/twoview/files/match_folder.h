// A folder with a file of matches for each pair of a list.
#pragma once

#include <map>
#include <set>
#include <string>

#include "files/matches_file.h"

namespace cli {

// Finds the file of a pair by the names of its two pictures, as the common matchers name it:
// NAME0_NAME1_matches.npz, NAME0-NAME1.csv and the like; docs/formats.md has the rule.
class MatchFolder {
 public:
  // Throws BadInput where it is no folder, or has no file of matches in it.
  explicit MatchFolder(const std::string& folder);

  // The matches of a pair, exchanged where the file is of the pair in the other order; *name is the
  // file's path then. Throws BadInput where there is no file or where two would serve, and where
  // one would serve two pairs.
  MatchList matches_of(const std::string& name0, const std::string& name1, std::string* name);

  // The path within the folder of the file with a pair's matches. *is_exchanged: whether the file
  // is named after the pair in the other order.
  std::string file_of(const std::string& name0, const std::string& name1, bool* is_exchanged);

 private:
  std::string folder_;
  std::set<std::string> files_;                                      // paths in the folder
  std::map<std::string, std::pair<std::string, std::string>> used_;  // the pair of each file
};

// The same of a list of files, for tests.
std::string match_file_of(const std::set<std::string>& files, const std::string& name0,
                          const std::string& name1);

}  // namespace cli
