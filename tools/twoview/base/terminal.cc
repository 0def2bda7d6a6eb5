#include "base/terminal.h"

#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace cli {
namespace {

bool is_dumb() {
  const char* const terminal = std::getenv("TERM");
  return terminal && std::strcmp(terminal, "dumb") == 0;
}

bool shows_progress() { return isatty(STDERR_FILENO) && !is_dumb(); }

}  // namespace

bool takes_colours(int descriptor) {
  const char* const no_colour = std::getenv("NO_COLOR");
  return isatty(descriptor) && !is_dumb() && !(no_colour && *no_colour);
}

Progress::Progress(bool wanted) : shown_(wanted && shows_progress()) {}

Progress::~Progress() {
  if (shown_) std::fputs("\r\033[K", stderr);
}

void Progress::tell(const std::string& text) const {
  if (shown_) std::fprintf(stderr, "\r\033[K%s", text.c_str());
}

Stopwatch::Stopwatch(bool wanted, const std::string& text) : progress_(wanted) {
  if (!wanted || !shows_progress()) return;
  thread_ = std::thread([this, text] {
    std::unique_lock<std::mutex> lock(mutex_);
    for (int seconds = 1; !stop_.wait_for(lock, std::chrono::seconds(1), [&] { return stopped_; });
         ++seconds)
      progress_.tell(text + ": " + std::to_string(seconds) + " s");
  });
}

Stopwatch::~Stopwatch() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopped_ = true;
  }
  stop_.notify_all();
  if (thread_.joinable()) thread_.join();
}

}  // namespace cli
