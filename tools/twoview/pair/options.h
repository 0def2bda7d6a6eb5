// The options that the verbs share. One table defines their flags, ranges, help texts, and the
// "options" object of every result.
#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <variant>

#include "base/cli_fwd.h"
#include "files/camera_file.h"
#include "files/mask_file.h"
#include "twoview/twoview.h"

namespace cli {

constexpr int32_t kByItself = -1, kLargeSide = 2048, kUsualSide = 1600;
constexpr int32_t kHighestRung = 3;  // of tv_reconstruct_options.effort

struct Options {
  tv_feature_options feature;
  tv_match_options match;
  tv_estimate_options estimate;
  int32_t triangulation = TV_TRIANGULATION_ITERATIVE_LS;
  int32_t guided_matching = 0;
  int32_t align_matches = 1;
  int32_t bundle_adjustment = 0;
  double sigma_by_size = 1;
  // How far tv_reconstruct goes. Verbs without --effort stay at rung 0.
  enum Effort : int32_t { kEffortFixed, kEffortAuto, kEffort0, kEffort1, kEffort2, kEffort3 };
  int32_t effort = kEffortFixed;
  int32_t kernels = TV_KERNELS_AUTO;
  // Longer side of the resized images, pixels; 0: not resized; kByItself: kUsualSide for images
  // with a longer side than kLargeSide, on which single corners are noise.
  int32_t resize = kByItself;
  bool was_large = false;  // kByItself made an image smaller
  bool min_threshold_given = false;
  // The standard deviations of the focal lengths and of the principal points of both cameras; below
  // 0: those of the camera file.
  double focal_sigma = -1, center_sigma = -1;
  double principal_point_sigma = 0;  // above 0: the principal point may be refined
  Masks masks;                       // of the pictures whose corners are found
  double gravity_sigma_deg = 0;      // settle() copies it, in radians, to `estimate`

  Options();
  // Checks and completes the options that depend on each other. Call it once, after parsing.
  void settle();
  // Writes the calibrations of `estimate`: the sigmas of the command line, else those of the
  // cameras. Focal lengths may be refined, and the principal point with a principal_point_sigma,
  // which then takes the place of center_sigma.
  void set_calibrations(const CalibrationSigmas& first, const CalibrationSigmas& second);
  // The rung to begin with, and the highest one.
  int32_t first_rung() const { return effort >= kEffort0 ? effort - kEffort0 : 0; }
  int32_t highest_rung() const { return effort == kEffortAuto ? kHighestRung : first_rung(); }
  // The longer side to which an image of this size is scaled down; 0: as it is.
  int32_t longer_side(int32_t width, int32_t height) const;
};

// The stage of the work to which an option belongs; a verb adds the groups that it uses.
enum OptionGroup : unsigned {
  kFeature = 1,
  kMatch = 2,
  kEstimate = 4,
  kTriangulate = 8,
  kCommon = 16,
  kAllOptions = 31,
  kGravity = 32,  // --gravity0 and so on, for verbs with one pair
  kResize = 64,   // --resize alone, which kCommon has, too
  kEffort = 128   // --effort, whose default then is "auto"
};

// Adds the flags of these groups to a verb. `options` must outlive the parsing.
void add_options(CLI::App& verb, Options& options, unsigned groups);

// Makes an option of the verb exclude those of corners, of descriptors, and of how they are matched
// and made more precise, which do nothing where the matches are given.
void exclude_matching(CLI::App& verb, CLI::Option& matches);

// The options' values as a JSON object; in names "-" becomes "_".
nlohmann::ordered_json options_json(const Options& options, unsigned groups);

// Converts a float to the double with the shortest decimal text that reads back to the same float,
// for JSON.
double shortest(float value);

// The name of a solver as on the command line, such as "five-point".
std::string method_name(int32_t method);

// Parses the whole text as one finite number in [low, high]. Throws CLI::ValidationError that names
// the flag and the range.
double number_of_flag(const std::string& flag, const std::string& text, double low, double high);

// Adds --focal-35mm to a verb, in millimetres. may_be_auto: the verb can estimate it; the text
// "auto" then is kAutoFocal.
constexpr double kAutoFocal = -1;
void add_focal_35mm(CLI::App& verb, double& focal_35mm, bool may_be_auto = false);

// The flag --scale-camera, beside an option --camera.
void add_scale_camera(CLI::App& verb, bool& scales_camera);

// Adds --name to a verb: a number in [low, high], by default the value as it is now.
CLI::Option* add_number(CLI::App& verb, const char* name,
                        std::variant<int32_t*, uint64_t*, double*> value, double low, double high,
                        const char* help);

// Adds --mask to a verb; and the path as a JSON value, null where none is given.
void add_mask(CLI::App& verb, Masks& masks);
nlohmann::ordered_json mask_json(const Masks& masks);

// Adds --kernels to a verb.
CLI::Option* add_kernels(CLI::App& verb, int32_t& kernels);

constexpr double kLargestSeed = 18446744073709551615.0;  // 2^64 - 1

}  // namespace cli
