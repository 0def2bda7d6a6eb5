#include "files/sequence_order.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "base/silence.h"
#include "files/exif.h"
#include "files/folder.h"
#include "files/name_dates.h"
#include "files/natural_order.h"

namespace cli {
namespace {

namespace fs = std::filesystem;

using Order = std::vector<size_t>;  // indices of the given names
using Edge = std::pair<size_t, size_t>;

// At most so many pairs of neighbours are compared of each order: evenly spread over the pairs that
// are neighbours in this order and not in the other one.
constexpr size_t kMostEdges = 24;
constexpr double kSigmas = 3;
constexpr size_t kLeastEdges = 6;  // fewer say nothing of the spread

struct Candidate {
  Order order;
  std::string by;        // "their EXIF times"
  bool is_said = false;  // also where the pictures do not decide
};

Order identity(size_t count) {
  Order order(count);
  std::iota(order.begin(), order.end(), size_t{0});
  return order;
}

template <class Before>
Order sorted_by(size_t count, const Before& before) {
  Order order = identity(count);
  std::stable_sort(order.begin(), order.end(), before);
  return order;
}

void add_dates(const std::vector<std::string>& names, std::vector<Candidate>& candidates) {
  // The first and the last one tell whether there are dates.
  const std::vector<std::string> ends = {names.front(), names.back()};
  const std::pair<DateReading, const char*> readings[] = {
      {DateReading::kDayMonth, "the dates and times in their names (day, month, year)"},
      {DateReading::kMonthDay, "the dates and times in their names (month, day, year)"},
      {DateReading::kDayMonthTwo, "the dates in their names (day, month, year of two digits)"},
      {DateReading::kMonthDayTwo, "the dates in their names (month, day, year of two digits)"}};
  for (const auto& [reading, by] : readings) {
    if (sortable_names(ends, reading).empty()) continue;
    const std::vector<std::string> texts = sortable_names(names, reading);
    if (texts.empty()) continue;
    candidates.push_back(
        {sorted_by(names.size(),
                   [&](size_t i, size_t j) { return comes_before(texts[i], texts[j]); }),
         by, reading == DateReading::kDayMonth || reading == DateReading::kMonthDay});
  }
}

// Names that differ in more than one number may count with letters.
void add_counters(const std::vector<std::string>& names, std::vector<Candidate>& candidates) {
  if (!counters_of(names).empty()) return;
  const auto before = [&](size_t i, size_t j) {
    const std::string a = fs::path(names[i]).stem().string();
    const std::string b = fs::path(names[j]).stem().string();
    return a.size() != b.size() ? a.size() < b.size() : a < b;
  };
  candidates.push_back({sorted_by(names.size(), before), "their names as counters with letters"});
  candidates.push_back(
      {sorted_by(names.size(), [&](size_t i, size_t j) { return names[i] < names[j]; }),
       "their names by letters"});
}

void add_begun_anew(const std::vector<std::string>& names, std::vector<Candidate>& candidates) {
  const size_t at = begun_anew_at(names);
  if (at == 0) return;
  Order order = identity(names.size());
  std::rotate(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(at), order.end());
  candidates.push_back({order, "their counter, which began anew"});
}

// Empty where a picture has no time.
std::vector<double> exif_times(const fs::path& folder, const std::vector<std::string>& names) {
  std::vector<double> times;
  for (const std::string& name : names) {
    times.push_back(exif_time_s(picture_head((folder / name).string())));
    if (!(times.back() > 0)) return {};
  }
  return times;
}

bool falls(const std::vector<double>& times, const Order& order) {
  for (size_t k = 1; k < order.size() && !times.empty(); ++k)
    if (times[order[k]] < times[order[k - 1]]) return true;
  return false;
}

std::set<Edge> edges_of(const Order& order) {
  std::set<Edge> edges;
  for (size_t k = 1; k < order.size(); ++k) edges.insert(std::minmax(order[k - 1], order[k]));
  return edges;
}

std::vector<Edge> some(const std::vector<Edge>& edges) {
  std::vector<Edge> few;
  const size_t count = std::min(edges.size(), kMostEdges);
  for (size_t k = 0; k < count; ++k) few.push_back(edges[k * edges.size() / count]);
  return few;
}

// The neighbours of each picture in two orders.
using Neighbours = std::map<size_t, std::set<size_t>>;
Neighbours neighbours_of(const std::set<Edge>& one, const std::set<Edge>& other) {
  Neighbours neighbours;
  for (const std::set<Edge>* edges : {&one, &other})
    for (const auto& [i, j] : *edges) {
      neighbours[i].insert(j);
      neighbours[j].insert(i);
    }
  return neighbours;
}

// How much pictures differ.
class Differences {
 public:
  Differences(const fs::path& folder, const std::vector<std::string>& names)
      : folder_(folder), names_(names) {}

  // For each edge (two neighbouring pictures): the logarithm of the difference of the two, over
  // that of each of them from the most similar of its other neighbours. It is about 0 where a
  // camera moves evenly, however fast. Edges of pictures that cannot be compared are left out.
  std::vector<double> of(const std::vector<Edge>& edges, const Neighbours& neighbours) {
    std::vector<double> logs;
    for (const auto& [i, j] : edges) {
      const double own = of(i, j);
      const double usual = 0.5 * (least(i, j, neighbours) + least(j, i, neighbours));
      if (std::isfinite(own) && std::isfinite(usual)) logs.push_back(own - usual);
    }
    return logs;
  }

 private:
  double of(size_t i, size_t j) {
    const cv::Mat &a = picture(i), &b = picture(j);
    if (a.empty() || a.size() != b.size()) return std::nan("");
    constexpr double kLeast = 0.1;  // grey levels: equal pictures
    return std::log(kLeast + cv::norm(a, b, cv::NORM_L1) / static_cast<double>(a.total()));
  }
  double least(size_t i, size_t without, const Neighbours& neighbours) {
    double least = std::nan("");
    for (const size_t j : neighbours.at(i))
      if (j != without) least = std::fmin(least, of(i, j));
    return least;
  }
  const cv::Mat& picture(size_t i) {
    const auto [at, is_new] = pictures_.try_emplace(i);
    if (!is_new) return at->second;
    const StderrSilence silence;
    try {
      at->second = cv::imread((folder_ / names_[i]).string(), cv::IMREAD_REDUCED_GRAYSCALE_8);
    } catch (const cv::Exception&) {
    }
    return at->second;
  }

  const fs::path& folder_;
  const std::vector<std::string>& names_;
  std::map<size_t, cv::Mat> pictures_;
};

struct Sample {
  double mean = 0, variance = 0, count = 0;
};
Sample sample_of(const std::vector<double>& values) {
  Sample sample;
  sample.count = static_cast<double>(values.size());
  for (const double value : values) sample.mean += value / sample.count;
  for (const double value : values)
    sample.variance +=
        (value - sample.mean) * (value - sample.mean) / std::max(1.0, sample.count - 1);
  return sample;
}

// By how many standard deviations the neighbours of `order` that are none of `other` look more
// alike than those of `other` that are none of `order`; the spread is that of the neighbours of
// the one that looks the more even.
double evidence(Differences& differences, const Order& order, const Order& other) {
  const std::set<Edge> own = edges_of(order), others = edges_of(other);
  std::vector<Edge> own_only, others_only, common;
  std::set_difference(own.begin(), own.end(), others.begin(), others.end(),
                      std::back_inserter(own_only));
  std::set_difference(others.begin(), others.end(), own.begin(), own.end(),
                      std::back_inserter(others_only));
  std::set_intersection(own.begin(), own.end(), others.begin(), others.end(),
                        std::back_inserter(common));
  const Neighbours neighbours = neighbours_of(own, others);
  const std::vector<double> a = differences.of(some(own_only), neighbours);
  const std::vector<double> b = differences.of(some(others_only), neighbours);
  if (a.empty() || b.empty()) return 0;
  std::vector<double> with_a = differences.of(some(common), neighbours), with_b = with_a;
  with_a.insert(with_a.end(), a.begin(), a.end());
  with_b.insert(with_b.end(), b.begin(), b.end());
  const Sample of_a = sample_of(a), of_b = sample_of(b);
  if (with_a.size() < kLeastEdges) return 0;
  const double variance = std::min(sample_of(with_a).variance, sample_of(with_b).variance);
  return (of_b.mean - of_a.mean) / std::sqrt(variance * (1 / of_a.count + 1 / of_b.count) + 1e-12);
}

// The first place where the orders differ, in words: "b.png after a.png, not after c.png".
std::string difference_words(const std::vector<std::string>& names, const Order& order,
                             const Order& other) {
  std::map<size_t, size_t> before;
  for (size_t k = 1; k < other.size(); ++k) before[other[k]] = other[k - 1];
  for (size_t k = 1; k < order.size(); ++k) {
    const auto at = before.find(order[k]);
    if (at != before.end() && at->second == order[k - 1]) continue;
    return names[order[k]] + " behind " + names[order[k - 1]] + ", not " +
           (at == before.end() ? "as the first" : "behind " + names[at->second]);
  }
  return "";
}

}  // namespace

SequenceOrder sequence_order(const fs::path& folder, const std::vector<std::string>& names) {
  const Order by_names = identity(names.size());
  std::vector<Candidate> candidates;
  add_dates(names, candidates);
  add_counters(names, candidates);
  add_begun_anew(names, candidates);
  const std::vector<double> times = exif_times(folder, names);
  if (falls(times, by_names))
    candidates.push_back(
        {sorted_by(names.size(), [&](size_t i, size_t j) { return times[i] < times[j]; }),
         "their EXIF times", true});
  Differences differences(folder, names);
  const Candidate natural{by_names, "the numbers in their names"};
  const Candidate* best = &natural;
  const Candidate* open = nullptr;  // which the pictures neither confirm nor refute
  for (const Candidate& candidate : candidates) {
    if (candidate.order == best->order) continue;
    const double sigmas = evidence(differences, candidate.order, best->order);
    if (sigmas > kSigmas)
      best = &candidate;
    else if (candidate.is_said && sigmas > -kSigmas && open == nullptr)
      open = &candidate;
  }
  SequenceOrder result;
  for (const size_t i : best->order) result.names.push_back(names[i]);
  if (best != &natural)
    result.note = "the pictures are taken in the order of " + best->by + ", in which neighbours " +
                  "look alike, and not of " + natural.by + ": " +
                  difference_words(names, best->order, by_names);
  else if (open != nullptr)
    result.note = "the order of " + natural.by + " is used, and " + open->by +
                  " contradict it, while the pictures do not decide: " +
                  difference_words(names, open->order, by_names) +
                  " by these; rename the pictures, or list their times in frames.txt";
  return result;
}

}  // namespace cli
