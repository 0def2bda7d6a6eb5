#include "odometry/colmap_folder.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>

#include "base/error.h"
#include "files/image_file.h"
#include "pictures/undistorted.h"
#include "report/ply.h"

namespace cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr int kQuality = 95;  // of JPEG
constexpr size_t kMaxPictureBytes = size_t{1} << 30;
const char* const kPictures = "images";
// The model of the pictures: OpenMVS and COLMAP's dense tools look for sparse/, splatting programs
// for sparse/0/.
const std::vector<std::string> kModelFolders = {"sparse", "sparse/0"};
const std::vector<std::string> kModelFiles = {"cameras.txt", "images.txt", "points3D.txt"};
const char* const kCloud = "points3D.ply";      // in sparse/0
const char* const kFrames = "transforms.json";  // nerfstudio's, in the folder itself

// A name that every reader of COLMAP's text takes: no folder, and no blank.
std::string flat_name(const std::string& name) {
  std::string flat = name;
  for (char& c : flat)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '.' && c != '-') c = '_';
  return flat;
}

// Whether the pictures can be used as they are: of a pinhole whose principal point is the middle,
// where splatting programs take it to be.
bool is_centred_pinhole(const tv_camera& c) {
  return c.model == TV_CAMERA_PINHOLE && std::abs(c.cx - 0.5 * (c.width - 1)) < 0.5 &&
         std::abs(c.cy - 0.5 * (c.height - 1)) < 0.5;
}

// Whether every program that reads COLMAP's files also reads this image format.
bool is_usual_format(const std::string& file) {
  std::string ending = fs::path(file).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending == ".jpg" || ending == ".jpeg" || ending == ".png";
}

// Turns pictures of the lens into those of a pinhole.
class Maker {
 public:
  explicit Maker(const tv_camera& lens) : lens_(lens), camera_(lens) {
    if (is_centred_pinhole(lens)) return;
    camera_ = pinhole_of(lens);
    camera_.cx = 0.5 * (lens.width - 1);
    camera_.cy = 0.5 * (lens.height - 1);
    map_ = undistort_map(lens, camera_);
    // Black borders would be taken for part of the scene.
    const cv::Rect middle = seen_middle(*map_);
    camera_.width = middle.width;
    camera_.height = middle.height;
    camera_.cx -= middle.x;
    camera_.cy -= middle.y;
    if (middle.empty()) return;
    map_->place = map_->place(middle).clone();
    map_->seen = map_->seen(middle).clone();
  }
  const tv_camera& camera() const { return camera_; }
  bool has_pictures() const { return camera_.width > 0; }

  // The file's name and content. Throws BadInput.
  std::pair<std::string, std::string> file_of(const SourceFrame& frame) const {
    const std::string name = flat_name(fs::path(frame.name).filename().string());
    if (!map_ && !frame.file.empty() && is_usual_format(frame.file))
      return {name, read_file(frame.file, kMaxPictureBytes)};
    const cv::Mat& whole = frame.colour.empty() ? frame.luma : frame.colour;
    return {fs::path(name).stem().string() + (map_ ? "_undistorted.jpg" : ".jpg"),
            jpeg_bytes(map_ ? undistorted(whole, *map_) : whole, kQuality)};
  }
  bool fits(const SourceFrame& frame) const {
    return frame.luma.cols == lens_.width && frame.luma.rows == lens_.height;
  }

 private:
  tv_camera lens_, camera_;
  std::optional<UndistortMap> map_;
};

// The names that the images.txt of an earlier run lists: every second line that is no comment.
std::vector<std::string> names_in(const fs::path& images_txt) {
  std::vector<std::string> names;
  std::ifstream file(images_txt);
  std::string line, word;
  for (bool is_head = true; std::getline(file, line);) {
    if (!line.empty() && line[0] == '#') continue;
    if (is_head) {
      std::istringstream words(line);
      int count = 0;
      while (words >> word) ++count;
      if (count == 10 && word == flat_name(word)) names.push_back(word);
    }
    is_head = !is_head;
  }
  return names;
}

Json row_of(double a, double b, double c, double d) { return {a, b, c, d}; }

// nerfstudio's cameras look along -z, with y up; its pixels are COLMAP's.
std::string transforms_json(const FlightResult& result, const ColmapPictures& pictures) {
  const tv_camera& c = pictures.camera;
  Json json = {{"camera_model", "OPENCV"},
               {"w", c.width},
               {"h", c.height},
               {"fl_x", c.fx},
               {"fl_y", c.fy},
               {"cx", c.cx + 0.5},
               {"cy", c.cy + 0.5}};
  for (const char* name : {"k1", "k2", "p1", "p2"}) json[name] = 0.0;
  json["ply_file_path"] = kModelFolders[1] + "/" + kCloud;
  json["frames"] = Json::array();
  for (const FlightKeyframe& key : result.keyframes) {
    const auto name = pictures.names.find(key.keyframe.id);
    if (name == pictures.names.end()) continue;
    const Pose pose = pose_of(key.keyframe);
    const auto& R = pose.R;
    Json matrix = Json::array();
    for (size_t r = 0; r < 3; ++r)
      matrix.push_back(row_of(R[3 * r], -R[3 * r + 1], -R[3 * r + 2], pose.t[r]));
    matrix.push_back(row_of(0, 0, 0, 1));
    json["frames"].push_back({{"file_path", std::string(kPictures) + "/" + name->second},
                              {"transform_matrix", matrix},
                              {"colmap_im_id", key.keyframe.id + 1}});
  }
  return json.dump(2) + "\n";
}

// The points that the pictures see, as splatting programs begin with them: with normals, of 0.
std::string cloud_ply(const FlightResult& result, const ColmapPictures& pictures) {
  std::set<int32_t> seen;
  for (const FlightKeyframe& key : result.keyframes)
    if (pictures.names.count(key.keyframe.id) != 0)
      for (const tv_map_observation& observation : key.observations)
        if (observation.idx_point >= 0) seen.insert(observation.idx_point);
  std::string bytes = ply_header({}, seen.size(),
                                 {{PlyType::kFloat, {"x", "y", "z", "nx", "ny", "nz"}},
                                  {PlyType::kUchar, {"red", "green", "blue"}}});
  for (const int32_t idx : seen) {
    const size_t k = static_cast<size_t>(idx);
    for (const double value : result.points[k].position)
      append_float(bytes, static_cast<float>(value));
    for (int axis = 0; axis < 3; ++axis) append_float(bytes, 0);
    for (const uint8_t value : result.colours[k]) bytes += static_cast<char>(value);
  }
  return bytes;
}

// Removes the folder if it is empty; a symbolic link to a folder stays.
void remove_empty_folder(const fs::path& folder) {
  std::error_code ignored;
  if (fs::is_directory(fs::symlink_status(folder, ignored))) fs::remove(folder, ignored);
}

std::string megabytes(size_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f MiB", static_cast<double>(bytes) / (1 << 20));
  return text;
}

}  // namespace

ColmapFolder::ColmapFolder(const fs::path& folder, const std::vector<std::string>& inputs,
                           bool has_map)
    : folder_(folder), inputs_(inputs), has_map_(has_map) {
  if (has_map || fs::is_directory(folder)) set_of("");
}

const std::vector<std::string>& ColmapFolder::file_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all = kModelFiles;
    all.push_back(kFrames);
    for (const std::string& folder : kModelFolders)
      for (const std::string& name : kModelFiles) all.push_back(folder + "/" + name);
    all.push_back(kModelFolders[1] + "/" + kCloud);
    return all;
  }();
  return names;
}

OutputSet& ColmapFolder::set_of(const std::string& folder) {
  for (const auto& [name, set] : sets_)
    if (name == folder) return *set;
  sets_.emplace_back(folder, std::make_unique<OutputSet>(folder_ / folder));
  for (const std::string& input : inputs_) sets_.back().second->keep(input);
  return *sets_.back().second;
}

void ColmapFolder::add_model(const FlightResult& result) {
  const ColmapModel model = colmap_model(result);
  OutputSet& files = set_of("");
  files.add("cameras.txt", model.cameras);
  files.add("images.txt", model.images);
  files.add("points3D.txt", model.points);
}

std::vector<std::string> ColmapFolder::add_pictures(const FlightResult& result, FrameSource& source,
                                                    const std::atomic<bool>& stop) {
  const Flight& flight = *result.flight;
  std::map<int, int32_t> ids;  // of the keyframes, by the source's index
  for (const FlightKeyframe& key : result.keyframes)
    if (key.keyframe.segment == result.segment)
      ids[flight.given(key.keyframe.frame).index] = key.keyframe.id;
  if (ids.empty()) return {};
  if (!source.can_run_again())
    return {"colmap/ has no pictures: " + source.kind() + " cannot be read again"};
  const Maker maker(flight.corrected_file_camera());
  if (!maker.has_pictures())
    return {
        "colmap/ has no pictures: the camera sees nothing in the middle of a pinhole's picture"};
  pictures_.camera = maker.camera();
  std::set<std::string> taken;
  std::string problem;
  const auto wanted = [&](int index) { return ids.count(index) != 0; };
  const auto consume = [&](const SourceFrame& frame) {
    const int32_t id = ids.at(frame.index);
    try {
      if (frame.luma.empty()) throw BadInput(frame.problem);
      if (!maker.fits(frame)) throw BadInput("frame " + frame.name + " has another size now");
      auto [name, bytes] = maker.file_of(frame);
      while (!taken.insert(name).second)
        name = fs::path(name).stem().string() + "_" + std::to_string(id) +
               fs::path(name).extension().string();
      set_of(kPictures).add(name, bytes);
      bytes_ += bytes.size();
      pictures_.names[id] = name;
    } catch (const BadInput& e) {
      if (problem.empty()) problem = e.what();
    }
    return frame.index < ids.rbegin()->first;
  };
  try {
    source.run(wanted, consume, stop);
  } catch (const BadInput& e) {
    problem = e.what();
  }
  if (!pictures_.names.empty()) add_files(result);
  const size_t missing = ids.size() - pictures_.names.size();
  if (missing == 0) return {};
  return {"colmap/ lacks the pictures of " + std::to_string(missing) + " of " +
          std::to_string(ids.size()) + " keyframes: " +
          (!problem.empty() ? problem
           : stop           ? "interrupted"
                            : source.kind() + " does not give them again")};
}

void ColmapFolder::add_files(const FlightResult& result) {
  const ColmapModel model = colmap_model(result, &pictures_);
  for (const std::string& folder : kModelFolders) {
    OutputSet& files = set_of(folder);
    files.add("cameras.txt", model.cameras);
    files.add("images.txt", model.images);
    files.add("points3D.txt", model.points);
  }
  set_of(kModelFolders[1]).add(kCloud, cloud_ply(result, pictures_));
  set_of("").add(kFrames, transforms_json(result, pictures_));
}

Json ColmapFolder::pictures_json() const {
  if (pictures_.names.empty()) return nullptr;
  const tv_camera& c = pictures_.camera;
  return {{"num", pictures_.names.size()},
          {"bytes", bytes_},
          {"size", {c.width, c.height}},
          {"focal_length", {c.fx, c.fy}}};
}

std::string ColmapFolder::pictures_words() const {
  const size_t count = pictures_.names.size();
  if (count == 0) return "";
  return std::to_string(count) + (count == 1 ? " picture, " : " pictures, ") + megabytes(bytes_);
}

void ColmapFolder::commit() {
  if (sets_.empty()) return;
  const std::vector<std::string> earlier = names_in(folder_ / kModelFolders[0] / "images.txt");
  for (auto& [folder, set] : sets_) set->commit();
  std::vector<std::string> own = kModelFiles;
  own.insert(own.end(), {kFrames, kCloud});
  for (const std::string& folder :
       {std::string(), std::string(kPictures), kModelFolders[0], kModelFolders[1]}) {
    std::error_code ignored;
    if (fs::is_directory(folder_ / folder, ignored))
      set_of(folder).remove_others(folder == kPictures ? earlier : own);
  }
  for (const std::string& folder : {kModelFolders[1], kModelFolders[0], std::string(kPictures)})
    remove_empty_folder(folder_ / folder);
  if (!has_map_) remove_empty_folder(folder_);
}

}  // namespace cli
