// twoview map info FILE and twoview map export FILE -o OUT: what a map holds, without its frames.

#include <algorithm>
#include <cstdlib>
#include <cstring>

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

// A map that the library has read and checked.
class LoadedMap {
 public:
  explicit LoadedMap(const std::string& path) {
    const std::string bytes = read_file(path, kMaxMapBytes);
    if (bytes.size() < kHeaderBytes || bytes.compare(0, 5, "TVMAP") != 0)
      throw BadInput(path + " is no map of twoview odometry");
    camera_.model = little_endian<int32_t>(bytes, kCameraAt);
    camera_.width = little_endian<int32_t>(bytes, kCameraAt + 4);
    camera_.height = little_endian<int32_t>(bytes, kCameraAt + 8);
    double* const numbers[] = {&camera_.fx, &camera_.fy, &camera_.cx, &camera_.cy};
    for (size_t k = 0; k < 4; ++k)
      *numbers[k] = little_endian<double>(bytes, kCameraAt + 16 + 8 * k);
    for (size_t k = 0; k < 8; ++k)
      camera_.k[k] = little_endian<double>(bytes, kCameraAt + 48 + 8 * k);
    tv_odometry_options options;
    tv_odometry_options_init(&options);
    options.max_keypoints = 4096;
    options.max_points = std::clamp(little_endian<int32_t>(bytes, kCountsAt), 500, 200000);
    options.max_keyframes = std::clamp(little_endian<int32_t>(bytes, kCountsAt + 4), 8, 2000);
    size_t size = 0;
    check(tv_odometry_size(&camera_, &options, &size), path);
    const size_t unit = TV_CONTEXT_ALIGNMENT;
    memory_.reset(std::aligned_alloc(unit, (size + unit - 1) / unit * unit));
    if (!memory_) throw BadInput("not enough memory for the map " + path);
    tv_odometry* odometry = nullptr;
    check(tv_odometry_init(&odometry, &camera_, &options, memory_.get(), size), path);
    check(tv_odometry_load(odometry, reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()),
          path);
    int32_t count = 0;
    points_.resize(static_cast<size_t>(options.max_points));
    check(tv_odometry_points(odometry, points_.data(), options.max_points, &count), path);
    points_.resize(static_cast<size_t>(count));
    for (int32_t idx = 0;; ++idx) {
      FlightKeyframe key;
      tv_keyframe_init(&key.keyframe);
      if (tv_odometry_keyframe(odometry, idx, &key.keyframe) != TV_OK) break;
      keyframes_.push_back(key);
    }
    odometry_ = odometry;
  }
  const tv_camera& camera() const { return camera_; }
  const std::vector<tv_map_point>& points() const { return points_; }
  const std::vector<FlightKeyframe>& keyframes() const { return keyframes_; }
  std::vector<FlightKeyframe> keyframes_with_covariances() const {
    std::vector<FlightKeyframe> keyframes = keyframes_;
    add_covariances(odometry_, keyframes);
    return keyframes;
  }

  nlohmann::ordered_json json() const {
    int32_t segments = 0;
    size_t observations = 0;
    for (const FlightKeyframe& key : keyframes_) {
      segments = std::max(segments, key.keyframe.segment + 1);
      observations += static_cast<size_t>(key.keyframe.num_observations);
    }
    nlohmann::ordered_json json;
    json["image_size"] = {camera_.width, camera_.height};
    json["camera"] = {{"model", camera_.model}, {"fx", camera_.fx}, {"fy", camera_.fy},
                      {"cx", camera_.cx},       {"cy", camera_.cy}, {"k", camera_.k}};
    json["num_keyframes"] = keyframes_.size();
    json["num_points"] = points_.size();
    json["num_observations"] = observations;
    json["num_segments"] = segments;
    json["seconds"] = keyframes_.empty()
                          ? 0.0
                          : keyframes_.back().keyframe.time_s - keyframes_.front().keyframe.time_s;
    return json;
  }

 private:
  tv_camera camera_{};
  tv_odometry* odometry_ = nullptr;  // in the memory below
  std::unique_ptr<void, FreeMemory> memory_;
  std::vector<tv_map_point> points_;
  std::vector<FlightKeyframe> keyframes_;
};

int map_info(const std::string& path, bool as_json) {
  const nlohmann::ordered_json json = LoadedMap(path).json();
  if (as_json) {
    print(json_text(json));
    return 0;
  }
  print(summary_line("camera", "%d x %d, fx %.6g", json["image_size"][0].get<int>(),
                     json["image_size"][1].get<int>(), json["camera"]["fx"].get<double>()) +
        summary_line("map", "%d keyframes over %.3f s, %d points, %d observations, %d segments",
                     json["num_keyframes"].get<int>(), json["seconds"].get<double>(),
                     json["num_points"].get<int>(), json["num_observations"].get<int>(),
                     json["num_segments"].get<int>()));
  return 0;
}

int map_export(const std::string& path, const std::string& output) {
  const LoadedMap map(path);
  OutputSet files(output);
  files.keep(path);
  FlightResult result;
  result.keyframes = map.keyframes_with_covariances();
  files.add("cloud.ply", map_ply(map.points()));
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
}

}  // namespace cli
