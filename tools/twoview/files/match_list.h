// The matches of two images, as a file has them.
#pragma once

#include <string>
#include <vector>

namespace cli {

constexpr size_t kMaxMatches = 1000000;  // the library's limit of max_matches of a context

struct MatchList {
  std::vector<double> pixels[2];  // [image]: x y of each match
  // Empty, or a value of each match, [0, 1]; the lower it is, the more certain is the match
  // (tv_correspondence.ratio). A score s of which a higher one is better is 1 - s.
  std::vector<float> ratios;
  // The columns or arrays of the file that were not used.
  std::vector<std::string> left_out;
  bool fit_pictures = true;  // the pictures look alike at enough of the matches
  size_t size() const { return pixels[0].size() / 2; }
};

}  // namespace cli
