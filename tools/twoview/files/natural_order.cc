#include "files/natural_order.h"

#include <algorithm>
#include <charconv>
#include <set>

namespace cli {
namespace {

bool is_digit(char c) { return c >= '0' && c <= '9'; }

// Takes the run of digits at the beginning of the text, without its leading zeros.
std::string_view take_number(std::string_view& text) {
  const auto end =
      static_cast<size_t>(std::find_if_not(text.begin(), text.end(), is_digit) - text.begin());
  std::string_view digits = text.substr(0, end);
  text.remove_prefix(end);
  digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
  return digits;
}

// / first, so that the files of a folder stay together; then the dot, so that a.png, to which a
// second picture of the name is "a (1).png" or a-1.png, comes before that one.
// Capitals count as small letters: IMG_1.JPG, img_2.jpg.
int rank(char c) {
  if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return c == '/' ? 0 : c == '.' ? 1 : 2 + static_cast<unsigned char>(c);
}

// The runs of digits of a name: begin and end of each.
std::vector<std::pair<size_t, size_t>> runs_of(std::string_view name) {
  std::vector<std::pair<size_t, size_t>> runs;
  for (size_t at = 0; at < name.size(); ++at) {
    if (!is_digit(name[at])) continue;
    const size_t begin = at;
    while (at < name.size() && is_digit(name[at])) ++at;
    runs.emplace_back(begin, at);
  }
  return runs;
}

// A name in three parts: what stands before a number, the number, and what follows it.
struct Parts {
  std::string_view before, number, after;
};

// The names around their run of digits that is the `from_end`-th before the ending; with_fraction
// also what belongs to its number: the run before a dot, and a sign at the name's beginning. Empty
// where the names differ in something else, but for the ending.
std::vector<Parts> parts_at(const std::vector<std::string>& names, size_t from_end,
                            bool with_fraction) {
  std::vector<Parts> parts;
  for (const std::string& whole : names) {
    const std::string_view name = whole;
    const auto runs = runs_of(name.substr(0, name.rfind('.')));
    if (from_end >= runs.size()) return {};
    const size_t r = runs.size() - 1 - from_end;
    auto [begin, end] = runs[r];
    if (with_fraction) {
      if (r > 0 && begin == runs[r - 1].second + 1 && name[begin - 1] == '.')
        begin = runs[r - 1].first;
      if (begin == 1 && (name[0] == '-' || name[0] == '+')) begin = 0;
    }
    parts.push_back({name.substr(0, begin), name.substr(begin, end - begin), name.substr(end)});
    const std::string_view after = parts.back().after, first_after = parts[0].after;
    if (parts.back().before != parts[0].before ||
        after.substr(0, after.rfind('.')) != first_after.substr(0, first_after.rfind('.')))
      return {};
  }
  return parts;
}

// Splits all names at the one number in which they differ; empty where there is no such number.
std::vector<Parts> parts_of(const std::vector<std::string>& names, bool with_fraction) {
  if (names.size() < 2) return {};
  for (size_t from_end = 0; from_end < runs_of(names[0]).size(); ++from_end) {
    std::vector<Parts> parts = parts_at(names, from_end, with_fraction);
    if (!parts.empty()) return parts;
  }
  return {};
}

bool has_fraction(const Parts& part) { return part.number.find('.') != std::string_view::npos; }

// Whether these numbers are printed with as many digits as each has: 0.5, 0.53333, 1.0.
bool are_decimals(const std::vector<Parts>& parts) {
  std::set<size_t> lengths;
  for (const Parts& part : parts) {
    const size_t dot = part.number.find('.');
    const std::string_view fraction = has_fraction(part) ? part.number.substr(dot + 1) : "";
    if (fraction.size() > 1 && fraction.back() == '0') return false;
    lengths.insert(fraction.size());
  }
  return lengths.size() > 1;
}

bool have_sign(const std::vector<Parts>& parts) {
  return std::any_of(parts.begin(), parts.end(),
                     [](const Parts& part) { return part.number[0] == '-'; });
}

// -1, 0 or 1 as the decimal number a is below, equal to or above b; numbers of any length.
int compare_decimals(std::string_view a, std::string_view b) {
  const bool is_negative = a[0] == '-';
  if (is_negative != (b[0] == '-')) return is_negative ? -1 : 1;
  const auto bare = [](std::string_view& x) {
    if (x[0] == '-' || x[0] == '+') x.remove_prefix(1);
    return take_number(x);
  };
  const std::string_view m = bare(a), n = bare(b);
  int order = m.size() != n.size() ? (m.size() < n.size() ? -1 : 1) : m.compare(n);
  if (order == 0) order = a.compare(b);  // the fractions, from their dots
  return is_negative ? -order : order;
}

}  // namespace

bool comes_before(std::string_view a, std::string_view b) {
  std::string_view x = a, y = b;
  while (!x.empty() && !y.empty()) {
    if (is_digit(x[0]) && is_digit(y[0])) {
      const std::string_view m = take_number(x), n = take_number(y);
      if (m.size() != n.size()) return m.size() < n.size();
      if (m != n) return m < n;
      continue;
    }
    if (rank(x[0]) != rank(y[0])) return rank(x[0]) < rank(y[0]);
    x.remove_prefix(1);
    y.remove_prefix(1);
  }
  if (x.empty() != y.empty()) return x.empty();
  return a < b;
}

void sort_sequence(std::vector<std::string>& names) {
  std::sort(names.begin(), names.end(), comes_before);
  const std::vector<Parts> parts = parts_of(names, true);
  const bool are_whole = std::none_of(parts.begin(), parts.end(), has_fraction);
  if (!are_decimals(parts) && !(are_whole && have_sign(parts))) return;
  std::vector<size_t> order(names.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](size_t i, size_t j) {
    return compare_decimals(parts[i].number, parts[j].number) < 0;
  });
  std::vector<std::string> sorted;
  for (const size_t i : order) sorted.push_back(names[i]);
  names = std::move(sorted);
}

std::vector<int64_t> counters_of(const std::vector<std::string>& names) {
  if (are_decimals(parts_of(names, true))) return {};
  std::vector<int64_t> counters;
  for (const Parts& part : parts_of(names, false)) {
    int64_t value = 0;
    const char* const end = part.number.data() + part.number.size();
    if (std::from_chars(part.number.data(), end, value).ec != std::errc()) return {};
    counters.push_back(value);
  }
  return counters;
}

}  // namespace cli
