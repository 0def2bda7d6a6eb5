// What is shown on a terminal only: colours, and the progress of long work.
#pragma once

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
// the terminal's width, and the destructor erases it. Shows nothing unless stderr is a terminal and
// TERM is not "dumb".
class Progress {
 public:
  explicit Progress(bool wanted);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void tell(const std::string& text) const;

 private:
  bool shown_;
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
