// The options that the verbs share. One table defines their flags, ranges, help texts, and the
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
  double sigma_by_size = 1;
  int32_t kernels = TV_KERNELS_AUTO;
  int32_t resize = 0;  // longer side of the resized images, pixels; 0: not resized
  bool min_threshold_given = false;
  // Of the calibration (tv_estimate_options); below 0: what the camera file says.
  double focal_sigma = -1, center_sigma = -1;
  double gravity_sigma_deg = 0;  // settle() copies it, in radians, to `estimate`

  Options();
  // Checks and completes the options that depend on each other. Call it once, after parsing.
  void settle();
};

// The stage of the work to which an option belongs; a verb adds the groups that it uses.
enum OptionGroup : unsigned {
  kFeature = 1,
  kMatch = 2,
  kEstimate = 4,
  kTriangulate = 8,
  kCommon = 16,
  kAllOptions = 31,
  kGravity = 32  // --gravity0 and so on, for verbs with one pair
};

// Adds the flags of these groups to a verb. `options` must outlive the parsing.
void add_options(CLI::App& verb, Options& options, unsigned groups);

// The options' values as a JSON object; in names "-" becomes "_".
nlohmann::ordered_json options_json(const Options& options, unsigned groups);

// Converts a float to the double with the shortest decimal text that reads back to the same float,
// for JSON.
double shortest(float value);

// The name of a solver as on the command line, such as "five-point".
std::string method_name(int32_t method);

}  // namespace cli
