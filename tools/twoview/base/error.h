// The exception for bad input, which main() prints as one line on stderr with exit status 2.
#pragma once

#include <stdexcept>
#include <string>

#include "twoview/status.h"

namespace cli {

// The exit statuses of the program. docs/formats.md promises them to users; do not change them.
constexpr int kExitPose = 0;
constexpr int kExitBadInput = 2;
constexpr int kExitNoPose = 3;
constexpr int kExitInterrupted = 130;

// Bad input or bad arguments. what() is the line printed for the user, without the program's name.
struct BadInput : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Throws BadInput with the library's message unless status is TV_OK.
inline void check(tv_status status, const std::string& what) {
  if (status != TV_OK) throw BadInput(what + ": " + tv_status_string(status));
}

}  // namespace cli
