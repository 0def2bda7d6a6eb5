// Single keys of a terminal, without waiting for a line.
#pragma once

#include <termios.h>

#include <optional>

namespace cli {

enum Key { kKeyUp = 256, kKeyDown, kKeyRight, kKeyLeft };

class Keyboard {
 public:
  // Takes stdin out of line mode where it is a terminal, and puts it back at the end.
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;
  bool is_terminal() const { return is_terminal_; }
  // A character or a Key; nothing when no key was pressed. has_ended after the input is over.
  std::optional<int> next();
  bool has_ended() const { return has_ended_; }

 private:
  std::optional<int> read_byte();
  bool is_terminal_, has_ended_ = false;
  termios before_{};
};

}  // namespace cli
