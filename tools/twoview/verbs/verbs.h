// The verbs of the program, one file each.
#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <functional>
#include <string>

#include "options.h"
#include "result.h"
#include "session.h"

namespace cli {

// What every verb takes.
struct Common {
  Options options;
  std::string output;
  bool json = false, quiet = false;
  // Human words on stdout are wanted.
  bool speaks() const { return !json && !quiet; }
};
void add_common(CLI::App& verb, Common& common, unsigned groups, const std::string& output_help);

// Each adds its subcommand; `run` is set to what to do when the user chose it, and gives the exit
// status.
using Run = std::function<int()>;
void add_reconstruct(CLI::App& program, Run& run);
void add_detect(CLI::App& program, Run& run);
void add_match(CLI::App& program, Run& run);
void add_triangulate(CLI::App& program, Run& run);
void add_undistort(CLI::App& program, Run& run);
void add_calibrate(CLI::App& program, Run& run);
void add_evaluate(CLI::App& program, Run& run);
void add_drone(CLI::App& program, Run& run);  // its own verbs: drone/

// The main job on outcome.picture and outcome.camera: fills two_view and reconstruction; the wall
// time in nanoseconds. Throws BadInput when the library refuses.
uint64_t reconstruct_pair(Session& session, const Options& options, Outcome& outcome);

// Human output: escape codes are for terminals only.
struct Style {
  const char *bold = "", *dim = "", *good = "", *fair = "", *poor = "", *off = "";
};
Style stdout_style();

}  // namespace cli
