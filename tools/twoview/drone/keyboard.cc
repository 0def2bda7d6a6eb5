#include "drone/keyboard.h"

#include <poll.h>
#include <termios.h>
#include <unistd.h>

#include "base/output.h"

namespace cli {
namespace {

// The mode of the terminal before it was changed. It is not a member of Keyboard, because the
// handler of signals restores it, too.
termios& mode_before() {
  static termios mode{};
  return mode;
}

void restore_mode() { ::tcsetattr(STDIN_FILENO, TCSANOW, &mode_before()); }

}  // namespace

Keyboard::Keyboard() : is_terminal_(::isatty(STDIN_FILENO) != 0) {
  if (!is_terminal_) return;
  ::tcgetattr(STDIN_FILENO, &mode_before());
  call_at_last_signal(restore_mode);
  termios raw = mode_before();
  raw.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);  // ISIG stays: Ctrl-C raises SIGINT
  raw.c_cc[VMIN] = 0;
  raw.c_cc[VTIME] = 0;
  ::tcsetattr(STDIN_FILENO, TCSANOW, &raw);
}

Keyboard::~Keyboard() {
  if (!is_terminal_) return;
  restore_mode();
  call_at_last_signal(nullptr);
}

std::optional<int> Keyboard::read_byte() {
  pollfd input{STDIN_FILENO, POLLIN, 0};
  if (has_ended_ || ::poll(&input, 1, 0) <= 0) return {};
  unsigned char byte = 0;
  const ssize_t count = ::read(STDIN_FILENO, &byte, 1);
  if (count == 0) has_ended_ = true;
  if (count != 1) return {};
  return byte;
}

std::optional<int> Keyboard::next() {
  const std::optional<int> first = read_byte();
  if (first != 27) return first;
  // Arrow keys send ESC [ A to ESC [ D; an ESC without "[" after it is the escape key itself.
  const std::optional<int> second = read_byte();
  if (second != '[') return 27;
  const std::optional<int> third = read_byte();
  if (third && *third >= 'A' && *third <= 'D') return kKeyUp + (*third - 'A');
  return {};
}

}  // namespace cli
