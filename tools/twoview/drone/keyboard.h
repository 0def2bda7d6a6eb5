// Reads single keys from a terminal without waiting for the end of a line.
#pragma once

#include <optional>

namespace cli {

enum Key { kKeyUp = 256, kKeyDown, kKeyRight, kKeyLeft };

class Keyboard {
 public:
  // Switches stdin out of line mode if it is a terminal; the destructor restores the mode, and so
  // does a signal that ends the program.
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;
  bool is_terminal() const { return is_terminal_; }
  // Returns a character or a Key, or nothing if no key or an unknown one was pressed. has_ended()
  // is true after the end of the input.
  std::optional<int> next();
  bool has_ended() const { return has_ended_; }

 private:
  std::optional<int> read_byte();
  bool is_terminal_, has_ended_ = false;
};

}  // namespace cli
