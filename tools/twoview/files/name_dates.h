// Dates and times within names, written in an order in which they do not sort.
#pragma once

#include <string>
#include <vector>

namespace cli {

// The parts of a date before or behind a year; kTwo: of years of two digits, which come last.
enum class DateReading { kDayMonth, kMonthDay, kDayMonthTwo, kMonthDayTwo };

// The names with their dates as year-month-day, months as numbers and times of twelve hours (AM,
// PM) as of twenty-four, so that they sort; empty where no name has any of these, or where a
// date's month is none by this reading.
std::vector<std::string> sortable_names(const std::vector<std::string>& names, DateReading reading);

}  // namespace cli
