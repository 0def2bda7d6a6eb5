#include "files/camera_formats.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "base/error.h"
#include "base/output.h"
#include "files/camera_entries.h"
#include "files/xml_values.h"
#include "files/yaml_values.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 20;
constexpr double kHalfPixel = 0.5;  // COLMAP's and nerfstudio's origin is the first pixel's corner
constexpr const char* kKnown =
    "; camera files are OpenCV's or ROS's YAML, JSON or XML (camera_matrix or K), Kalibr's "
    "(intrinsics), ORB-SLAM's (Camera.fx), VINS's (projection_parameters), nerfstudio's (fl_x), "
    "a cameras.yaml (fx fy cx cy) and COLMAP's cameras.txt";
constexpr const char* kWriteOurs =
    "write its numbers as OpenCV's YAML: image_width, image_height, camera_matrix, "
    "distortion_coefficients (docs/formats.md)";

// ---- COLMAP ------------------------------------------------------------------------------------

// COLMAP's camera models: which parameters are fx fy cx cy, and for each parameter behind them its
// place in tv_camera.k ("0" to "7"), or its name where no model here has it, so that it must be 0.
struct ColmapModel {
  const char* name;
  tv_camera_model model;
  std::array<size_t, 4> place;
  std::vector<const char*> tail;
};
const ColmapModel kColmapModels[] = {
    {"SIMPLE_PINHOLE", TV_CAMERA_PINHOLE, {0, 0, 1, 2}, {}},
    {"PINHOLE", TV_CAMERA_PINHOLE, {0, 1, 2, 3}, {}},
    {"SIMPLE_RADIAL", TV_CAMERA_BROWN_CONRADY, {0, 0, 1, 2}, {"0"}},
    {"RADIAL", TV_CAMERA_BROWN_CONRADY, {0, 0, 1, 2}, {"0", "1"}},
    {"OPENCV", TV_CAMERA_BROWN_CONRADY, {0, 1, 2, 3}, {"0", "1", "2", "3"}},
    {"FULL_OPENCV",
     TV_CAMERA_BROWN_CONRADY,
     {0, 1, 2, 3},
     {"0", "1", "2", "3", "4", "5", "6", "7"}},
    {"SIMPLE_FISHEYE", TV_CAMERA_KANNALA_BRANDT, {0, 0, 1, 2}, {}},
    {"FISHEYE", TV_CAMERA_KANNALA_BRANDT, {0, 1, 2, 3}, {}},
    {"SIMPLE_RADIAL_FISHEYE", TV_CAMERA_KANNALA_BRANDT, {0, 0, 1, 2}, {"0"}},
    {"RADIAL_FISHEYE", TV_CAMERA_KANNALA_BRANDT, {0, 0, 1, 2}, {"0", "1"}},
    {"OPENCV_FISHEYE", TV_CAMERA_KANNALA_BRANDT, {0, 1, 2, 3}, {"0", "1", "2", "3"}},
    {"THIN_PRISM_FISHEYE",
     TV_CAMERA_KANNALA_BRANDT,
     {0, 1, 2, 3},
     {"0", "1", "p1", "p2", "2", "3", "sx1", "sy1"}},
    {"RAD_TAN_THIN_PRISM_FISHEYE",
     TV_CAMERA_KANNALA_BRANDT,
     {0, 1, 2, 3},
     {"0", "1", "2", "3", "k4", "k5", "p0", "p1", "s0", "s1", "s2", "s3"}},
    {"SIMPLE_DIVISION", TV_CAMERA_PINHOLE, {0, 0, 1, 2}, {"k"}},
    {"DIVISION", TV_CAMERA_PINHOLE, {0, 1, 2, 3}, {"k"}},
};

bool is_upper_word(const std::string& text) {
  return !text.empty() && std::isupper(static_cast<unsigned char>(text[0])) != 0 &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) {
           return std::isupper(c) != 0 || std::isdigit(c) != 0 || c == '_';
         });
}

std::vector<std::string> fields_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> fields;
  for (std::string field; stream >> field;) fields.push_back(field);
  return fields;
}

double colmap_number(const std::string& text, const std::string& where) {
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end || !std::isfinite(value))
    throw BadInput(where + ": '" + text.substr(0, 40) + "' is no finite number");
  return value;
}

// A line "CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS".
tv_camera colmap_camera(const std::vector<std::string>& fields, const std::string& where) {
  std::vector<double> values;
  for (size_t i = 2; i < fields.size(); ++i) values.push_back(colmap_number(fields[i], where));
  if (values.size() < 2) throw BadInput(where + " is not CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS");
  tv_camera camera{};
  camera.width = side_of(values[0], "WIDTH", where);
  camera.height = side_of(values[1], "HEIGHT", where);
  const std::string& name = fields[1];
  const auto* const model = std::find_if(std::begin(kColmapModels), std::end(kColmapModels),
                                         [&](const ColmapModel& m) { return name == m.name; });
  if (model == std::end(kColmapModels)) {
    std::string known;
    for (const ColmapModel& m : kColmapModels)
      known += (known.empty() ? "" : ", ") + std::string(m.name);
    throw BadInput(where + ": COLMAP's model " + name.substr(0, 40) + " is not one of " + known);
  }
  const size_t first = model->place[3] + 1, count = first + model->tail.size();
  if (values.size() != 2 + count)
    throw BadInput(where + ": " + name + " has " + std::to_string(count) + " parameters, not " +
                   std::to_string(values.size() - 2));
  const double* const p = values.data() + 2;
  camera.fx = p[model->place[0]];
  camera.fy = p[model->place[1]];
  camera.cx = p[model->place[2]] - kHalfPixel;
  camera.cy = p[model->place[3]] - kHalfPixel;
  camera.model = model->model;
  for (size_t i = 0; i < model->tail.size(); ++i) {
    const char* const place = model->tail[i];
    if (place[0] >= '0' && place[0] <= '7')
      camera.k[place[0] - '0'] = p[first + i];
    else if (p[first + i] != 0)
      throw BadInput(where + ": " + name + "'s " + place + " is not 0, and no lens here has it");
  }
  settle_camera(camera, where);
  return camera;
}

// The lines of a text that are neither blank nor comments, split into fields, by line number.
std::vector<std::pair<int, std::vector<std::string>>> lines_of(const std::string& text) {
  std::vector<std::pair<int, std::vector<std::string>>> lines;
  std::istringstream stream(text);
  int number = 0;
  for (std::string line; std::getline(stream, line);) {
    ++number;
    std::vector<std::string> fields = fields_of(line);
    if (!fields.empty() && fields[0][0] != '#') lines.emplace_back(number, std::move(fields));
  }
  return lines;
}

// Whether the first line with content begins as COLMAP's: a number and a model's name.
bool is_colmap(const std::string& text) {
  const auto lines = lines_of(text);
  if (lines.empty() || lines[0].second.size() < 3) return false;
  const std::string& id = lines[0].second[0];
  return std::all_of(id.begin(), id.end(), [](unsigned char c) { return std::isdigit(c) != 0; }) &&
         is_upper_word(lines[0].second[1]);
}

NamedCameras colmap_cameras(const std::string& text, const std::string& path) {
  NamedCameras cameras;
  for (const auto& [number, fields] : lines_of(text)) {
    const std::string where = path + ": line " + std::to_string(number);
    if (fields.size() < 3)
      throw BadInput(where + " is not CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS");
    const tv_camera camera = colmap_camera(fields, where);
    check(tv_camera_check(&camera), where);
    for (const auto& other : cameras)
      if (other.first == fields[0])
        throw BadInput(where + ": camera " + fields[0] + " is given twice");
    cameras.emplace_back(fields[0], camera);
  }
  return cameras;
}

// ---- formats of entries ------------------------------------------------------------------------

void add_camera(CameraFile& file, const std::string& name, CameraEntries entries) {
  file.cameras.emplace_back(name, take_camera(entries, file.left_out));
}

// Judges the entries beside the cameras; how sure the calibration is may be among them.
void judge_rest(CameraFile& file, CameraEntries rest) {
  file.sigmas = take_sigmas(rest);
  for (const std::string& name : rest.left_out()) file.left_out.push_back(name);
}

std::string key_of(const YAML::Node& key) { return key.IsScalar() ? key.Scalar() : "?"; }

std::string word_at(const YAML::Node& map, const std::string& entry, const std::string& file) {
  const YAML::Node node = map[entry];
  if (!node || node.IsNull()) return "";
  if (!node.IsScalar()) throw BadInput(file + ": " + entry + " is not a word");
  return node.Scalar();
}

// Of ORB-SLAM's, stella_vslam's and VINS's settings: the parts that are not of the camera.
bool is_other_setting(const std::string& entry) {
  static const std::set<std::string> parts = {"IMU",
                                              "Viewer",
                                              "ORBextractor",
                                              "System",
                                              "Stereo",
                                              "RGBD",
                                              "Tracking",
                                              "Mapping",
                                              "Feature",
                                              "Initializer",
                                              "PangolinViewer",
                                              "SocketPublisher",
                                              "Preprocessing",
                                              "KeyframeInserter",
                                              "Relocalizer",
                                              "LoopDetector",
                                              "LoopBundleAdjuster",
                                              "GraphOptimizer",
                                              "MarkerModel",
                                              "loopClosing"};
  return parts.count(entry.substr(0, entry.find('.'))) != 0;
}

// ORB-SLAM's settings: Camera.fx, or Camera1.fx and Camera2.fx beside Camera.width.
bool read_orb_slam(CameraFile& file) {
  static const std::regex is_part("(Camera[0-9]*)\\.(.+)");
  static const std::set<std::string> own = {"fx", "fy", "cx", "cy", "k1", "k2",
                                            "p1", "p2", "k3", "k4", "k5", "k6"};
  std::vector<std::pair<std::string, YAML::Node>> parts;  // in the file's order
  YAML::Node shared(YAML::NodeType::Map), rest(YAML::NodeType::Map);
  for (const auto& item : file.root) {
    const std::string entry = key_of(item.first);
    std::smatch match;
    if (std::regex_match(entry, match, is_part)) {
      const std::string name = match[1];
      if (name == "Camera") {
        shared[match[2].str()] = item.second;
        continue;
      }
      auto part = std::find_if(parts.begin(), parts.end(),
                               [&](const auto& other) { return other.first == name; });
      if (part == parts.end())
        part = parts.emplace(parts.end(), name, YAML::Node(YAML::NodeType::Map));
      part->second[match[2].str()] = item.second;
    } else if (!is_other_setting(entry)) {
      rest[entry] = item.second;
    }
  }
  std::vector<std::pair<std::string, YAML::Node>> lenses;
  if (is_camera(shared)) lenses.emplace_back("Camera", YAML::Node(YAML::NodeType::Map));
  for (const auto& [name, values] : parts) {
    if (is_camera(values))
      lenses.emplace_back(name, values);
    else
      rest[name] = values;
  }
  for (const auto& [name, values] : lenses) {
    CameraEntries entries(name == "Camera" ? shared : values, file.path + ": " + name);
    if (name != "Camera")
      for (const auto& item : shared)
        if (own.count(key_of(item.first)) == 0 && !values[key_of(item.first)])
          entries.add(key_of(item.first), item.second);
    add_camera(file, lenses.size() == 1 ? "" : name, std::move(entries));
  }
  if (!lenses.empty()) judge_rest(file, {rest, file.path});
  return !lenses.empty();
}

// VINS's camera files (camodocal): the model's name, and maps of its parameters.
bool read_vins(CameraFile& file) {
  const YAML::Node& root = file.root;
  if (!root["model_type"] ||
      (!root["projection_parameters"] && !root["mirror_parameters"] && !root["poly_parameters"]))
    return false;
  const std::string word = word_at(root, "model_type", file.path), plain = plain_name(word);
  const bool is_fisheye = plain == "kannalabrandt";
  if (!is_fisheye && plain != "pinhole" && plain != "pinholefull")
    throw BadInput(file.path + ": VINS's model_type '" + word.substr(0, 40) +
                   "' is not one of PINHOLE, PINHOLE_FULL, KANNALA_BRANDT: no lens here is that");
  // KANNALA_BRANDT's k2 to k5 are of theta^3 to theta^9; mu, mv are fx, fy.
  static const std::map<std::string, std::string> names = {{"k2", "k1"}, {"k3", "k2"}, {"k4", "k3"},
                                                           {"k5", "k4"}, {"mu", "fx"}, {"mv", "fy"},
                                                           {"u0", "cx"}, {"v0", "cy"}};
  CameraEntries entries(YAML::Node(YAML::NodeType::Map), file.path);
  for (const auto& item : root) {
    const std::string entry = key_of(item.first);
    if (entry == "fisheye" || is_other_setting(entry)) continue;  // `fisheye` is of a mask
    if (entry == "model_type" && !is_fisheye) continue;           // PINHOLE_FULL has k4, k5, k6
    if (!is_fisheye || entry != "projection_parameters" || !item.second.IsMap()) {
      entries.add(entry, item.second);
      continue;
    }
    YAML::Node renamed(YAML::NodeType::Map);
    for (const auto& inner : item.second) {
      const std::string key = key_of(inner.first);
      const auto name = names.find(key);
      renamed[name == names.end() ? "?" + key : name->second] = inner.second;
    }
    entries.add(entry, renamed);
  }
  add_camera(file, "", std::move(entries));
  return true;
}

// nerfstudio's and instant-ngp's transforms.json: COLMAP's numbers with names of their own.
bool read_nerfstudio(CameraFile& file) {
  const YAML::Node& root = file.root;
  if (root["frames"] && root["frames"].IsSequence())
    for (const auto& frame : root["frames"])
      for (const char* key : {"fl_x", "fl_y", "cx", "cy", "k1", "k2", "k3", "k4", "p1", "p2", "w",
                              "h", "distortion_params", "camera_model", "is_fisheye"})
        if (frame.IsMap() && frame[key])
          throw BadInput(file.path + ": a frame has " + key +
                         " of its own (one camera for each picture); " + kWriteOurs);
  if (!root["fl_x"]) return false;
  const std::string model = word_at(root, "camera_model", file.path);
  const std::string flag = plain_name(word_at(root, "is_fisheye", file.path));  // instant-ngp's
  const bool is_fisheye =
      model == "OPENCV_FISHEYE" || model == "FISHEYE" || flag == "true" || flag == "1";
  if (!is_fisheye && root["k4"] && !root["k4"].IsNull() && number_at(root, "k4", file.path) != 0)
    throw BadInput(file.path + ": k4 is not 0, and no lens here has nerfstudio's k4");
  CameraEntries entries(YAML::Node(YAML::NodeType::Map), file.path);
  for (const auto& item : root)
    if (key_of(item.first) != "scale") entries.add(key_of(item.first), item.second);
  if (!root["fl_y"]) entries.add("fl_y", root["fl_x"]);
  add_camera(file, "", std::move(entries));
  file.cameras[0].second.cx -= kHalfPixel;
  file.cameras[0].second.cy -= kHalfPixel;
  return true;
}

// SVO's and maplab's calibration: a list `cameras` of maps `camera`.
bool read_svo(CameraFile& file) {
  const YAML::Node& root = file.root;
  const YAML::Node list = root["cameras"];
  if (!list || !list.IsSequence()) return false;
  for (size_t i = 0; i < list.size(); ++i) {
    const std::string where = file.path + ": cameras[" + std::to_string(i) + "]";
    const YAML::Node item = list[i];
    const YAML::Node inner = item.IsMap() && item["camera"] ? item["camera"] : item;
    if (!is_camera(inner))
      throw BadInput(where + " is no camera with intrinsics (OKVIS's are not read); " + kWriteOurs);
    const bool has_label = inner["label"] && inner["label"].IsScalar();
    const std::string name = has_label ? inner["label"].Scalar() : "cam" + std::to_string(i);
    for (const auto& other : file.cameras)
      if (other.first == name) throw BadInput(where + ": " + name + " is given twice");
    add_camera(file, name, {inner, where});
  }
  YAML::Node rest(YAML::NodeType::Map);
  for (const auto& item : root)
    if (key_of(item.first) != "cameras") rest[key_of(item.first)] = item.second;
  judge_rest(file, {rest, file.path});
  return list.size() > 0;
}

// Kalibr's camchain, a data set's cameras.yaml, stella_vslam's settings: maps by name.
bool read_named(CameraFile& file) {
  CameraEntries rest(YAML::Node(YAML::NodeType::Map), file.path);
  for (const auto& item : file.root) {
    const std::string name = key_of(item.first);
    if (is_camera(item.second))
      add_camera(file, name, {item.second, file.path + ": " + name});
    else if (!is_other_setting(name))
      rest.add(name, item.second);
  }
  if (!file.cameras.empty()) judge_rest(file, std::move(rest));
  return !file.cameras.empty();
}

// ---- formats that are refused by name ----------------------------------------------------------

// What another program's file is, or an empty text.
std::string other_format(const YAML::Node& root) {
  if (root["value0"]) return "Basalt's calibration";
  if (root["fisheye_params"]) return "Gyroflow's lens profile";
  for (const auto& item : root)
    if (item.second.IsMap() && item.second["projection_type"])
      return "OpenSfM's camera_models.json, whose focal length is relative to the picture's size";
  const YAML::Node intrinsics = root["intrinsics"];
  const bool has_maps = intrinsics && intrinsics.IsSequence() &&
                        std::any_of(intrinsics.begin(), intrinsics.end(),
                                    [](const auto& item) { return item.IsMap(); });
  if (root["sfm_data_version"] || has_maps) return "OpenMVG's or AliceVision's scene";
  if (root["P0"] || root["K_00"] || root["P_rect_00"]) return "KITTI's calibration";
  if (root["cameraData"])
    return "DepthAI's calibration of an OAK, each of whose cameras has an intrinsicMatrix, a "
           "distortionCoeff, a width and a height";
  if (root["ModelName"] && root["Params"])
    return "Project Aria's calibration, whose lens models are not ours: undistort its pictures "
           "with "
           "its own tools, as of a pinhole";
  if (root["RadialDistortion"])
    return "MATLAB's camera, whose ImageSize is [rows, columns] and whose first pixel is (1, 1), "
           "not (0, 0); RadialDistortion is k1 k2 (k3), TangentialDistortion p1 p2";
  return "";
}

// Refuses the files of other programs whose cameras are not read, with what to do.
void refuse_by_name(const YAML::Node& root, const std::string& path) {
  static const std::regex is_one_of_two(
      "(m|k|cameramatrix|matrix|mtx|intrinsics?)(1|2|l|r|left|right)|"
      "(left|right)(k|cameramatrix|matrix|mtx|intrinsics?)|(1|2|l|r)(cameramatrix|mtx)");
  std::string names;
  size_t count = 0;
  for (const auto& item : root) {
    if (!item.second.IsMap() && !item.second.IsSequence()) continue;
    const std::string entry = key_of(item.first);
    if (!std::regex_match(plain_name(entry), is_one_of_two) || ++count > 4) continue;
    names += (names.empty() ? "" : ", ") + entry;
  }
  if (!names.empty())
    throw BadInput(path + ": a file of several cameras (" + names +
                   "), which are read one a file: for each, " + kWriteOurs);
  const std::string other = other_format(root);
  if (!other.empty()) throw BadInput(path + ": " + other + "; " + kWriteOurs);
}

// Refuses what is no text: archives of numpy, databases, pickles, COLMAP's .bin.
void refuse_binary(const std::string& text, const std::string& path) {
  const auto begins = [&](std::string_view head) { return text.rfind(head, 0) == 0; };
  std::string what;
  if (begins("PK\x03\x04"))
    what = "a zip archive, as numpy's .npz";
  else if (begins("SQLite format 3"))
    what = "a database, as COLMAP's";
  else if (begins("\xff\xfe") || begins("\xfe\xff"))
    what = "text in UTF-16: save it as UTF-8";
  else if (begins("\x1f\x8b"))
    what = "compressed: unpack it";
  else if (text.find('\0') != std::string::npos)
    what = "a binary file, no text";
  if (!what.empty()) throw BadInput(path + ": " + what + kKnown);
}

// Refuses the text files of other programs, with what to do.
void refuse_text_by_name(const std::string& text, const std::string& path) {
  std::vector<std::string> first;
  std::istringstream stream(text);
  for (std::string line; first.empty() && std::getline(stream, line);) first = fields_of(line);
  if (text.rfind("# oST", 0) == 0 || first == std::vector<std::string>{"[image]"})
    throw BadInput(path +
                   ": ROS's INI (oST); convert it: rosrun camera_calibration_parsers convert "
                   "camera.ini camera.yaml");
  if (!first.empty() && std::regex_match(first[0], std::regex("\\[[A-Z0-9_]+\\]")))
    throw BadInput(path + ": an INI file, as ZED's cameras have; " + kWriteOurs);
  if (text.rfind("Pix4D", 0) == 0) throw BadInput(path + ": Pix4D's camera; " + kWriteOurs);
  static const std::set<std::string> dso = {"Pinhole",     "RadTan", "FOV",
                                            "EquiDistant", "ATAN",   "KannalaBrandt"};
  const bool is_dso = first.size() > 1 && dso.count(first[0]) != 0;
  const bool is_numbers =
      first.size() >= 3 && std::all_of(first.begin(), first.end(), [](const std::string& word) {
        return word.find_first_not_of("-+0123456789.eE") == std::string::npos;
      });
  for (size_t k = 0; k < 2 && k + 4 < first.size(); ++k) {
    static const std::regex model("[A-Z]+(_[A-Z0-9]+)*");
    const auto is_side = [](const std::string& word) {
      return word.find_first_not_of("0123456789") == std::string::npos;
    };
    if (k == 1 && is_side(first[0])) break;
    if (std::regex_match(first[k], model) && is_side(first[k + 1]) && is_side(first[k + 2]))
      throw BadInput(path + ": a line of COLMAP's cameras.txt begins with the camera's number: 1 " +
                     first[k] + " " + first[k + 1] + " " + first[k + 2] + " ...");
  }
  if (!is_dso && !is_numbers) return;
  const std::string what =
      is_dso ? "a camera of DSO, whose numbers may be relative to the picture's size"
      : first.size() == 3 || first.size() == 4
          ? "a matrix alone (ScanNet's intrinsics?), without the picture's size"
      : first.size() == 6 ? "width, height, fx, fy, cx, cy, as of ARKitScenes' .pincam?"
                          : "a camera of DSO, LSD-SLAM or PTAM (tum_ardrone)? Their numbers may be "
                            "relative to the picture's size";
  throw BadInput(path + ": numbers without names: " + what + "; " + kWriteOurs);
}

// ---- any format --------------------------------------------------------------------------------

YAML::Node root_of(const std::string& text, const std::string& path) {
  try {
    return is_xml(text) ? parse_xml(text, path) : parse_yaml(text, path);
  } catch (const BadInput& e) {
    throw BadInput(e.what() + std::string(kKnown));
  }
}

void read_entries(CameraFile& file) {
  const YAML::Node& root = file.root;
  if (is_camera(root) && !root["fl_x"] && !root["model_type"]) {
    refuse_by_name(root, file.path);
    CameraEntries entries(root, file.path);
    file.sigmas = take_sigmas(entries);
    const bool has_name = root["camera_name"] && root["camera_name"].IsScalar();
    add_camera(file, has_name ? root["camera_name"].Scalar() : "", std::move(entries));
    return;
  }
  if (read_orb_slam(file) || read_vins(file) || read_nerfstudio(file) || read_svo(file)) return;
  refuse_by_name(root, file.path);
  if (root["cam0_calib"])
    throw BadInput(file.path + ": VINS's settings, whose cameras are in files of their own: give " +
                   word_at(root, "cam0_calib", file.path).substr(0, 80) + " (cam0_calib)");
  if (read_named(file)) return;
  try {
    CameraEntries(root, file.path).refuse_missing("camera_matrix");
  } catch (const BadInput& e) {
    throw BadInput(e.what() + std::string(kKnown));
  }
}

std::string names_of(const NamedCameras& cameras) {
  constexpr size_t most = 8;
  std::string text;
  for (size_t i = 0; i < std::min(most, cameras.size()); ++i)
    text += (i ? ", " : "") + cameras[i].first;
  return text + (cameras.size() > most ? ", ..." : "");
}

// The place of the colon in PATH:NAME; npos if `given` is a path.
size_t colon_of(const std::string& given) {
  std::error_code error;
  if (std::filesystem::exists(given, error)) return std::string::npos;
  const size_t colon = given.rfind(':');
  if (colon == std::string::npos || colon == 0 ||
      !std::filesystem::exists(given.substr(0, colon), error))
    return std::string::npos;
  return colon;
}

}  // namespace

const tv_camera& CameraFile::of(const std::string& image_name) const {
  const bool names_count = !is_colmap || cameras.size() == 1;
  const tv_camera* const camera =
      names_count ? choose_camera(cameras, image_name, nullptr) : nullptr;
  if (camera) return *camera;
  throw BadInput(
      path + " has " + std::to_string(cameras.size()) + " cameras (" + names_of(cameras) + ")" +
      (image_name.empty() || is_colmap ? ""
                                       : ", and no such name begins that of image " + image_name) +
      ": name one, such as " + path + ":" + cameras[0].first);
}

std::string CameraFile::note() const { return left_out_note(path, left_out); }

CameraFile parse_camera_file(const std::string& given, const std::string& path) {
  CameraFile file;
  file.path = path;
  const std::string text = given.compare(0, 3, "\xef\xbb\xbf") == 0 ? given.substr(3) : given;
  if (is_colmap(text)) {
    file.cameras = colmap_cameras(text, path);
    file.is_colmap = true;
    return file;
  }
  refuse_binary(text, path);
  refuse_text_by_name(text, path);
  file.root = root_of(text, path);
  read_entries(file);
  return file;
}

tv_camera parse_camera(const std::string& text, const std::string& path) {
  return parse_camera_file(text, path).of("");
}

CameraFile load_camera_file(const std::string& given) {
  const size_t colon = colon_of(given);
  const std::string path = camera_path(given);
  std::error_code error;
  if (std::filesystem::exists(std::filesystem::path(path) / "camera.yaml", error))
    throw BadInput("cannot read " + path + ": it is a folder; its camera is " +
                   (std::filesystem::path(path) / "camera.yaml").string());
  CameraFile file = parse_camera_file(read_file(path, kMaxFileBytes), path);
  if (colon == std::string::npos) return file;
  const std::string name = given.substr(colon + 1);
  for (const auto& entry : file.cameras)
    if (entry.first == name) {
      file.cameras = {{name, entry.second}};
      return file;
    }
  throw BadInput(path + " has no camera '" + name + "' but " + names_of(file.cameras));
}

tv_camera load_camera(const std::string& given, const std::string& image_name) {
  return load_camera_file(given).of(image_name);
}

std::string camera_path(const std::string& given) { return given.substr(0, colon_of(given)); }

}  // namespace cli
