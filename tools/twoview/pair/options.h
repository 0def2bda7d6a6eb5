// The options that verbs share: one table gives the flags, their ranges, their help, and the
// "options" object of every result.
#pragma once

#include <CLI/App.hpp>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "twoview/twoview.h"

namespace cli {

struct Options {
  tv_feature_options feature;
  tv_match_options match;
  tv_estimate_options estimate;
  int32_t triangulation = TV_TRIANGULATION_ITERATIVE_LS;
  int32_t guided_matching = 0;
  int32_t bundle_adjustment = 0;
  int32_t kernels = TV_KERNELS_AUTO;
  int32_t resize = 0;  // longer side, pixels; 0: as it is
  bool min_threshold_given = false;
  double gravity_sigma_deg = 0;  // settle() hands it to `estimate`

  Options();
  // Checks and completes the options that depend on each other. Call it once, after parsing.
  void settle();
};

// Which part of the work an option belongs to; a verb takes those it uses.
enum OptionGroup : unsigned {
  kFeature = 1,
  kMatch = 2,
  kEstimate = 4,
  kTriangulate = 8,
  kCommon = 16,
  kAllOptions = 31,
  kGravity = 32  // of one pair
};

// Adds the flags of the groups to a verb. `options` must outlive the parsing.
void add_options(CLI::App& verb, Options& options, unsigned groups);

// The options as used, with _ for -.
nlohmann::ordered_json options_json(const Options& options, unsigned groups);

// A float as JSON shows it best: the shortest decimal that reads back to the same float.
double shortest(float value);

// "five-point" and so on, as the command line spells it.
std::string method_name(int32_t method);

}  // namespace cli
