// The times of a stream's pictures, which rise whatever its clock does.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace cli {

// A picture whose time is not later than that of the one before is left out: it is out of order, or
// is there twice. Where such pictures rise among themselves, two that are more than a second early
// or five of any, the clock began anew: two films in one file, a camera or a vehicle that was
// started again. How long the pause was is not known; the pictures go on kPause_s later, and the
// odometry is given gap = 1.
class StreamClock {
 public:
  static constexpr double kPause_s = 1;  // longer than the pauses over which a motion is continued

  // The time to give the next picture when the stream's clock says clock_s; empty where the picture
  // is to be left out.
  std::optional<double> next(double clock_s);
  // Whether the clock began anew before the picture that next() was last called for.
  bool began_anew() const { return began_anew_; }
  int64_t num_left_out() const { return num_left_out_; }
  int64_t num_begun_anew() const { return num_begun_anew_; }
  // A line for the user, such as "the clock of the film begins anew at 3.0 s"; empty where the
  // clock never did. whose: such as "the film".
  std::string note(const std::string& whose) const;

 private:
  std::optional<double> last_;  // clock's time of the last picture that was used
  double fallen_s_ = 0;         // clock's time of the last picture that was left out
  int num_fallen_ = 0;          // how many left out in a row have rising times
  double shift_s_ = 0, first_s_ = 0;
  bool began_anew_ = false;
  int64_t num_left_out_ = 0, num_begun_anew_ = 0;
};

}  // namespace cli
