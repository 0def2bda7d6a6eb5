#include "room_model/room_files.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "files/image_file.h"
#include "room_model/plan.h"
#include "room_model/surface_files.h"
#include "room_model/truth.h"

namespace cli {

const std::vector<std::string> kRoomFiles = {"room.ply", "room.glb", "plan.svg", "plan.png"};

namespace {

using Json = nlohmann::ordered_json;

Json shares_json(const PixelCounts& p) {
  const double all = static_cast<double>(std::max<int64_t>(1, p.total()));
  const auto share = [all](int64_t count) { return static_cast<double>(count) / all; };
  return {{"measured", share(p.measured)},
          {"no_texture", share(p.no_texture)},
          {"seen_from_one_place", share(p.one_place)},
          {"unconfirmed", share(p.unconfirmed)},
          {"ambiguous", share(p.ambiguous)}};
}

const char* const kDirectionKeys[kNumDirections] = {"plan_right",  "plan_left", "plan_top",
                                                    "plan_bottom", "up",        "down"};

// A point of the room's axes in the world.
Vector3 in_world(const RoomModel& model, const cv::Point2d& from_above, double height) {
  return applied(transposed(model.axes), {from_above.x, from_above.y, height});
}

Json walls_json(const RoomModel& model, const RoomPlan& plan) {
  Json walls = Json::array();
  for (const PlanLine& line : plan.lines)
    walls.push_back({{"from", in_world(model, line.a, line.low)},
                     {"to", in_world(model, line.b, line.low)},
                     {"height", line.high - line.low},
                     {"normal", in_world(model, line.normal(), 0)},
                     {"sigma", line.sigma},
                     {"is_wall", line.is_wall},
                     {"is_carried", line.is_carried}});
  return walls;
}

std::string short_unit(const RoomScene& scene) { return scene.is_metric ? " m" : ""; }

}  // namespace

double share_inferred(const RoomModel& model) {
  if (model.vertices.empty()) return 0;
  const auto count = std::count_if(model.vertices.begin(), model.vertices.end(),
                                   [](const tv_room_vertex& v) { return v.inferred != 0; });
  return static_cast<double>(count) / static_cast<double>(model.vertices.size());
}

std::string unit_of(const RoomScene& scene) {
  return scene.is_metric ? "m" : "that of the path, which is not the metre";
}

Json room_json(const RoomScene& scene, const RoomModel& model) {
  const double num = std::max(1, model.keyframes_used);
  Json json;
  json["num_vertices"] = model.vertices.size();
  json["num_triangles"] = model.triangles.size();
  json["voxel"] = model.voxel;
  json["first_voxel"] = model.first_voxel;
  json["size"] = model.size;
  const RoomPlan plan = model.triangles.empty() ? RoomPlan{} : plan_of(scene, model);
  json["floor_area"] = plan.area;
  json["walls"] = walls_json(model, plan);
  json["unit"] = scene.is_metric ? "metric" : "unit";
  json["up"] = model.up;
  json["up_source"] = model.up_source;
  json["share_inferred"] = share_inferred(model);
  json["keyframes_used"] = model.keyframes_used;
  json["keyframes_without_depth"] = model.keyframes_without;
  json["pictures_missing"] = model.pictures_missing;
  json["pixels"] = shares_json(model.pixels);
  for (size_t k = 0; k < kNumDirections; ++k) {
    const PixelCounts& towards = model.pixels_towards[k];
    const double all = static_cast<double>(std::max<int64_t>(1, model.pixels.total()));
    Json& entry = json["pixels_towards"][kDirectionKeys[k]];
    entry = shares_json(towards);
    entry["of_all_pixels"] = static_cast<double>(towards.total()) / all;
  }
  json["ms_per_keyframe"] = {
      {"depth", model.ms_depth}, {"fusion", model.ms_fusion}, {"mesh", model.ms_mesh / num}};
  json["memory_bytes"] = model.memory_bytes;
  json["depth_maps"] = nullptr;
  if (!model.depth_maps.empty()) {
    const tv_camera& c = model.map_camera;
    json["depth_maps"] = {{"grey_levels_per_unit", depth_levels(model)},
                          {"image_size", {c.width, c.height}},
                          {"camera_matrix", {c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1}}};
  }
  json["truth"] = model.truth ? truth_json(*model.truth) : Json(nullptr);
  return json;
}

double depth_levels(const RoomModel& model) {
  float most = 0;
  for (const DepthPicture& map : model.depth_maps)
    for (const float depth : map.depth) most = std::max(most, depth);
  if (!(most > 0)) return 1000;
  // A power of ten times 1, 2 or 5: 5000 up to 13 m.
  const double limit = 65535 / static_cast<double>(most);
  const double power = std::pow(10.0, std::floor(std::log10(limit)));
  for (const double digit : {5.0, 2.0})
    if (digit * power <= limit) return digit * power;
  return power;
}

void add_depth_pictures(const RoomModel& model, OutputSet& depth_files) {
  const double levels = depth_levels(model);
  const cv::Size size(model.map_camera.width, model.map_camera.height);
  for (const DepthPicture& map : model.depth_maps) {
    cv::Mat grey(size, CV_16U);
    for (size_t i = 0; i < map.depth.size(); ++i)
      reinterpret_cast<uint16_t*>(grey.data)[i] =
          static_cast<uint16_t>(std::lround(levels * static_cast<double>(map.depth[i])));
    char name[24];
    std::snprintf(name, sizeof name, "%05d.png", map.index);
    depth_files.add(name, png_bytes(grey));
  }
}

void add_room_files(const RoomScene& scene, const RoomModel& model, OutputSet& files) {
  if (model.triangles.empty()) return;
  files.add("room.ply", room_ply(model, unit_of(scene)));
  files.add("room.glb", room_glb(model));
  const RoomPlan plan = plan_of(scene, model);
  files.add("plan.svg", plan_svg(plan, scene, model));
  files.add("plan.png", png_bytes(plan_picture(plan, scene, model)));
}

std::vector<std::string> missing_words(const RoomModel& model) {
  const PixelCounts& p = model.pixels;
  struct Cause {
    int64_t count;
    const char* words;
  };
  Cause causes[] = {
      {p.no_texture, "show a plain area without texture, where there is nothing to compare"},
      {p.one_place, "were seen from one place only: move sideways while you look at them"},
      {p.unconfirmed,
       "have a distance that fewer than two other pictures confirm: seen too seldom, or "
       "contradicted"},
      {p.ambiguous,
       "look different from other places, are too far away, or move: reflections, windows, edges"}};
  std::stable_sort(std::begin(causes), std::end(causes),
                   [](const Cause& a, const Cause& b) { return a.count > b.count; });
  std::vector<std::string> words;
  const double all = static_cast<double>(std::max<int64_t>(1, p.total()));
  for (const Cause& cause : causes) {
    const double percent = 100 * static_cast<double>(cause.count) / all;
    if (percent < 0.5) continue;
    char text[200];
    std::snprintf(text, sizeof text, "%.0f %% of the keyframes' pixels %s", percent, cause.words);
    words.emplace_back(text);
  }
  return words;
}

std::vector<std::string> direction_words(const RoomModel& model) {
  constexpr double kHardly = 0.02;  // below this share of all pixels a direction was hardly seen
  const char* const names[kNumDirections] = {
      "to the right of the plan",  "to the left of the plan", "to the top of the plan",
      "to the bottom of the plan", "upwards, to the ceiling", "downwards, to the floor"};
  std::vector<std::string> sentences;
  const double all = static_cast<double>(std::max<int64_t>(1, model.pixels.total()));
  for (size_t k = 0; k < kNumDirections; ++k) {
    const PixelCounts& p = model.pixels_towards[k];
    const double total = static_cast<double>(std::max<int64_t>(1, p.total()));
    char text[240];
    if (static_cast<double>(p.total()) < kHardly * all) {
      std::snprintf(text, sizeof text, "%s: hardly looked at (%.1f %% of the pixels)", names[k],
                    100 * static_cast<double>(p.total()) / all);
      sentences.emplace_back(text);
      continue;
    }
    const std::pair<int64_t, const char*> causes[] = {
        {p.no_texture, "a plain area without texture"},
        {p.one_place, "seen from one place only"},
        {p.unconfirmed, "seen too seldom, or contradicted"},
        {p.ambiguous, "too far away, moving, reflecting, or at an edge"}};
    const auto most = std::max_element(std::begin(causes), std::end(causes));
    std::snprintf(text, sizeof text, "%s: %.0f %% measured; what is missing is mostly %s (%.0f %%)",
                  names[k], 100 * static_cast<double>(p.measured) / total, most->second,
                  100 * static_cast<double>(most->first) / total);
    sentences.emplace_back(text);
  }
  return sentences;
}

std::string room_summary(const RoomScene& scene, const RoomModel& model) {
  const std::string unit = short_unit(scene);
  std::string text;
  if (model.triangles.empty()) {
    text = summary_line("room", "%s", "no surface");
  } else {
    text = summary_line("room", "%zu triangles, voxels of %.3g%s; %.2f x %.2f x %.2f%s",
                        model.triangles.size(), model.voxel, unit.c_str(), model.size[0],
                        model.size[1], model.size[2], unit.c_str());
  }
  const double all = static_cast<double>(std::max<int64_t>(1, model.pixels.total()));
  text +=
      summary_line("depth", "%d keyframes, %.0f %% of their pixels measured", model.keyframes_used,
                   100 * static_cast<double>(model.pixels.measured) / all);
  for (const std::string& words : missing_words(model))
    text += summary_line("missing", "%s", words.c_str());
  if (model.truth) text += summary_line("truth", "%s", truth_words(*model.truth).c_str());
  text += summary_line("room work",
                       "%.0f ms a keyframe for depth, %.1f ms for fusion, %.0f ms for the surface "
                       "(CPU), in %.0f MiB",
                       model.ms_depth, model.ms_fusion, model.ms_mesh,
                       static_cast<double>(model.memory_bytes) / (1 << 20));
  return text;
}

}  // namespace cli
