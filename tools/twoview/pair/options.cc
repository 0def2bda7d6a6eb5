#include "pair/options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <variant>
#include <vector>

#include "base/error.h"

namespace cli {
namespace {

// The names of an enumeration's values on the command line; the values are consecutive.
using Names = std::vector<std::string>;

constexpr double kShortestFilm = 1, kLongestFilm = 10000;  // millimetres

const Names kOrientations = {"upright", "gradient"};
const Names kDescriptors = {"sift", "rootsift"};
const Names kMethods = {"five-point", "eight-point", "seven-point", "upright"};
const Names kKernels = {"auto", "c", "sse2", "avx2", "avx512", "neon"};
const Names kEfforts = {"fixed", "auto", "0", "1", "2", "3"};
const Names kTriangulations = {
    "poly", "poly-abs", "linear-eigen", "linear-ls", "iterative-eigen", "iterative-ls", "midpoint"};

struct Choice {
  int32_t* value;
  const Names* names;
  int32_t first = 0;  // the enumeration value of names[0]
};

// A direction: three numbers that are not all zero; the length does not matter.
struct Direction {
  double* xyz;
};

struct Option {
  const char* name;
  OptionGroup group;
  std::variant<int32_t*, uint64_t*, float*, double*, Choice, Direction> target;
  double low, high;
  // The interval of accepted values: closed, or without the bound `low`, or without `high`.
  enum Ends { kClosed, kOpenLow, kOpenHigh } ends;
  const char* help;
};

std::vector<Option> table(Options& o) {
  using E = Option::Ends;
  constexpr E closed = E::kClosed, open_low = E::kOpenLow, open_high = E::kOpenHigh;
  tv_feature_options& f = o.feature;
  tv_estimate_options& e = o.estimate;
  return {
      {"max-keypoints", kFeature, &f.max_keypoints, 1, 65535, closed,
       "bound on descriptors an image, second orientations included"},
      {"arc", kFeature, &f.arc, 9, 12, closed, "contiguous pixels of FAST's 16-pixel circle"},
      {"threshold", kFeature, &f.threshold, 1, 254, closed, "FAST threshold, grey levels"},
      {"min-threshold", kFeature, &f.min_threshold, 0, 254, closed,
       "how far the threshold may fall to reach max-keypoints; 0: it is fixed"},
      {"levels", kFeature, &f.levels, 1, 8, closed, "pyramid levels"},
      {"scale-factor", kFeature, &f.scale_factor, 1.1, 2, closed, "between pyramid levels"},
      {"cell-px", kFeature, &f.cell_px, 0, 16384, closed,
       "side of the grid cell that spreads the corners; 0: no grid"},
      {"subpixel", kFeature, &f.subpixel, 0, 1, closed, "1: refine corners below a pixel"},
      {"orientation", kFeature, Choice{&f.orientation, &kOrientations}, 0, 0, closed,
       "of the descriptors"},
      {"descriptor", kFeature, Choice{&f.descriptor, &kDescriptors}, 0, 0, closed,
       "kind of descriptor"},
      {"keypoint-size", kFeature, &f.keypoint_size, 1, 32, closed,
       "diameter of a corner on level 0, pixels"},
      {"pooling", kFeature, &f.pooling, 0, 1, closed,
       "1: descriptors are means over windows of 0.7 and 1.3 times their size"},
      {"ratio", kMatch, &o.match.ratio, 0, 1, open_low,
       "nearest over second nearest distance, both directions"},
      {"neighbourhood-px", kMatch, &o.match.neighbourhood_px, 0, 1000, closed,
       "only keypoints at least this far from the nearest one count as second nearest; 0: all"},
      {"max-distance", kMatch, &o.match.max_distance, 0, 3000, closed,
       "bound of the second nearest distance of descriptors; 0: none"},
      {"method", kEstimate, Choice{&e.method, &kMethods, TV_SOLVER_FIVE_POINT}, 0, 0, closed,
       "minimal solver"},
      {"max-error-px", kEstimate, &e.max_error_px, 0, 1e9, open_low,
       "inlier threshold, Sampson distance in pixels"},
      {"confidence", kEstimate, &e.confidence, 0, 1, open_high,
       "stop when a better model is this unlikely to be missed"},
      {"max-iterations", kEstimate, &e.max_iterations, 1, 1e6, closed, "hard bound on samples"},
      {"fixed-iterations", kEstimate, &e.fixed_iterations, 0, 1e6, closed,
       "exactly this many samples; 0: adaptive stop"},
      {"seed", kEstimate, &e.seed, 0, kLargestSeed, closed, "of the sampler"},
      {"principal-point-sigma", kEstimate, &o.principal_point_sigma, 0, 0.1, closed,
       "how far the principal point may be moved: standard deviation in focal lengths, such as "
       "0.01, in place of --center-sigma; 0: it is where the camera file has it"},
      {"readout-turn-sigma-rad", kEstimate, &e.readout_turn_sigma_rad, 0, 0.5, closed,
       "how far the camera may turn while it reads the rows of a picture (rolling shutter): "
       "standard deviation in radians; 0: it exposes all rows at once"},
      {"guided-matching", kEstimate, &o.guided_matching, 0, 1, closed,
       "1: match again along the epipolar lines, and estimate from all matches"},
      {"align-matches", kEstimate, &o.align_matches, 0, 1, closed,
       "1: move one keypoint of each match by the pixels around both; 0: leave them"},
      {"bundle-adjustment", kEstimate, &o.bundle_adjustment, 0, 1, closed,
       "1: adjust pose and points together"},
      {"sigma-by-size", kEstimate, &o.sigma_by_size, 0, 2, closed,
       "a keypoint's noise is in proportion to its size to this power; 0: the same for all"},
      {"effort", kEffort, Choice{&o.effort, &kEfforts}, 0, 0, closed,
       "more keypoints (1), and views squeezed along 4 (2) or 16 (3) directions; auto: only while "
       "the verdict is not ok; fixed: 0"},
      {"gravity0", kGravity, Direction{e.gravity0}, 0, 0, closed,
       "the direction of gravity (down) in the first camera's frame"},
      {"gravity1", kGravity, Direction{e.gravity1}, 0, 0, closed, "the same of the second"},
      {"gravity-sigma-deg", kGravity, &o.gravity_sigma_deg, 0, 180, closed,
       "standard deviation of each direction about each axis across it; 0: not known"},
      {"focal-sigma", kGravity, &o.focal_sigma, -1, 0.5, closed,
       "relative standard deviation of the focal length; above 0.02 it is refined with the pose; "
       "0: exact; -1: what the camera file says, else 0.01, with --focal-35mm 0.1"},
      {"center-sigma", kGravity, &o.center_sigma, -1, 0.5, closed,
       "standard deviation of the principal point in focal lengths; 0: exact; -1: what the camera "
       "file says, else 0.005, with --focal-35mm 0.01"},
      {"triangulation", kTriangulate, Choice{&o.triangulation, &kTriangulations}, 0, 0, closed,
       "method"},
      {"kernels", kCommon, Choice{&o.kernels, &kKernels}, 0, 0, closed, "kernel set"},
      {"resize", static_cast<OptionGroup>(kCommon | kResize), &o.resize, 0, 16384, closed,
       "scale images down to this longer side, pixels; 0: as they are; without it 1600 where it is "
       "above 2048"},
  };
}

std::string number_text(double value) {
  char text[32];
  const bool is_whole = value == std::round(value) && std::abs(value) < 1e15;
  const auto end = is_whole
                       ? std::to_chars(text, text + sizeof text, static_cast<int64_t>(value)).ptr
                       : std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

std::string range_text(const Option& option) {
  return std::string(option.ends == Option::kOpenLow ? "(" : "[") + number_text(option.low) + ", " +
         (option.high == kLargestSeed ? "2^64 - 1" : number_text(option.high)) +
         (option.ends == Option::kOpenHigh ? ")" : "]");
}

bool in_range(const Option& option, double value) {
  const bool low = option.ends == Option::kOpenLow ? value > option.low : value >= option.low;
  const bool high = option.ends == Option::kOpenHigh ? value < option.high : value <= option.high;
  return low && high;  // NaN is refused: its comparisons are false
}

// Parses the whole text as one number; anything left over is an error.
template <class T>
bool parse_number(const std::string& text, T& value) {
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  return result.ec == std::errc() && result.ptr == end;
}

std::string joined(const Names& names, const char* separator) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : separator) + name;
  return text;
}

bool is_zero(const Direction& direction) {
  return std::all_of(direction.xyz, direction.xyz + 3, [](double v) { return v == 0; });
}

void set_direction(const std::string& flag, const Direction& direction, const std::string& text) {
  std::array<double, 3> values{};
  std::string_view rest = text;
  bool good = true;
  for (size_t k = 0; k < 3; ++k) {
    const size_t end = k < 2 ? rest.find(',') : rest.size();
    good = good && end != rest.npos && parse_number(std::string(rest.substr(0, end)), values[k]) &&
           std::isfinite(values[k]);
    if (!good) throw CLI::ValidationError(flag, "'" + text + "' is not three numbers x,y,z");
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  std::copy(values.begin(), values.end(), direction.xyz);
  if (is_zero(direction)) throw CLI::ValidationError(flag, "'" + text + "' has no direction");
}

// Parses the text and sets the option's value; throws CLI::ValidationError with a message for the
// user.
void set(const Option& option, const std::string& text) {
  const std::string flag = "--" + std::string(option.name);
  if (const Choice* choice = std::get_if<Choice>(&option.target)) {
    const Names& names = *choice->names;
    if (std::find(names.begin(), names.end(), text) == names.end()) {
      throw CLI::ValidationError(flag,
                                 "'" + text + "' is none of this version's " + joined(names, ", "));
    }
    const auto found = std::find(choice->names->begin(), choice->names->end(), text);
    *choice->value = choice->first + static_cast<int32_t>(found - choice->names->begin());
    return;
  }
  if (const Direction* direction = std::get_if<Direction>(&option.target)) {
    set_direction(flag, *direction, text);
    return;
  }
  std::visit(
      [&](auto target) {
        if constexpr (std::is_pointer_v<decltype(target)>) {
          using T = std::remove_pointer_t<decltype(target)>;
          T value{};
          if (!parse_number(text, value)) {
            const char* kind = std::is_integral_v<T> ? "a whole number" : "a number";
            throw CLI::ValidationError(
                flag, "'" + text + "' is not " + kind + " in " + range_text(option));
          }
          // The value is compared with its bound as decimal numbers are, so that 1.1 given as a
          // float (which is above 1.1) does not exceed a bound of 1.1.
          double compared = static_cast<double>(value);
          if constexpr (std::is_same_v<T, float>) compared = shortest(value);
          if (!in_range(option, compared))
            throw CLI::ValidationError(flag, text + " is not in " + range_text(option));
          *target = value;
        }
      },
      option.target);
}

nlohmann::ordered_json value_json(const Option& option) {
  return std::visit(
      [&](auto target) -> nlohmann::ordered_json {
        using T = decltype(target);
        if constexpr (std::is_same_v<T, Choice>)
          return (*target.names)[static_cast<size_t>(*target.value - target.first)];
        else if constexpr (std::is_same_v<T, Direction>)
          return is_zero(target)
                     ? nlohmann::ordered_json()
                     : nlohmann::ordered_json{target.xyz[0], target.xyz[1], target.xyz[2]};
        else if constexpr (std::is_same_v<T, float*>)
          return shortest(*target);
        else
          return *target;
      },
      option.target);
}

std::string value_text(const Option& option) {
  const nlohmann::ordered_json value = value_json(option);
  return value.is_string() ? value.get<std::string>() : value.dump();
}

// The words to choose from, or the numbers that an option accepts.
std::string type_text(const Option& option) {
  if (const Choice* choice = std::get_if<Choice>(&option.target))
    return joined(*choice->names, "|");
  return std::holds_alternative<Direction>(option.target) ? "x,y,z" : range_text(option);
}

std::string flag_of(const Option& option) { return "--" + std::string(option.name); }

CLI::Option* add_option(CLI::App& verb, const Option& option) {
  CLI::Option* flag = verb.add_option_function<std::string>(
      flag_of(option), [option](const std::string& text) { set(option, text); }, option.help);
  flag->type_name(type_text(option));
  if (!std::holds_alternative<Direction>(option.target)) flag->default_str(value_text(option));
  return flag;
}

const char* group_title(OptionGroup group) {
  switch (group) {
    case kFeature: return "Corners and descriptors";
    case kMatch: return "Matching";
    case kEstimate:
    case kEffort:
    case kGravity: return "Geometry";
    case kTriangulate: return "Triangulation";
    default: return "General";
  }
}

}  // namespace

Options::Options() {
  tv_feature_options_init(&feature);
  tv_match_options_init(&match);
  tv_estimate_options_init(&estimate);
  // Defaults that are automatic in the library have explicit values here, which --help and the
  // output files show.
  feature.max_keypoints = 2048;
  estimate.method = TV_SOLVER_FIVE_POINT;
}

void Options::settle() {
  // A given threshold below the default min_threshold lowers min_threshold too, unless that was
  // also given.
  if (!min_threshold_given)
    feature.min_threshold = std::min(feature.min_threshold, feature.threshold);
  if (feature.min_threshold > feature.threshold)
    throw BadInput("--min-threshold " + std::to_string(feature.min_threshold) +
                   " is above --threshold " + std::to_string(feature.threshold));
  if (feature.cell_px > 0 && feature.cell_px < 8)
    throw BadInput("--cell-px: " + std::to_string(feature.cell_px) + " is not 0 or in [8, 16384]");
  const bool given[3] = {!is_zero({estimate.gravity0}), !is_zero({estimate.gravity1}),
                         gravity_sigma_deg > 0};
  if (given[0] != given[1] || given[1] != given[2])
    throw BadInput("--gravity0, --gravity1 and --gravity-sigma-deg go together");
  if (estimate.method == TV_SOLVER_UPRIGHT && !given[0])
    throw BadInput("--method upright needs --gravity0, --gravity1 and --gravity-sigma-deg");
  estimate.gravity_sigma_rad = gravity_sigma_deg * 3.14159265358979323846 / 180;
}

void Options::set_calibrations(const CalibrationSigmas& first, const CalibrationSigmas& second) {
  const auto calibration = [this](const CalibrationSigmas& of_camera) {
    tv_calibration c{of_camera.focal, of_camera.center, TV_REFINE_FOCAL_LENGTH, 0};
    if (focal_sigma >= 0) c.focal_sigma = focal_sigma;
    if (center_sigma >= 0) c.center_sigma = center_sigma;
    if (principal_point_sigma > 0) {
      c.center_sigma = principal_point_sigma;
      c.refine |= TV_REFINE_PRINCIPAL_POINT;
    }
    return c;
  };
  estimate.calibration0 = calibration(first);
  estimate.calibration1 = calibration(second);
}

int32_t Options::longer_side(int32_t width, int32_t height) const {
  if (resize != kByItself) return resize;
  return std::max(width, height) > kLargeSide ? kUsualSide : 0;
}

double number_of_flag(const std::string& flag, const std::string& text, double low, double high) {
  double value = 0;
  if (parse_number(text, value) && value >= low && value <= high) return value;
  const bool has_comma = text.find(',') != std::string::npos;
  throw CLI::ValidationError(flag, "'" + text + "' is not a number in [" + number_text(low) + ", " +
                                       number_text(high) + "]" +
                                       (has_comma ? "; one number, with a decimal point" : ""));
}

void add_focal_35mm(CLI::App& verb, double& focal_35mm, bool may_be_auto) {
  const std::string name = "--focal-35mm", automatic = "auto";
  const std::string help =
      "in place of a camera file: the focal length as for 35 mm film; no lens distortion";
  verb.add_option_function<std::string>(
          name,
          [=, &focal_35mm](const std::string& text) {
            if (text == automatic && !may_be_auto)
              throw CLI::ValidationError(name, "auto: reconstruct and odometry alone estimate it");
            focal_35mm = text == automatic
                             ? kAutoFocal
                             : number_of_flag(name, text, kShortestFilm, kLongestFilm);
          },
          may_be_auto ? help + "; auto (where nothing is known): estimated from the pictures"
                      : help)
      ->type_name((may_be_auto ? "auto or [" : "[") + number_text(kShortestFilm) + ", " +
                  number_text(kLongestFilm) + "]");
}

void add_scale_camera(CLI::App& verb, bool& scales_camera) {
  verb.add_flag("--scale-camera", scales_camera,
                "scale a camera file that is for another size of the same picture (not for a "
                "crop)");
}

CLI::Option* add_number(CLI::App& verb, const char* name,
                        std::variant<int32_t*, uint64_t*, double*> value, double low, double high,
                        const char* help) {
  Option option{name, kCommon, static_cast<double*>(nullptr), low, high, Option::kClosed, help};
  std::visit([&option](auto target) { option.target = target; }, value);
  return add_option(verb, option);
}

CLI::Option* add_kernels(CLI::App& verb, int32_t& kernels) {
  return add_option(
      verb, {"kernels", kCommon, Choice{&kernels, &kKernels}, 0, 0, Option::kClosed, "kernel set"});
}

void add_mask(CLI::App& verb, Masks& masks) {
  verb.add_option("--mask", masks.path,
                  "picture of the images' size, black where they are left out; or a folder of "
                  "masks NAME.png")
      ->type_name("FILE|DIR")
      ->check(CLI::ExistingPath);
}

nlohmann::ordered_json mask_json(const Masks& masks) {
  return masks.given() ? nlohmann::ordered_json(masks.path) : nlohmann::ordered_json(nullptr);
}

void add_options(CLI::App& verb, Options& options, unsigned groups) {
  if (groups & kFeature) add_mask(verb, options.masks);
  if (groups & kEffort) options.effort = Options::kEffortAuto;
  for (const Option& option : table(options)) {
    if (!(option.group & groups)) continue;
    CLI::Option* flag = add_option(verb, option)->group(group_title(option.group));
    if (std::string(option.name) == "resize") flag->default_str("");  // the help text says it
    if (std::string(option.name) == "min-threshold")
      flag->each([&options](const std::string&) { options.min_threshold_given = true; });
  }
}

void exclude_matching(CLI::App& verb, CLI::Option& matches) {
  Options options;
  for (const Option& option : table(options))
    if (option.group & (kFeature | kMatch)) matches.excludes(verb.get_option(flag_of(option)));
  for (const char* const flag : {"--mask", "--guided-matching", "--align-matches",
                                 "--bundle-adjustment", "--sigma-by-size", "--effort"})
    matches.excludes(verb.get_option(flag));
}

nlohmann::ordered_json options_json(const Options& options, unsigned groups) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  // The table needs a non-const reference, but it is only read here.
  for (const Option& option : table(const_cast<Options&>(options))) {
    if (!(option.group & groups)) continue;
    std::string key = option.name;
    std::replace(key.begin(), key.end(), '-', '_');
    json[key] = value_json(option);
    if (key == "resize" && options.resize == kByItself)
      json[key] = options.was_large ? kUsualSide : 0;
  }
  if (groups & kFeature) json["mask"] = mask_json(options.masks);
  return json;
}

double shortest(float value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  double result = static_cast<double>(value);
  std::from_chars(text, end, result);
  return result;
}

std::string method_name(int32_t method) {
  return kMethods.at(static_cast<size_t>(method - TV_SOLVER_FIVE_POINT));
}

}  // namespace cli
