// Shared by the verbs: how a verb is added and run, the options --output, --json and --quiet, and
// terminal colours.
#pragma once

#include <CLI/App.hpp>
#include <functional>
#include <string>

#include "pair/options.h"

namespace cli {

// A function add_<verb> adds its subcommand to the program. When the user chose that subcommand,
// parsing sets `run` to the verb's work, whose result is the exit status.
using Run = std::function<int()>;

// The options that every verb takes.
struct Common {
  Options options;
  std::string output;
  bool json = false, quiet = false;
  // Returns true if the summary for the user is printed to stdout.
  bool speaks() const { return !json && !quiet; }
};
void add_common(CLI::App& verb, Common& common, unsigned groups, const std::string& output_help);

// Escape codes for the summary; all are empty when stdout is not a terminal.
struct Style {
  const char *bold = "", *dim = "", *good = "", *fair = "", *poor = "", *off = "";
};
Style stdout_style();

}  // namespace cli
