#include "base/terminal.h"

#include <sys/ioctl.h>
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

double seconds_between_lines() {
  constexpr double kUsual = 30;
  const char* const given = std::getenv("TWOVIEW_PROGRESS_SECONDS");
  if (given == nullptr || *given == '\0') return kUsual;
  char* end = nullptr;
  const double seconds = std::strtod(given, &end);
  return *end == '\0' && seconds >= 0 ? seconds : kUsual;
}

// The beginning of the text, of UTF-8 characters, that stays on one line of the terminal at stderr.
// A line that wraps could not be erased.
std::string cut_to_terminal(const std::string& text) {
  winsize size{};
  if (ioctl(STDERR_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return text;
  size_t characters = 0;
  for (size_t i = 0; i < text.size(); ++i) {
    const bool begins_one = (static_cast<unsigned char>(text[i]) & 0xc0) != 0x80;
    if (begins_one && ++characters >= size.ws_col) return text.substr(0, i);
  }
  return text;
}

}  // namespace

bool shows_progress(int descriptor) { return isatty(descriptor) && !is_dumb(); }

bool takes_colours(int descriptor) {
  const char* const no_colour = std::getenv("NO_COLOR");
  return isatty(descriptor) && !is_dumb() && !(no_colour && *no_colour);
}

Progress::Progress(bool wanted) : shown_(wanted && shows_progress(STDERR_FILENO)) {
  if (wanted && !shown_) line_every_s_ = seconds_between_lines();
}

Progress::~Progress() {
  if (shown_) std::fputs("\r\033[K", stderr);
}

void Progress::tell(const std::string& text) const {
  if (shown_) std::fprintf(stderr, "\r\033[K%s", cut_to_terminal(text).c_str());
  if (!(line_every_s_ > 0)) return;
  const Clock::time_point now = Clock::now();
  if (std::chrono::duration<double>(now - last_line_).count() < line_every_s_) return;
  last_line_ = now;
  std::fprintf(stderr, "twoview: %s\n", text.c_str());
}

Stopwatch::Stopwatch(bool wanted, const std::string& text) : progress_(wanted) {
  if (!wanted) return;
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
