#include "files/name_dates.h"

#include <array>
#include <cctype>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <regex>

namespace cli {
namespace {

constexpr std::array<const char*, 12> kMonths = {"jan", "feb", "mar", "apr", "may", "jun",
                                                 "jul", "aug", "sep", "oct", "nov", "dec"};

struct Patterns {
  std::regex month{
      "(^|[^a-z])(jan|feb|mar|apr|may|jun|jul|aug|sep|oct|nov|dec)"
      "(uary|ruary|ch|il|e|y|ust|t|tember|ober|ember)?(?=[^a-z]|$)"};
  std::regex hour{"(^|[^0-9])([0-9]{1,2})((?:[-_.: ]?[0-9]{2}){0,2})[ _.-]*([ap])\\.?m(?![a-z])"};
  std::regex four{"(^|[^0-9])([0-9]{1,2})([-_. ]?)([0-9]{1,2})\\3((?:19|20)[0-9]{2})(?=[^0-9]|$)"};
  std::regex two{"(^|[^0-9])([0-9]{1,2})([-_. ])([0-9]{1,2})\\3([0-9]{2})(?=[^0-9]|$)"};
};

const Patterns& patterns() {
  static const Patterns all;
  return all;
}

std::string two_digits(int number) {
  char text[16];
  std::snprintf(text, sizeof text, "%02d", number);
  return text;
}

// Replaces the first place that the pattern finds; false where it finds none.
template <class Words>
bool replace_first(std::string& text, const std::regex& pattern, const Words& words) {
  std::smatch match;
  if (!std::regex_search(text, match, pattern)) return false;
  text = match.prefix().str() + match[1].str() + words(match) + match.suffix().str();
  return true;
}

bool write_month(std::string& name) {
  return replace_first(name, patterns().month, [](const std::smatch& match) {
    size_t month = 0;
    while (month < kMonths.size() && match[2].str() != kMonths[month]) ++month;
    return two_digits(static_cast<int>(month) + 1);
  });
}

bool write_hour(std::string& name) {
  return replace_first(name, patterns().hour, [](const std::smatch& match) {
    const int hour = std::atoi(match[2].str().c_str()) % 12 + (match[4].str() == "p" ? 12 : 0);
    return two_digits(hour) + match[3].str();
  });
}

// Nothing: the month is none.
std::optional<bool> write_date(std::string& name, DateReading reading) {
  const bool is_two = reading == DateReading::kDayMonthTwo || reading == DateReading::kMonthDayTwo;
  const bool is_day_first =
      reading == DateReading::kDayMonth || reading == DateReading::kDayMonthTwo;
  bool is_date = true;
  const bool found =
      replace_first(name, is_two ? patterns().two : patterns().four, [&](const std::smatch& match) {
        const int first = std::atoi(match[2].str().c_str());
        const int second = std::atoi(match[4].str().c_str());
        const int month = is_day_first ? second : first, day = is_day_first ? first : second;
        is_date = month >= 1 && month <= 12 && day >= 1 && day <= 31;
        return match[5].str() + "-" + two_digits(month) + "-" + two_digits(day);
      });
  if (found && !is_date) return {};
  return found;
}

}  // namespace

std::vector<std::string> sortable_names(const std::vector<std::string>& names,
                                        DateReading reading) {
  std::vector<std::string> sortable;
  bool any = false;
  for (const std::string& name : names) {
    std::string text = name;
    for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    const bool has_month = write_month(text), has_hour = write_hour(text);
    const std::optional<bool> has_date = write_date(text, reading);
    if (!has_date) return {};
    any = any || has_month || has_hour || *has_date;
    sortable.push_back(std::move(text));
  }
  if (!any) sortable.clear();
  return sortable;
}

}  // namespace cli
