// What depends on the terminal: colours, and the progress of long work.
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>
#include <thread>

namespace cli {

// Whether this descriptor takes escape codes for colours: it is a terminal, TERM is not "dumb", and
// NO_COLOR is missing or empty.
bool takes_colours(int descriptor);

// Whether this descriptor takes lines of progress that replace each other: it is a terminal, and
// TERM is not "dumb". NO_COLOR does not matter here.
bool shows_progress(int descriptor);

// Shows the progress of long work as one line on stderr: each line replaces the last one, is cut to
// the terminal's width, and the destructor erases it. Where stderr is no terminal, or TERM is
// "dumb", a line of its own comes every 30 s, so that a log shows that the work goes on;
// TWOVIEW_PROGRESS_SECONDS is another time, and 0 stands for no such lines.
class Progress {
 public:
  explicit Progress(bool wanted);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void tell(const std::string& text) const;

 private:
  using Clock = std::chrono::steady_clock;
  bool shown_;
  double line_every_s_ = 0;  // without a terminal; 0: never
  mutable Clock::time_point last_line_ = Clock::now();
};

// Shows "TEXT: 12 s" in the same way, once a second, until it is destroyed: for one long call that
// reports no progress.
class Stopwatch {
 public:
  Stopwatch(bool wanted, const std::string& text);
  ~Stopwatch();
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

 private:
  Progress progress_;
  std::mutex mutex_;
  std::condition_variable stop_;
  bool stopped_ = false;
  std::thread thread_;
};

}  // namespace cli
