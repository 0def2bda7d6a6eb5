#include "room_model/page.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "pair/result.h"
#include "report/assets.h"
#include "report/html.h"
#include "report/tables.h"
#include "room_model/assets.h"
#include "room_model/plan.h"
#include "room_model/room_files.h"
#include "twoview/version.h"

namespace cli {
namespace {

using Json = nlohmann::ordered_json;

void append_bits(std::string& bytes, uint32_t value, int num_bytes) {
  for (int k = 0; k < num_bytes; ++k) bytes += static_cast<char>(value >> 8 * k & 255);
}

// The room's axes, with the height counted from the floor.
Vector3 in_room(const RoomModel& model, const Vector3& world) {
  Vector3 at = applied(model.axes, world);
  at[2] -= model.floor;
  return at;
}

// The surface with positions of 16 bits: a 65535th of the room is far below a voxel.
Json surface_json(const RoomScene& scene, const RoomModel& model) {
  const RoomMesh& mesh = model.page_mesh;
  std::vector<Vector3> places;
  Vector3 low{INFINITY, INFINITY, INFINITY};
  double extent = 0, most_sigma = 0;
  for (const tv_room_vertex& v : mesh.vertices) {
    places.push_back(
        in_room(model, {static_cast<double>(v.position[0]), static_cast<double>(v.position[1]),
                        static_cast<double>(v.position[2])}));
    for (size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], places.back()[k]);
    most_sigma = std::max(most_sigma, static_cast<double>(v.sigma));
  }
  for (const Vector3& place : places)
    for (size_t k = 0; k < 3; ++k) extent = std::max(extent, place[k] - low[k]);
  const double step = extent > 0 ? extent / 65535 : 1;
  const double sigma_step = most_sigma > 0 ? most_sigma / 255 : 1;
  std::string positions, colours, sigmas, triangles;
  for (size_t i = 0; i < places.size(); ++i) {
    const tv_room_vertex& v = mesh.vertices[i];
    for (size_t k = 0; k < 3; ++k)
      append_bits(positions, static_cast<uint32_t>(std::lround((places[i][k] - low[k]) / step)), 2);
    for (const uint8_t value : v.rgb) colours += static_cast<char>(value);
    append_bits(sigmas,
                static_cast<uint32_t>(std::lround(static_cast<double>(v.sigma) / sigma_step)), 1);
  }
  for (const tv_room_triangle& t : mesh.triangles)
    for (const int32_t idx : t.idx_vertex) append_bits(triangles, static_cast<uint32_t>(idx), 4);
  Json path = Json::array();
  for (const RoomView& view : scene.views)
    for (const double value : in_room(model, view.t))
      path.push_back(std::round(value / step) * step);
  return {{"low", low},
          {"step", step},
          {"positions", base64(positions)},
          {"colours", base64(colours)},
          {"sigma_step", sigma_step},
          {"sigmas", base64(sigmas)},
          {"triangles", base64(triangles)},
          {"path", path},
          {"voxel", mesh.voxel},
          {"unit", scene.is_metric ? "m" : ""},
          {"scale_sigma", scene.scale_sigma}};
}

std::string cards(const RoomScene& scene, const RoomModel& model, const RoomPlan& plan) {
  const std::string unit = scene.is_metric ? "m" : "";
  const std::string words = scene.is_metric ? "" : ", in the path's unit";
  std::string text =
      card(formatted("%.2f", model.size[0]) + " x " + formatted("%.2f", model.size[1]) + " x " +
               formatted("%.2f", model.size[2]),
           unit, "length, width, height" + words, "card wide");
  text += card(formatted("%.1f", plan.area), scene.is_metric ? "m2" : "", "of floor" + words);
  text += card(std::to_string(model.triangles.size()), "", "triangles");
  text += card(formatted("%.3g", model.voxel), unit, "side of a voxel" + words);
  text += card(std::to_string(model.keyframes_used), "", "keyframes with a depth map");
  const double all = static_cast<double>(std::max<int64_t>(1, model.pixels.total()));
  text += card(formatted("%.0f", 100 * static_cast<double>(model.pixels.measured) / all), "%",
               "of their pixels measured");
  if (const double inferred = share_inferred(model); inferred > 0)
    text += card(formatted("%.1f", 100 * inferred), "%",
                 "of the surface inferred: planes carried across plain areas");
  if (model.truth)
    text += card(formatted("%.3f", model.truth->placed.f), "", "F at 5 cm beside the true surface");
  return "<div class=\"cards\">\n" + text + "</div>\n";
}

std::string truth_section(const RoomModel& model) {
  if (!model.truth) return "";
  const TruthScores &placed = model.truth->placed, &registered = model.truth->registered;
  const auto row = [](const char* name, const std::optional<double>& first,
                      const std::optional<double>& second, double factor, const char* format) {
    const auto cell = [&](const std::optional<double>& value) {
      return "<td>" + (value ? formatted(format, factor * *value) : std::string("-")) + "</td>";
    };
    return "<tr><th>" + std::string(name) + "</th>" + cell(first) + cell(second) + "</tr>\n";
  };
  return "<h2>Beside the true surface</h2>\n<table>\n<tr><th></th><td>as placed</td>"
         "<td>registered</td></tr>\n" +
         row("F at 5 cm", placed.f, registered.f, 1, "%.3f") +
         row("precision", placed.precision, registered.precision, 1, "%.3f") +
         row("of what was measured", placed.precision_measured, registered.precision_measured, 1,
             "%.3f") +
         row("of what was inferred", placed.precision_inferred, registered.precision_inferred, 1,
             "%.3f") +
         row("recall", placed.recall, registered.recall, 1, "%.3f") +
         row("median distance to the truth", placed.accuracy_median, registered.accuracy_median,
             100, "%.1f cm") +
         row("median distance from the truth", placed.completeness_median,
             registered.completeness_median, 100, "%.1f cm") +
         "</table>\n<p class=\"hint\">Placed by " + escaped(model.truth->placed_by) +
         ". Registered: after the similarity that fits the surface best. Recall is of what two "
         "keyframes could see.</p>\n";
}

std::string missing_section(const RoomModel& model) {
  const std::vector<std::string> words = missing_words(model);
  if (words.empty()) return "";
  const std::string all = "<h2>Where nothing was measured</h2>\n" + bullets("notes", words);
  if (model.triangles.empty()) return all;  // without a plan there are no directions
  return all + "<p>By the direction in which the keyframes' pixels look:</p>\n" +
         bullets("notes", direction_words(model));
}

}  // namespace

RoomSection room_section(const RoomScene& scene, const RoomModel& model) {
  RoomSection section;
  section.html = "<section>\n<h2>The room</h2>\n";
  if (model.triangles.empty()) {
    section.html += "<p>No surface: nothing was measured by two keyframes.</p>\n" +
                    missing_section(model) + "</section>\n";
    return section;
  }
  const RoomPlan plan = plan_of(scene, model);
  const std::string coarser =
      model.page_mesh.triangles.size() < model.triangles.size()
          ? " This page shows a coarser surface than room.ply and room.glb hold."
          : "";
  section.html +=
      cards(scene, model, plan) +
      "<div class=\"stage\"><canvas id=\"room\" tabindex=\"0\"></canvas>\n"
      "<div class=\"buttons\"><button id=\"room-around\">around</button>"
      "<button id=\"room-top\">top</button><button id=\"room-walk\">walk</button>"
      "<button id=\"room-shape\">colour / shape</button></div></div>\n"
      "<p class=\"hint\" id=\"room-readout\">Click on two places of the surface to measure between "
      "them.</p>\n"
      "<p class=\"hint\">Drag to turn, wheel or pinch to zoom, shift and drag to move. Walking: W "
      "A "
      "S D or the arrows, E and Q up and down. Walls and ceiling are drawn from inside only, so "
      "that one looks in from outside. The path is yellow." +
      coarser + "</p>\n<h2>From above</h2>\n<figure class=\"plan\">" +
      plan_svg(plan, scene, model) +
      "<figcaption>Dark lines are walls, dashed where something hides them or no corner was "
      "measured, thinner ones fronts of furniture, grey whatever else stands upright; the light "
      "area was looked across; the path is blue.</figcaption></figure>\n" +
      missing_section(model) + truth_section(model) + "</section>\n";
  section.script = "<script type=\"application/json\" id=\"room-data\">" +
                   surface_json(scene, model).dump() + "</script>\n<script>\n" + kGesturesScript +
                   kSurfaceScript + kRoomScript + "</script>\n";
  return section;
}

std::string room_report(const RoomScene& scene, const RoomModel& model, const std::string& name,
                        const std::vector<std::string>& notes, const Json& json) {
  const RoomSection section = room_section(scene, model);
  const bool has_surface = !model.triangles.empty();
  const std::string words = has_surface ? std::to_string(model.keyframes_used) +
                                              " keyframes have a depth map; lengths "
                                              "are in " +
                                              (scene.is_metric ? "metres."
                                                               : "the unit of the path, which is "
                                                                 "not the metre.")
                                        : "Nothing was measured by two keyframes.";
  return filled(kRoomPage, {{"title", escaped(name) + ": twoview room"},
                            {"style", kReportStyle},
                            {"heading", escaped(name)},
                            {"verdict_class", has_surface ? "good" : "poor"},
                            {"verdict", has_surface ? "a surface" : "no surface"},
                            {"verdict_words", words},
                            {"notes", bullets("notes", notes)},
                            {"room", section.html},
                            {"json", escaped(json_text(json))},
                            {"version", tv_version_string()},
                            {"script", section.script},
                            {"print", kPrintScript}});
}

}  // namespace cli
