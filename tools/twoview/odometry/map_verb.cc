// twoview map info FILE, twoview map export FILE -o OUT and twoview map merge FILES -o OUT: what
// maps hold, without their frames.

#include <CLI/App.hpp>
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/output.h"
#include "odometry/odometry_verb.h"
#include "odometry/outputs.h"
#include "pair/result.h"

namespace cli {
namespace {

constexpr size_t kMaxMapBytes = size_t{1} << 31;
// Where the header of a map has the camera and the counts (docs/formats.md).
constexpr size_t kCameraAt = 24, kCountsAt = 136, kHeaderBytes = 172;

struct FreeMemory {
  void operator()(void* memory) const { std::free(memory); }
};

template <class T>
T little_endian(const std::string& bytes, size_t at) {
  T value{};
  uint64_t bits = 0;
  for (size_t k = 0; k < sizeof value; ++k)
    bits |= static_cast<uint64_t>(static_cast<uint8_t>(bytes[at + k])) << (8 * k);
  const uint32_t low = static_cast<uint32_t>(bits);
  if constexpr (sizeof value == 4)
    std::memcpy(&value, &low, 4);
  else
    std::memcpy(&value, &bits, 8);
  return value;
}

// The bytes of a map, and what their header says: the library has not checked them yet.
struct MapFile {
  explicit MapFile(const std::string& file) : path(file), bytes(read_file(file, kMaxMapBytes)) {
    if (bytes.size() < kHeaderBytes || bytes.compare(0, 5, "TVMAP") != 0)
      throw BadInput(path + " is no map of twoview odometry");
    camera.model = little_endian<int32_t>(bytes, kCameraAt);
    camera.width = little_endian<int32_t>(bytes, kCameraAt + 4);
    camera.height = little_endian<int32_t>(bytes, kCameraAt + 8);
    double* const numbers[] = {&camera.fx, &camera.fy, &camera.cx, &camera.cy};
    for (size_t k = 0; k < 4; ++k)
      *numbers[k] = little_endian<double>(bytes, kCameraAt + 16 + 8 * k);
    for (size_t k = 0; k < 8; ++k)
      camera.k[k] = little_endian<double>(bytes, kCameraAt + 48 + 8 * k);
    num_points = little_endian<int32_t>(bytes, kCountsAt);
    num_keyframes = little_endian<int32_t>(bytes, kCountsAt + 4);
  }
  const uint8_t* data() const { return reinterpret_cast<const uint8_t*>(bytes.data()); }

  std::string path, bytes;
  tv_camera camera{};
  int64_t num_points = 0, num_keyframes = 0;
};

// Maps that the library has read and checked, as one.
class LoadedMap {
 public:
  explicit LoadedMap(const std::vector<std::string>& paths) {
    std::vector<MapFile> files(paths.begin(), paths.end());
    camera_ = files[0].camera;
    int64_t num_points = 0, num_keyframes = 0;
    for (const MapFile& file : files) {
      num_points += file.num_points;
      num_keyframes += file.num_keyframes;
    }
    tv_odometry_options options;
    tv_odometry_options_init(&options);
    options.max_keypoints = 4096;
    options.max_points = static_cast<int32_t>(std::clamp<int64_t>(num_points, 500, 200000));
    options.max_keyframes = static_cast<int32_t>(std::clamp<int64_t>(num_keyframes, 8, 2000));
    size_t size = 0;
    check(tv_odometry_size(&camera_, &options, &size), paths[0]);
    const size_t unit = TV_CONTEXT_ALIGNMENT;
    memory_.reset(std::aligned_alloc(unit, (size + unit - 1) / unit * unit));
    if (!memory_) throw BadInput("not enough memory for the map " + paths[0]);
    check(tv_odometry_init(&odometry_, &camera_, &options, memory_.get(), size), paths[0]);
    for (const MapFile& file : files) add(file);
    check(tv_odometry_camera(odometry_, &camera_), paths[0]);
    int32_t count = 0;
    points_.resize(static_cast<size_t>(options.max_points));
    check(tv_odometry_points(odometry_, points_.data(), options.max_points, &count), paths[0]);
    points_.resize(static_cast<size_t>(count));
    keyframes_ = keyframes_of(odometry_, options.max_keypoints);
  }
  const tv_camera& camera() const { return camera_; }
  const std::vector<tv_map_point>& points() const { return points_; }
  const std::vector<FlightKeyframe>& keyframes() const { return keyframes_; }
  std::vector<FlightKeyframe> keyframes_with_covariances() const {
    std::vector<FlightKeyframe> keyframes = keyframes_;
    add_covariances(odometry_, keyframes);
    return keyframes;
  }

  // How many segments of the maps after the first one met one before.
  int32_t num_joined() const { return num_joined_; }

  std::string bytes() const {
    size_t size = 0;
    check(tv_odometry_save_size(odometry_, &size), "the map");
    std::string bytes(size, '\0');
    check(tv_odometry_save(odometry_, reinterpret_cast<uint8_t*>(&bytes[0]), size, &size),
          "the map");
    return bytes;
  }

  nlohmann::ordered_json json() const {
    size_t observations = 0;
    for (const FlightKeyframe& key : keyframes_)
      observations += static_cast<size_t>(key.keyframe.num_observations);
    nlohmann::ordered_json json;
    json["image_size"] = {camera_.width, camera_.height};
    json["camera"] = {{"model", camera_.model}, {"fx", camera_.fx}, {"fy", camera_.fy},
                      {"cx", camera_.cx},       {"cy", camera_.cy}, {"k", camera_.k}};
    json["num_keyframes"] = keyframes_.size();
    json["num_points"] = points_.size();
    json["num_observations"] = observations;
    json["num_segments"] = count_segments(keyframes_);
    json["seconds"] = keyframes_.empty()
                          ? 0.0
                          : keyframes_.back().keyframe.time_s - keyframes_.front().keyframe.time_s;
    return json;
  }

 private:
  void add(const MapFile& file) {
    int32_t joined = 0;
    const tv_status status = tv_odometry_add(odometry_, file.data(), file.bytes.size(), &joined);
    if (status == TV_ERR_LIMITS)
      throw BadInput(file.path + ": more than 2000 keyframes or 200000 points in one map");
    check(status, file.path);
    num_joined_ += joined;
  }

  tv_camera camera_{};
  int32_t num_joined_ = 0;
  tv_odometry* odometry_ = nullptr;  // in the memory below
  std::unique_ptr<void, FreeMemory> memory_;
  std::vector<tv_map_point> points_;
  std::vector<FlightKeyframe> keyframes_;
};

void print_info(const nlohmann::ordered_json& json) {
  const int segments = json["num_segments"].get<int>();
  print(summary_line("camera", "%d x %d, fx %.6g", json["image_size"][0].get<int>(),
                     json["image_size"][1].get<int>(), json["camera"]["fx"].get<double>()) +
        summary_line("map", "%d keyframes over %.3f s, %d points, %d observations, %d segment%s",
                     json["num_keyframes"].get<int>(), json["seconds"].get<double>(),
                     json["num_points"].get<int>(), json["num_observations"].get<int>(), segments,
                     segments == 1 ? "" : "s"));
}

int map_info(const std::string& path, bool as_json) {
  const nlohmann::ordered_json json = LoadedMap({path}).json();
  if (as_json)
    print(json_text(json));
  else
    print_info(json);
  return 0;
}

int map_merge(const std::vector<std::string>& paths, const std::string& output) {
  const std::filesystem::path target(output);
  OutputSet files(target.has_parent_path() ? target.parent_path() : ".");
  for (const std::string& path : paths) files.keep(path);
  const LoadedMap map(paths);
  files.add(target.filename().string(), map.bytes());
  files.commit();
  print_info(map.json());
  const int32_t joined = map.num_joined();
  print(summary_line(
      "merge", joined == 1 ? "%d segment was seen again" : "%d segments were seen again", joined));
  return 0;
}

int map_export(const std::string& path, const std::string& output) {
  const LoadedMap map({path});
  OutputSet files(output);
  files.keep(path);
  files.require_own({"map export",
                     {"cloud.ply", "keyframes.txt", "covariances.txt"},
                     {"cloud.ply", "keyframes.txt"},
                     {"frames.csv"}});
  FlightResult result;
  result.keyframes = map.keyframes_with_covariances();
  files.add("cloud.ply", map_ply(map.points(), greys_of(map.points()), result.keyframes));
  files.add("keyframes.txt", keyframes_text(result));
  const std::string covariances = covariances_text(result.keyframes);
  if (!covariances.empty()) files.add("covariances.txt", covariances);
  files.commit();
  return 0;
}

}  // namespace

void add_map(CLI::App& program, Run& run) {
  struct Arguments {
    std::string path, output;
    std::vector<std::string> paths;
    bool json = false;
  };
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = program.add_subcommand("map", "what a map of odometry holds");
  verb->require_subcommand(1);
  CLI::App* info = verb->add_subcommand("info", "its camera, keyframes and points");
  info->add_option("FILE", a->path, "map.twm")->required()->type_name("FILE");
  info->add_flag("--json", a->json, "print JSON");
  info->final_callback([a, &run] { run = [a] { return map_info(a->path, a->json); }; });
  CLI::App* files = verb->add_subcommand("export", "cloud.ply and keyframes.txt out of it");
  files->add_option("FILE", a->path, "map.twm")->required()->type_name("FILE");
  files->add_option("-o,--output", a->output, "folder for the files")->required()->type_name("DIR");
  files->final_callback([a, &run] { run = [a] { return map_export(a->path, a->output); }; });
  CLI::App* merge = verb->add_subcommand("merge", "several maps of one camera as one");
  merge->add_option("FILES", a->paths, "map.twm of each")
      ->required()
      ->expected(-2)
      ->type_name("FILE");
  merge->add_option("-o,--output", a->output, "the map that is written")
      ->required()
      ->type_name("FILE");
  merge->final_callback([a, &run] { run = [a] { return map_merge(a->paths, a->output); }; });
}

}  // namespace cli
