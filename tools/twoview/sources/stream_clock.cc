#include "sources/stream_clock.h"

#include <cstdio>

namespace cli {
namespace {

// Pictures that are stored out of order are less than this apart, and fewer than so many.
constexpr double kFall_s = 1;
constexpr int kMostOutOfOrder = 4;

}  // namespace

std::optional<double> StreamClock::next(double clock_s) {
  const bool is_late = last_ && !(clock_s > *last_);
  num_fallen_ = !is_late ? 0 : num_fallen_ > 0 && clock_s > fallen_s_ ? num_fallen_ + 1 : 1;
  fallen_s_ = clock_s;
  began_anew_ =
      is_late && (num_fallen_ > kMostOutOfOrder || (num_fallen_ > 1 && clock_s < *last_ - kFall_s));
  if (began_anew_) {
    if (num_begun_anew_++ == 0) first_s_ = *last_ + shift_s_;
    shift_s_ += *last_ + kPause_s - clock_s;
  } else if (is_late) {
    ++num_left_out_;
    return {};
  }
  num_fallen_ = 0;
  last_ = clock_s;
  return clock_s + shift_s_;
}

std::string StreamClock::note(const std::string& whose) const {
  if (num_begun_anew_ == 0) return "";
  char text[200];
  std::snprintf(text, sizeof text,
                "begins anew after %.6g s%s: the times go on %.3g s later, and no motion is "
                "continued across the gap",
                first_s_,
                num_begun_anew_ == 1
                    ? ""
                    : (", " + std::to_string(num_begun_anew_) + " times in all").c_str(),
                kPause_s);
  return "the clock of " + whose + " " + text;
}

}  // namespace cli
