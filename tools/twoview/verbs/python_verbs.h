// The verbs that are Python programs: compare, colmap, import, export and rerun. They are found in
// the source tree, or below share/twoview in an installation.
#pragma once

#include <string>
#include <vector>

#include "base/cli_fwd.h"

namespace cli {

// Adds the verbs so that --help lists them; their arguments are not parsed here.
void add_python_verbs(CLI::App& program);

// If argv[1] is one of these verbs, replaces this process by the Python program with the remaining
// arguments; otherwise it returns. Throws BadInput if the tools or Python are missing. Call it
// before signal handling is set up, because ignored signals stay ignored after exec.
void hand_over_python_verb(int argc, char** argv);

// Runs one of these verbs as a child process, waits for its end, and returns its exit status (2 if
// a signal ended it). Throws BadInput if the tools or Python are missing.
int run_python_verb(const std::string& name, const std::vector<std::string>& arguments);

}  // namespace cli
