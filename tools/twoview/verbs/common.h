// Shared by the verbs: how a verb is added and run, the options --output, --json and --quiet, and
// terminal colours.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "base/cli_fwd.h"
#include "files/image_file.h"
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
  // What the user must know of decisions that the program took: lines without an end.
  std::vector<std::string> notes;
  // Returns true if the summary for the user is printed to stdout.
  bool speaks() const { return !json && !quiet; }
  void note(const std::string& text);
  // The notes as lines of the printed summary. Where no summary is printed (--json, --quiet),
  // writes the notes to stderr and returns an empty text.
  std::string note_lines() const;
};
void add_common(CLI::App& verb, Common& common, unsigned groups, const std::string& output_help);

// Gives the picture its mask, where --mask is given; `name` is the picture's in a folder of masks.
// It is noted where the mask leaves nothing out.
void add_picture_mask(const std::string& name, Picture& picture, Common& common);

// Scales the picture down as --resize says; without --resize, a large picture is scaled down and
// this is noted. For a picture with 16-bit samples it is noted that these were stretched to 8 bits.
void bring_to_size(Picture& picture, Common& common);

// What a long search is doing, for Stopwatch.
std::string watch_text(const Options& options);

// Escape codes for the summary; all are empty where stdout takes none.
struct Style {
  const char *bold = "", *dim = "", *good = "", *fair = "", *poor = "", *off = "";
};
Style stdout_style();

}  // namespace cli
