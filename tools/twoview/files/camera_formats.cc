#include "files/camera_formats.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "base/error.h"
#include "base/output.h"
#include "files/yaml_values.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 20;
constexpr const char* kKnown =
    "; camera files are OpenCV's or ROS's YAML (camera_matrix or K), Kalibr's (intrinsics), "
    "a cameras.yaml (fx fy cx cy) and COLMAP's cameras.txt";

std::string word_at(const YAML::Node& map, const std::string& entry, const std::string& file) {
  const YAML::Node node = map[entry];
  if (!node || node.IsNull()) return "";
  if (!node.IsScalar()) throw BadInput(file + ": " + entry + " is not a word");
  return node.Scalar();
}

void require_count(const std::vector<double>& values, size_t count, const std::string& entry,
                   const std::string& file) {
  if (values.size() != count)
    throw BadInput(file + ": " + entry + " has " + std::to_string(values.size()) +
                   " numbers, not " + std::to_string(count));
}

int32_t side_of(double value, const std::string& entry, const std::string& file) {
  if (value != std::floor(value) || value < 1 || value > 1e6)
    throw BadInput(file + ": " + entry + " is not a number of pixels");
  return static_cast<int32_t>(value);
}

bool all_zero(const tv_camera& camera) {
  return std::all_of(std::begin(camera.k), std::end(camera.k), [](double k) { return k == 0; });
}

// ---- Kalibr ------------------------------------------------------------------------------------

bool is_kalibr(const YAML::Node& node) {
  return node.IsMap() && static_cast<bool>(node["intrinsics"]);
}

// A camera of Kalibr's camchain, and EuRoC's sensor.yaml, which has the same entries.
tv_camera kalibr_camera(const YAML::Node& root, const std::string& file) {
  const std::string model = word_at(root, "camera_model", file);
  if (!model.empty() && model != "pinhole")
    throw BadInput(file + ": camera_model '" + model + "' is not pinhole");
  const std::vector<double> intrinsics = numbers_at(root, "intrinsics", file);
  require_count(intrinsics, 4, "intrinsics", file);
  const std::vector<double> resolution = numbers_at(root, "resolution", file);
  require_count(resolution, 2, "resolution", file);
  tv_camera camera{};
  camera.width = side_of(resolution[0], "resolution[0]", file);
  camera.height = side_of(resolution[1], "resolution[1]", file);
  require_focal(intrinsics[0], "fx (intrinsics[0])", file);
  require_focal(intrinsics[1], "fy (intrinsics[1])", file);
  camera.fx = intrinsics[0];
  camera.fy = intrinsics[1];
  camera.cx = intrinsics[2];
  camera.cy = intrinsics[3];
  const std::string lens = word_at(root, "distortion_model", file);
  if (lens.empty() || lens == "none") return camera;
  const bool is_fisheye = lens == "equidistant";
  if (!is_fisheye && lens != "radtan" && lens != "radial-tangential" && lens != "plumb_bob")
    throw BadInput(file + ": distortion_model '" + lens +
                   "' is not one of radtan, equidistant, none");
  const std::string entry =
      root["distortion_coeffs"] ? "distortion_coeffs" : "distortion_coefficients";
  const std::vector<double> k = numbers_at(root, entry, file);
  require_count(k, 4, entry, file);
  std::copy(k.begin(), k.end(), camera.k);
  camera.model = is_fisheye         ? TV_CAMERA_KANNALA_BRANDT
                 : all_zero(camera) ? TV_CAMERA_PINHOLE
                                    : TV_CAMERA_BROWN_CONRADY;
  return camera;
}

// ---- COLMAP ------------------------------------------------------------------------------------

// COLMAP's camera models: which parameters are fx fy cx cy; those behind them are the first of
// tv_camera.k.
struct ColmapModel {
  const char* name;
  tv_camera_model model;
  size_t place[4], num_lens;
};
constexpr ColmapModel kColmapModels[] = {
    {"SIMPLE_PINHOLE", TV_CAMERA_PINHOLE, {0, 0, 1, 2}, 0},
    {"PINHOLE", TV_CAMERA_PINHOLE, {0, 1, 2, 3}, 0},
    {"SIMPLE_RADIAL", TV_CAMERA_BROWN_CONRADY, {0, 0, 1, 2}, 1},
    {"RADIAL", TV_CAMERA_BROWN_CONRADY, {0, 0, 1, 2}, 2},
    {"OPENCV", TV_CAMERA_BROWN_CONRADY, {0, 1, 2, 3}, 4},
    {"FULL_OPENCV", TV_CAMERA_BROWN_CONRADY, {0, 1, 2, 3}, 8},
    {"SIMPLE_RADIAL_FISHEYE", TV_CAMERA_KANNALA_BRANDT, {0, 0, 1, 2}, 1},
    {"RADIAL_FISHEYE", TV_CAMERA_KANNALA_BRANDT, {0, 0, 1, 2}, 2},
    {"OPENCV_FISHEYE", TV_CAMERA_KANNALA_BRANDT, {0, 1, 2, 3}, 4},
};
constexpr double kColmapHalfPixel = 0.5;  // COLMAP's origin is the corner of the first pixel

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
  const std::string& name = fields[1];
  const auto* const model = std::find_if(std::begin(kColmapModels), std::end(kColmapModels),
                                         [&](const ColmapModel& m) { return name == m.name; });
  if (model == std::end(kColmapModels)) {
    std::string known;
    for (const ColmapModel& m : kColmapModels)
      known += (known.empty() ? "" : ", ") + std::string(m.name);
    throw BadInput(where + ": COLMAP's model " + name.substr(0, 40) + " is not one of " + known);
  }
  const size_t count = model->place[3] + 1 + model->num_lens;
  if (fields.size() != 4 + count)
    throw BadInput(where + ": " + name + " has " + std::to_string(count) + " parameters, not " +
                   std::to_string(fields.size() < 4 ? 0 : fields.size() - 4));
  std::vector<double> values;
  for (size_t i = 2; i < fields.size(); ++i) values.push_back(colmap_number(fields[i], where));
  const double* const p = values.data() + 2;
  tv_camera camera{};
  camera.width = side_of(values[0], "WIDTH", where);
  camera.height = side_of(values[1], "HEIGHT", where);
  camera.fx = p[model->place[0]];
  camera.fy = p[model->place[1]];
  camera.cx = p[model->place[2]] - kColmapHalfPixel;
  camera.cy = p[model->place[3]] - kColmapHalfPixel;
  require_focal(camera.fx, "fx", where);
  require_focal(camera.fy, "fy", where);
  std::copy(p + model->place[3] + 1, p + count, camera.k);
  camera.model = model->model;
  if (camera.model == TV_CAMERA_BROWN_CONRADY && all_zero(camera)) camera.model = TV_CAMERA_PINHOLE;
  return camera;
}

// The lines of a text that are neither blank nor comments, split into fields, by line number.
std::vector<std::pair<int, std::vector<std::string>>> lines_of(const std::string& text) {
  std::vector<std::pair<int, std::vector<std::string>>> lines;
  std::istringstream stream(text.compare(0, 3, "\xef\xbb\xbf") == 0 ? text.substr(3) : text);
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

bool is_xml(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t\r\n");
  return first != std::string::npos && text[first] == '<';
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

// ---- any format --------------------------------------------------------------------------------

bool is_camera_set(const YAML::Node& root) {
  for (const auto& item : root)
    if (item.second.IsMap())
      for (const char* entry : {"fx", "fy", "image_width"})
        if (item.second[entry]) return true;
  return false;
}

NamedCameras yaml_cameras(const YAML::Node& root, const std::string& path) {
  if (has_camera_matrix(root)) return {{"", camera_from_yaml(root, path)}};
  NamedCameras cameras;
  if (is_kalibr(root)) cameras.emplace_back("", kalibr_camera(root, path));
  for (const auto& item : root)
    if (is_kalibr(item.second)) {
      const std::string name = item.first.IsScalar() ? item.first.Scalar() : "?";
      cameras.emplace_back(name, kalibr_camera(item.second, path + ": " + name));
    }
  for (const auto& [name, camera] : cameras)
    check(tv_camera_check(&camera), path + (name.empty() ? "" : ": " + name));
  if (!cameras.empty()) return cameras;
  if (is_camera_set(root)) return camera_set_from_yaml(root, path);
  throw BadInput(path + ": camera_matrix is missing" + kKnown);
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

CameraFile parse_camera_file(const std::string& text, const std::string& path) {
  CameraFile file;
  file.path = path;
  if (is_colmap(text)) {
    file.cameras = colmap_cameras(text, path);
    file.is_colmap = true;
    return file;
  }
  if (is_xml(text))
    throw BadInput(path +
                   " is XML, which only the Python package reads (twoview.read_cameras): save the "
                   "camera as YAML, as OpenCV does in a file that ends in .yaml");
  YAML::Node root;
  try {
    root = parse_yaml(text, path);
  } catch (const BadInput& e) {
    throw BadInput(e.what() + std::string(kKnown));
  }
  file.cameras = yaml_cameras(root, path);
  file.sigmas = sigmas_from_yaml(root, path);
  return file;
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
