#include "files/match_scores.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"

namespace cli {

const std::vector<std::string>& score_names(bool lower_is_better) {
  static const std::vector<std::string> kLower = {"ratio", "ratios", "distance", "distances"};
  static const std::vector<std::string> kHigher = {
      "score", "scores", "mscores",   "match_scores",    "confidence",      "match_confidence",
      "conf",  "mconf",  "certainty", "matching_scores", "matching_scores0"};
  return lower_is_better ? kLower : kHigher;
}

std::vector<float> ratios_of(const std::vector<double>& scores, bool lower_is_better,
                             const std::string& name) {
  for (size_t i = 0; i < scores.size(); ++i)
    if (!std::isfinite(scores[i]))
      throw BadInput(name + ": the score of match " + std::to_string(i) + " is not finite");
  double low = 0, high = 1;
  for (const double score : scores) low = std::min(low, score), high = std::max(high, score);
  std::vector<float> ratios;
  for (const double score : scores)
    ratios.push_back(
        static_cast<float>((lower_is_better ? score - low : high - score) / (high - low)));
  return ratios;
}

}  // namespace cli
