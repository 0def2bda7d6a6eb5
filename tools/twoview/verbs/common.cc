#include "verbs/common.h"

#include <unistd.h>
#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>

#include "base/output.h"
#include "base/terminal.h"

namespace cli {
void add_common(CLI::App& verb, Common& common, unsigned groups, const std::string& output_help) {
  CLI::Option* output = verb.add_option("-o,--output", common.output, output_help);
  output->required();
  output->type_name("PATH");
  output->check([](const std::string& path) {
    return path.empty() ? std::string("the path is empty") : std::string();
  });
  verb.add_flag("--json", common.json, "print the result alone, as JSON, on stdout");
  verb.add_flag("--quiet", common.quiet, "print nothing on stdout");
  add_options(verb, common.options, groups);
}

void Common::note(const std::string& text) {
  if (std::find(notes.begin(), notes.end(), text) == notes.end()) notes.push_back(text);
}

std::string Common::note_lines() const {
  std::string lines;
  for (const std::string& text : notes) {
    if (speaks())
      lines += summary_line("note", "%s", text.c_str());
    else
      std::fprintf(stderr, "twoview: note: %s\n", text.c_str());
  }
  return lines;
}

void add_picture_mask(const std::string& name, Picture& picture, Common& common) {
  const Masks& masks = common.options.masks;
  picture.mask = masks.of(name, picture.luma.cols, picture.luma.rows);
  const std::string note = mask_note(masks, masked_share(picture.mask), name);
  if (!note.empty()) common.note(note);
}

void bring_to_size(Picture& picture, Common& common) {
  const int width = picture.luma.cols, height = picture.luma.rows;
  shrink(picture, common.options.longer_side(width, height));
  if (common.options.resize == kByItself && picture.luma.cols != width) {
    common.options.was_large = true;
    common.note("images above " + std::to_string(kLargeSide) +
                " pixels a side are used smaller: " + std::to_string(width) + "x" +
                std::to_string(height) + " at " + std::to_string(picture.luma.cols) + "x" +
                std::to_string(picture.luma.rows) + " (--resize 0: as they are)");
  }
  if (picture.is_stretched) common.note(kStretchedNote);
  if (picture.has_more) common.note(kMoreNote);
}

std::string watch_text(const Options& options) {
  return "at most " + std::to_string(options.feature.max_keypoints) +
         (options.highest_rung() == 0 ? " keypoints an image" : " keypoints a view");
}

Style stdout_style() {
  if (!takes_colours(STDOUT_FILENO)) return {};
  return {"\033[1m", "\033[2m", "\033[32m", "\033[33m", "\033[31m", "\033[0m"};
}

}  // namespace cli
