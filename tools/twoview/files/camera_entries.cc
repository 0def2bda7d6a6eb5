#include "files/camera_entries.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <regex>
#include <set>

#include "base/error.h"
#include "files/camera_doubts.h"
#include "files/yaml_values.h"

namespace cli {
namespace {

using Names = CameraEntries::Names;
using Entry = CameraEntries::Entry;

constexpr size_t kModelled = 8;                           // coefficients that tv_camera has
constexpr size_t kOpencvCounts[] = {0, 4, 5, 8, 12, 14};  // of OpenCV's calibrateCamera
constexpr double kFarthestCenter = 1;    // image sides that the principal point may lie outside
constexpr double kShortestFocal = 0.02;  // of the image's side: 176 degrees of a pinhole

// The names of each entry, the first one for messages.
const Names kWidth = {"image_width", "width", "img_width", "cols", "w"};
const Names kHeight = {"image_height", "height", "img_height", "rows", "h"};
const Names kSize = {"resolution", "image_size", "img_size", "image_resolution"};
const Names kIntrinsics = {"intrinsics", "intrinsic", "camera_intrinsics", "projection_parameters"};
const Names kMatrix = {
    "camera_matrix",        "k",   "camera_mat", "cam_matrix", "intrinsic_matrix",
    "intrinsics_matrix",    "mtx", "intrinsics", "intrinsic",  "camera_intrinsics",
    "projection_parameters"};
const Names kPinhole[] = {{"fx", "fl_x", "fu"},
                          {"fy", "fl_y", "fv"},
                          {"cx", "ppx", "cu", "u0"},
                          {"cy", "ppy", "cv", "v0"}};
const Names kDistortion = {"distortion_coefficients",
                           "distortion_coefficient",
                           "distortion_coeffs",
                           "distortion_coeff",
                           "distortion_coefs",
                           "distortion_coef",
                           "dist_coefficients",
                           "dist_coeffs",
                           "dist_coeff",
                           "dist_coefs",
                           "dist_coef",
                           "distortion",
                           "dist",
                           "d",
                           "coeffs",
                           "distortion_parameters",
                           "distortion_params",
                           "distortion_vector",
                           "lens_distortion",
                           "parameters"};
const Names kBrownNames = {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
const Names kFisheyeNames = {"k1", "k2", "k3", "k4"};
const Names kModel = {
    "distortion_model", "camera_model",    "model_type",       "camera_type", "lens_model",
    "lens_type",        "distortion_type", "projection_model", "model",       "type"};
const Names kFisheyeFlag = {"fisheye_model", "fisheye", "is_fisheye", "use_fisheye"};
const Names kRectification = {"rectification_matrix", "r"};
const Names kProjection = {"projection_matrix", "p"};
const Names kRoi = {"roi_x_offset", "roi_y_offset", "roi_width",
                    "roi_height",   "binning_x",    "binning_y"};

// The kind of lens that an entry of kModel names. kAny: the entry does not decide it, as Kalibr's
// camera_model "pinhole", which stands beside any distortion_model.
enum class Lens { kAny, kNone, kBrown, kFisheye };
const std::map<std::string, Lens> kWords = {
    {"pinhole", Lens::kAny},
    {"simplepinhole", Lens::kAny},
    {"perspective", Lens::kAny},
    {"none", Lens::kNone},
    {"nodistortion", Lens::kNone},
    {"distortionnone", Lens::kNone},
    {"rectified", Lens::kNone},
    {"plumbbob", Lens::kBrown},
    {"rationalpolynomial", Lens::kBrown},
    {"radtan", Lens::kBrown},
    {"radialtangential", Lens::kBrown},
    {"pinholeradtan", Lens::kBrown},
    {"brownconrady", Lens::kBrown},
    {"distortionbrownconrady", Lens::kBrown},
    {"opencv", Lens::kBrown},
    {"equidistant", Lens::kFisheye},
    {"equi", Lens::kFisheye},
    {"pinholeequi", Lens::kFisheye},
    {"fisheye", Lens::kFisheye},
    {"opencvfisheye", Lens::kFisheye},
    {"kannalabrandt", Lens::kFisheye},
    {"kannalabrandt4", Lens::kFisheye},
    {"kannalabrandt8", Lens::kFisheye},
    {"distortionkannalabrandt4", Lens::kFisheye},
    {"kb4", Lens::kFisheye},
    {"kb8", Lens::kFisheye},
};
constexpr const char* kKnownWords =
    "pinhole, perspective, plumb_bob, rational_polynomial, fisheye, kannala_brandt, radtan, "
    "equidistant, none";

// Names that cannot concern the lens: dates, the board, the fit's errors, poses, topics.
const std::set<std::string> kHarmless = {"calibrationtime",
                                         "calibrationdate",
                                         "date",
                                         "time",
                                         "timestamp",
                                         "timestampns",
                                         "header",
                                         "seq",
                                         "stamp",
                                         "frameid",
                                         "cameraname",
                                         "name",
                                         "label",
                                         "id",
                                         "uuid",
                                         "serial",
                                         "serialnumber",
                                         "cameraid",
                                         "comment",
                                         "comments",
                                         "description",
                                         "note",
                                         "notes",
                                         "author",
                                         "version",
                                         "fileversion",
                                         "typeid",
                                         "nrofframes",
                                         "numframes",
                                         "numimages",
                                         "nframes",
                                         "nimages",
                                         "nviews",
                                         "numviews",
                                         "flags",
                                         "calibrationflags",
                                         "aspectratio",
                                         "fixaspectratio",
                                         "avgreprojectionerror",
                                         "reprojectionerror",
                                         "reprojectionerrors",
                                         "meanreprojectionerror",
                                         "meanerror",
                                         "rms",
                                         "rmserror",
                                         "error",
                                         "errors",
                                         "stddeviations",
                                         "tcamimu",
                                         "timucam",
                                         "tcncnm1",
                                         "tbs",
                                         "tsb",
                                         "tbc",
                                         "tcb",
                                         "tic",
                                         "bodytcam0",
                                         "bodytcam1",
                                         "camoverlaps",
                                         "rostopic",
                                         "topic",
                                         "imagetopic",
                                         "timeshiftcamimu",
                                         "td",
                                         "estimatetd",
                                         "estimateextrinsic",
                                         "ratehz",
                                         "rate",
                                         "fps",
                                         "framerate",
                                         "sensortype",
                                         "rgb",
                                         "colororder",
                                         "bf",
                                         "thdepth",
                                         "depththreshold",
                                         "depthmapfactor",
                                         "setup",
                                         "mindist",
                                         "bodyfromcamera",
                                         "camerainbody",
                                         "rvecs",
                                         "tvecs",
                                         "rotationvectors",
                                         "translationvectors",
                                         "imagepoints",
                                         "objectpoints",
                                         "gridpoints",
                                         "newwidth",
                                         "newheight",
                                         "cameraanglex",
                                         "cameraangley",
                                         "frames",
                                         "plyfilepath",
                                         "appliedtransform",
                                         "appliedscale",
                                         "aabbscale",
                                         "orientationoverride",
                                         "dorectify"};
constexpr const char* kHarmlessStarts[] = {
    "board",      "square",         "marker",      "pattern", "checker",
    "chessboard", "aruco",          "charuco",     "grid",    "perview",
    "extrinsic",  "calibrateusing", "overlapping", "lapping", "imu"};
// A name that contains one of these may concern the lens; suspect_whole has the names that may as a
// whole.
constexpr const char* kSuspect[] = {
    "dist",      "coef",       "lens",      "fish",  "focal",    "radial",  "tangential", "skew",
    "binning",   "roi",        "sigma",     "resol", "width",    "height",  "size",       "shape",
    "dimension", "intrinsic",  "principal", "scale", "crop",     "zoom",    "omni",       "mirror",
    "model",     "matrix",     "rectif",    "prism", "division", "project", "stretch",    "optic",
    "pixel",     "cameratype", "cameramat", "kappa", "lambda",   "barrel",  "warp",       "curv"};
const std::regex& suspect_whole() {
  static const std::regex names(
      "f|fx|fy|cx|cy|fu|fv|cu|cv|u0|v0|mu|mv|ppx|ppy|flx|fly|w|h|k|d|p|r|s|a|b|c|e|m|xi|alpha|"
      "beta|gamma|[kpsbdmarqt][0-9]+|ks|ps|tau[xy]?|tx|ty|poly[0-9]*|invpol.*|[hvd]?fov|cols|rows|"
      "mtx|"
      "type");
  return names;
}
// Names of terms of a lens which the camera does not have if their value is 0.
const std::regex& zero_is_none() {
  static const std::regex names(
      "[kpsbqt][0-9]+|[abc]|skew|tau[xy]?|tx|ty|radial|tangential|xi|kappa[0-9]*|lambda|barrel");
  return names;
}

bool is_among(const std::string& plain, const Names& names) {
  return std::any_of(names.begin(), names.end(),
                     [&](const char* name) { return plain == plain_name(name); });
}

// Whether some reader takes entries of this name.
bool is_known(const std::string& plain) {
  for (const Names* names :
       {&kWidth, &kHeight, &kSize, &kMatrix, &kPinhole[0], &kPinhole[1], &kPinhole[2], &kPinhole[3],
        &kDistortion, &kBrownNames, &kModel, &kFisheyeFlag, &kRectification, &kProjection})
    if (is_among(plain, *names)) return true;
  return false;
}

// ---- judging -----------------------------------------------------------------------------------

bool is_harmless(const std::string& plain) {
  return kHarmless.count(plain) != 0 ||
         std::any_of(std::begin(kHarmlessStarts), std::end(kHarmlessStarts),
                     [&](const std::string& start) { return plain.rfind(start, 0) == 0; });
}

bool may_concern_lens(const std::string& plain) {
  return std::regex_match(plain, suspect_whole()) ||
         std::any_of(std::begin(kSuspect), std::end(kSuspect),
                     [&](const char* part) { return plain.find(part) != std::string::npos; });
}

bool is_zero(const YAML::Node& value) {
  if (value.IsSequence())
    return std::all_of(value.begin(), value.end(), [](const auto& item) { return is_zero(item); });
  double number = 0;
  return value.IsScalar() && parse_number(value.Scalar(), number) && number == 0;
}

std::string key_of(const YAML::Node& key) { return key.IsScalar() ? key.Scalar() : "?"; }

// Adds an entry that no reader understood to `refused` where it may concern the lens, and to
// `left_out` where it may not; to neither where it is empty or known to be harmless.
void judge(const std::string& entry, const YAML::Node& value, std::vector<std::string>& refused,
           std::vector<std::string>& left_out) {
  const std::string plain = plain_name(entry.substr(entry.rfind('.') + 1));
  if (value.IsNull() || is_harmless(plain)) return;
  if (may_concern_lens(plain)) {
    if (!std::regex_match(plain, zero_is_none()) || !is_zero(value)) refused.push_back(entry);
    return;
  }
  std::vector<std::string> inner;
  const auto judge_map = [&](const YAML::Node& map) {
    if (!map.IsMap() || map["data"]) return;
    for (const auto& item : map)
      judge(entry + "." + key_of(item.first), item.second, refused, inner);
  };
  judge_map(value);
  if (value.IsSequence())
    for (const auto& item : value) judge_map(item);
  left_out.push_back(entry);
}

// ---- taking ------------------------------------------------------------------------------------

template <class T>
struct Found {
  std::string entry;
  T value;
};

// Takes the entries that have one of these names, and returns the value as `read` reads it; empty
// where there is no such entry or its value is null. Entries under several spellings of the name
// must have the same value.
template <class Read>
auto take(CameraEntries& entries, const Names& names, const Read& read)
    -> std::optional<Found<decltype(read(YAML::Node(), "", ""))>> {
  std::optional<Found<decltype(read(YAML::Node(), "", ""))>> taken;
  for (const Entry& entry : entries.take_all(names)) {
    if (entry.value.IsNull()) continue;
    auto value = read(entry.value, entry.name, entries.where());
    if (taken && taken->value != value)
      throw BadInput(entries.where() + ": " + taken->entry + " and " + entry.name +
                     " contradict each other");
    if (!taken) taken = {entry.name, std::move(value)};
  }
  return taken;
}

// As take, but a number that is null is an error.
std::optional<Found<double>> take_number(CameraEntries& entries, const Names& names) {
  std::optional<Found<double>> taken;
  for (const Entry& entry : entries.take_all(names)) {
    const double value = number_of(entry.value, entry.name, entries.where());
    if (taken && taken->value != value)
      throw BadInput(entries.where() + ": " + taken->entry + " and " + entry.name +
                     " contradict each other");
    if (!taken) taken = {entry.name, value};
  }
  return taken;
}

[[noreturn]] void refuse_both(const CameraEntries& entries, const std::string& a,
                              const std::string& b) {
  throw BadInput(entries.where() + ": " + a + " and " + b + " contradict each other");
}

std::string word_of(const YAML::Node& value, const std::string& entry, const std::string& where) {
  if (value.IsNull()) return "";
  if (!value.IsScalar()) throw BadInput(where + ": " + entry + " is not a word");
  return value.Scalar();
}

void require_count(const std::vector<double>& values, size_t count, const std::string& entry,
                   const std::string& where) {
  if (values.size() != count)
    throw BadInput(where + ": " + entry + " has " + std::to_string(values.size()) +
                   " numbers, not " + std::to_string(count));
}

std::string last_part(const std::string& entry) {
  return plain_name(entry.substr(entry.rfind('.') + 1));
}

// ---- size --------------------------------------------------------------------------------------

using Sides = std::array<int32_t, 2>;

Sides size_of(CameraEntries& entries) {
  const bool is_kalibrs = entries.has(kIntrinsics) && !entries.has(kWidth) && !entries.has(kHeight);
  const auto both =
      take(entries, kSize,
           [](const YAML::Node& value, const std::string& entry, const std::string& where) {
             const std::vector<double> sides = numbers_of(value, entry, where);
             require_count(sides, 2, entry, where);
             return Sides{side_of(sides[0], entry + "[0]", where),
                          side_of(sides[1], entry + "[1]", where)};
           });
  const auto side = [](const YAML::Node& value, const std::string& entry,
                       const std::string& where) {
    return side_of(number_of(value, entry, where), entry, where);
  };
  const auto width = take(entries, kWidth, side), height = take(entries, kHeight, side);
  if (!both) {
    if (!width) entries.refuse_missing(is_kalibrs ? "resolution" : kWidth[0]);
    if (!height) entries.refuse_missing(is_kalibrs ? "resolution" : kHeight[0]);
    return {width->value, height->value};
  }
  if (width && width->value != both->value[0]) refuse_both(entries, both->entry, width->entry);
  if (height && height->value != both->value[1]) refuse_both(entries, both->entry, height->entry);
  return both->value;
}

// ---- fx fy cx cy -------------------------------------------------------------------------------

using Four = std::array<double, 4>;

// Of a 3 x 3 matrix, or of the four numbers of Kalibr's intrinsics.
Four four_of(const YAML::Node& value, const std::string& entry, const std::string& where) {
  const std::vector<double> K = numbers_of(value, entry, where);
  if (is_among(last_part(entry), kIntrinsics) && K.size() != 9) {
    require_count(K, 4, entry, where);
    require_focal(K[0], "fx (" + entry + "[0])", where);
    require_focal(K[1], "fy (" + entry + "[1])", where);
    return {K[0], K[1], K[2], K[3]};
  }
  require_count(K, 9, entry, where);
  const std::vector<double> shape = shape_of(value, entry, where);
  if (!shape.empty() && shape != std::vector<double>{3, 3})
    throw BadInput(where + ": " + entry + ": " + (shape[0] != 3 ? "rows" : "cols") + " is not 3");
  require_focal(K[0], "fx (" + entry + "[0])", where);
  require_focal(K[4], "fy (" + entry + "[4])", where);
  if (K[1] != 0) throw BadInput(where + ": " + entry + "[1] is not 0; skew is not supported");
  if (K[2] == 0 && K[5] == 0 && K[6] != 0 && K[7] != 0)
    throw BadInput(where + ": " + entry +
                   " is transposed (Open3D, MATLAB), not [fx 0 cx; 0 fy cy; 0 0 1]");
  if (K[3] != 0 || K[6] != 0 || K[7] != 0 || K[8] != 1)
    throw BadInput(where + ": " + entry + " is not [fx 0 cx; 0 fy cy; 0 0 1]");
  return {K[0], K[4], K[2], K[5]};
}

Four pinhole_of(CameraEntries& entries) {
  const auto matrix = take(entries, kMatrix, four_of);
  std::optional<Found<double>> numbers[4];
  bool any = false;
  for (size_t i = 0; i < 4; ++i) {
    numbers[i] = take_number(entries, kPinhole[i]);
    any = any || numbers[i];
  }
  if (!any) {
    if (!matrix) entries.refuse_missing(kMatrix[0]);
    return matrix->value;
  }
  Four K{};
  for (size_t i = 0; i < 4; ++i) {
    if (!numbers[i]) entries.refuse_missing(kPinhole[i][0]);
    K[i] = numbers[i]->value;
  }
  for (size_t i = 0; i < 2; ++i) require_focal(K[i], numbers[i]->entry, entries.where());
  if (matrix && matrix->value != K) refuse_both(entries, matrix->entry, numbers[0]->entry);
  return K;
}

// ---- lens --------------------------------------------------------------------------------------

// The kind of lens that the entries name, and the entry that names it.
struct Said {
  Lens lens = Lens::kAny;
  std::string by;
};

Lens lens_of(const Entry& entry, const std::string& where) {
  const std::string word = word_of(entry.value, entry.name, where);
  if (word.empty()) return Lens::kAny;
  const std::string plain = plain_name(word);
  const auto found = kWords.find(plain);
  // aslam's and SVO's "fisheye" within `distortion` is the FOV model.
  const bool is_aslams = plain == "fisheye" && plain_name(entry.name) == "distortiontype";
  if (found == kWords.end() || is_aslams)
    throw BadInput(where + ": " + entry.name + " '" + word.substr(0, 40) + "' is not one of " +
                   kKnownWords);
  return found->second;
}

bool flag_of(const YAML::Node& value, const std::string& entry, const std::string& where) {
  std::string word = word_of(value, entry, where);
  for (char& c : word) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (word == "1" || word == "true") return true;
  if (word == "0" || word == "false") return false;
  throw BadInput(where + ": " + entry + " is neither 0 nor 1");
}

Said model_of(CameraEntries& entries) {
  Said said;
  for (const Entry& entry : entries.take_all(kModel)) {
    const Lens lens = lens_of(entry, entries.where());
    if (lens == Lens::kAny) continue;
    if (said.lens != Lens::kAny && said.lens != lens) refuse_both(entries, said.by, entry.name);
    said = {lens, entry.name};
  }
  const auto flag = take(entries, kFisheyeFlag, flag_of);
  if (!flag) return said;
  if (said.lens != Lens::kAny && flag->value != (said.lens == Lens::kFisheye))
    refuse_both(entries, said.by, flag->entry);
  if (flag->value) said = {Lens::kFisheye, flag->entry};
  return said;
}

using Coefficients = Found<std::vector<double>>;

// The coefficients that are entries of their own, in the lens's order.
std::optional<Coefficients> named_coefficients(CameraEntries& entries, bool is_fisheye) {
  const Names& order = is_fisheye ? kFisheyeNames : kBrownNames;
  std::optional<Coefficients> found;
  for (const char* name : kBrownNames) {
    const auto number = take_number(entries, {name});
    if (!number) continue;
    const auto place = std::find_if(order.begin(), order.end(),
                                    [&](const char* other) { return std::string(other) == name; });
    if (!found) found = {number->entry, std::vector<double>(order.size(), 0.0)};
    if (place != order.end())
      found->value[static_cast<size_t>(place - order.begin())] = number->value;
    else if (number->value != 0)
      throw BadInput(entries.where() + ": " + number->entry +
                     " is not 0, but an equidistant lens has k1 k2 k3 k4");
  }
  return found;
}

bool agree(std::vector<double> a, std::vector<double> b) {
  a.resize(std::max(a.size(), b.size()));
  b.resize(a.size());
  return a == b;
}

void read_distortion(CameraEntries& entries, const Said& said, tv_camera& camera,
                     std::vector<std::string>& left_out) {
  const std::string& where = entries.where();
  const bool is_fisheye = said.lens == Lens::kFisheye;
  const bool is_kalibrs = entries.has({"distortion_coeffs"});
  const auto vector = take(entries, kDistortion, numbers_of);
  const auto named = named_coefficients(entries, is_fisheye);
  if (vector && named && !agree(vector->value, named->value))
    refuse_both(entries, vector->entry, named->entry);
  if (!vector && !named) {
    if (said.lens == Lens::kAny || said.lens == Lens::kNone) return;
    entries.refuse_missing(is_kalibrs ? "distortion_coeffs" : kDistortion[0]);
  }
  const Coefficients found = vector ? *vector : *named;
  const std::vector<double>& k = found.value;
  if (said.lens == Lens::kNone) {
    if (std::any_of(k.begin(), k.end(), [](double v) { return v != 0; }))
      throw BadInput(where + ": " + said.by + " says that there is no distortion, but " +
                     found.entry + " is not 0");
    return;
  }
  const auto* const end = std::end(kOpencvCounts);
  if (is_fisheye ? k.size() != 4 : std::find(std::begin(kOpencvCounts), end, k.size()) == end)
    throw BadInput(where + ": " + found.entry + " has " + std::to_string(k.size()) +
                   " numbers, not " + (is_fisheye ? "4" : "4, 5, 8, 12 or 14"));
  for (size_t i = kModelled; i < k.size(); ++i) {
    if (k[i] == 0) continue;
    throw BadInput(where + ": " + found.entry + " has " + std::to_string(k.size()) +
                   " numbers, of which " + found.entry + "[" + std::to_string(i) +
                   "] is not 0: the lens models here end with the first 8 (no thin prism, no "
                   "tilted sensor); calibrate with 5 or 8");
  }
  // cv2.fisheye has four coefficients as well, and its users save them without a model's name.
  if (said.lens == Lens::kAny && vector && k.size() == 4 &&
      std::any_of(k.begin(), k.end(), [](double v) { return v != 0; }))
    left_out.push_back(vector->entry +
                       " as a fisheye's k1 k2 k3 k4 (4 numbers without a distortion_model are "
                       "k1 k2 p1 p2)");
  std::copy_n(k.begin(), std::min(k.size(), kModelled), camera.k);
  camera.model = is_fisheye ? TV_CAMERA_KANNALA_BRANDT : TV_CAMERA_BROWN_CONRADY;
}

// ---- ROS's pictures ----------------------------------------------------------------------------

// roi (x, y, width, height) and binning (x, y); 0 where a file has none.
std::array<int, 6> roi_of(CameraEntries& entries) {
  std::array<int, 6> roi{};
  for (size_t i = 0; i < kRoi.size(); ++i) {
    const auto number = take(entries, {kRoi[i]}, number_of);
    if (!number) continue;
    if (number->value != std::floor(number->value) || number->value < 0 || number->value > 1e6)
      throw BadInput(entries.where() + ": " + number->entry + " is not a number of pixels");
    roi[i] = static_cast<int>(number->value);
  }
  return roi;
}

// The camera of ROS's picture, which is the part `roi` of the sensor with binning_x x binning_y
// pixels made one. `camera` is of the whole sensor.
void take_part_of_sensor(const std::array<int, 6>& roi, const std::string& where,
                         tv_camera& camera) {
  const auto [x, y, roi_width, roi_height, roi_bin_x, roi_bin_y] = roi;
  const int width = roi_width ? roi_width : camera.width - x;
  const int height = roi_height ? roi_height : camera.height - y;
  if (width < 1 || height < 1 || x + width > camera.width || y + height > camera.height)
    throw BadInput(where + ": roi is not within the " + std::to_string(camera.width) + "x" +
                   std::to_string(camera.height) + " image");
  const int bin_x = std::max(1, roi_bin_x), bin_y = std::max(1, roi_bin_y);
  if (bin_x > width || bin_y > height)
    throw BadInput(where + ": binning is above the image's size");
  camera.width = width / bin_x;
  camera.height = height / bin_y;
  camera.fx /= bin_x;
  camera.fy /= bin_y;
  camera.cx = (camera.cx - x + 0.5) / bin_x - 0.5;
  camera.cy = (camera.cy - y + 0.5) / bin_y - 0.5;
}

// The entries of ROS's rectified pictures, where these differ from the camera's own.
void take_rectified(CameraEntries& entries, const Four& K, std::vector<std::string>& left_out) {
  const std::vector<double> identity = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const std::vector<double> own = {K[0], 0, K[2], 0, 0, K[1], K[3], 0, 0, 0, 1, 0};
  const auto rectification = take(entries, kRectification, numbers_of);
  const auto projection = take(entries, kProjection, numbers_of);
  if (rectification && rectification->value != identity)
    left_out.push_back(rectification->entry + " (of rectified pictures)");
  if (projection && projection->value != own)
    left_out.push_back(projection->entry + " (of rectified pictures)");
}

}  // namespace

std::string plain_name(const std::string& name) {
  std::string plain;
  for (const char c : name) {
    const bool is_upper = c >= 'A' && c <= 'Z';
    if (is_upper || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9'))
      plain += is_upper ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return plain;
}

CameraEntries::CameraEntries(const YAML::Node& map, const std::string& where) : where_(where) {
  for (const auto& item : map) add(key_of(item.first), item.second);
}

void CameraEntries::add(const std::string& name, const YAML::Node& value) {
  const std::string plain = plain_name(name);
  const bool is_roi = plain == "roi";
  const bool is_group = plain != "k" && plain != "d" && value.IsMap() && value.size() > 0 &&
                        (is_roi || is_among(plain, kMatrix) || is_among(plain, kDistortion) ||
                         is_among(plain, kSize)) &&
                        !value["data"] && !value["rows"] && !value["cols"] && !value["sizes"];
  if (!is_group) {
    left_.push_back({plain, name, value});
    return;
  }
  for (const auto& item : value) {
    const std::string inner = key_of(item.first);
    left_.push_back({(is_roi ? "roi" : "") + plain_name(inner), name + "." + inner, item.second});
  }
}

bool CameraEntries::has(const Names& names) const {
  return std::any_of(left_.begin(), left_.end(),
                     [&](const Entry& entry) { return is_among(entry.plain, names); });
}

std::vector<Entry> CameraEntries::take_all(const Names& names) {
  std::vector<Entry> found, left;
  for (Entry& entry : left_)
    (is_among(entry.plain, names) ? found : left).push_back(std::move(entry));
  left_ = std::move(left);
  return found;
}

std::vector<std::string> CameraEntries::refused(std::vector<std::string>& left_out) const {
  std::vector<std::string> refused;
  for (const Entry& entry : left_) judge(entry.name, entry.value, refused, left_out);
  return refused;
}

std::vector<std::string> CameraEntries::left_out() const {
  std::vector<std::string> found;
  const std::vector<std::string> bad = refused(found);
  if (!bad.empty())
    throw BadInput(
        where_ + ": " + bad[0] +
        " is not understood, and may concern the lens or the size: see "
        "docs/formats.md, or remove it if it does not" +
        (plain_name(bad[0]) == "scale" ? " (the scale of depth pictures, as Replica's?)" : ""));
  return found;
}

void CameraEntries::refuse_missing(const std::string& entry) const {
  std::vector<std::string> ignored;
  constexpr size_t most = 4;
  std::string names;
  size_t count = 0;
  for (const std::string& name : refused(ignored))
    if (!is_known(plain_name(name)) && ++count <= most) names += (count > 1 ? ", " : "") + name;
  throw BadInput(where_ + ": " + entry + " is missing" +
                 (names.empty() ? "" : " (" + names + ": not understood)"));
}

CalibrationSigmas take_sigmas(CameraEntries& entries) {
  CalibrationSigmas sigmas = kPlainFile;
  for (auto [name, value] :
       {std::pair{"focal_sigma", &sigmas.focal}, std::pair{"center_sigma", &sigmas.center}}) {
    const auto number = take_number(entries, {name});
    if (!number) continue;
    *value = number->value;
    if (!(*value >= 0 && *value <= 0.5))
      throw BadInput(entries.where() + ": " + number->entry + " is not in [0, 0.5]");
  }
  return sigmas;
}

tv_camera take_camera(CameraEntries& entries, std::vector<std::string>& left_out) {
  tv_camera camera{};
  const Said said = model_of(entries);
  const Sides size = size_of(entries);
  const Four K = pinhole_of(entries);
  camera.width = size[0];
  camera.height = size[1];
  camera.fx = K[0];
  camera.fy = K[1];
  camera.cx = K[2];
  camera.cy = K[3];
  read_distortion(entries, said, camera, left_out);
  const std::array<int, 6> roi = roi_of(entries);
  take_rectified(entries, K, left_out);
  for (const std::string& name : entries.left_out()) left_out.push_back(name);
  settle_camera(camera, entries.where());
  take_part_of_sensor(roi, entries.where(), camera);
  check(tv_camera_check(&camera), entries.where());
  return camera;
}

bool is_camera(const YAML::Node& map) {
  if (!map.IsMap()) return false;
  for (const auto& item : map) {
    const std::string plain = plain_name(key_of(item.first));
    const bool is_other_map = plain == "k" && item.second.IsMap() && !item.second["data"];
    if (is_among(plain, kPinhole[0]) || is_among(plain, kPinhole[1]) ||
        (is_among(plain, kMatrix) && !is_other_map))
      return true;
  }
  return false;
}

void settle_camera(tv_camera& camera, const std::string& where) {
  const struct {
    int32_t side;
    double focal, center;
    const char* axis;
  } axes[] = {{camera.width, camera.fx, camera.cx, "x"},
              {camera.height, camera.fy, camera.cy, "y"}};
  for (const auto& axis : axes) {
    char text[160];
    require_focal(axis.focal, std::string("f") + axis.axis, where);
    if (axis.focal < kShortestFocal * axis.side) {
      std::snprintf(text, sizeof text,
                    ": f%s is %g pixels for an image of %d: is it in another unit?", axis.axis,
                    axis.focal, axis.side);
      throw BadInput(where + text);
    }
    if (!(axis.center >= -kFarthestCenter * axis.side &&
          axis.center <= (1 + kFarthestCenter) * axis.side)) {
      std::snprintf(text, sizeof text,
                    ": c%s is %g, far outside an image of %d pixels: is this principal point of "
                    "another picture?",
                    axis.axis, axis.center, axis.side);
      throw BadInput(where + text);
    }
  }
  refuse_exchanged(camera, where);
  if (camera.model == TV_CAMERA_BROWN_CONRADY &&
      std::all_of(std::begin(camera.k), std::end(camera.k), [](double k) { return k == 0; }))
    camera.model = TV_CAMERA_PINHOLE;
}

}  // namespace cli
