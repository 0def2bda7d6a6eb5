// The verbs that are Python programs: compare and colmap. They are found in the source tree, and
// below share/twoview once the program is installed.
#pragma once

#include <CLI/App.hpp>

namespace cli {

// For --help; they are never parsed here.
void add_python_verbs(CLI::App& program);

// When argv[1] is one of them: becomes the Python program, with the arguments after it. Returns
// otherwise. Throws BadInput where the tools or Python are missing. Call before signals are set up,
// as what they are set to outlives exec.
void hand_over_python_verb(int argc, char** argv);

}  // namespace cli
