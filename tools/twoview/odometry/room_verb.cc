// twoview room FOLDER -o OUT: a flight's pictures and poses to the surface of the room.

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "odometry/odometry_verb.h"
#include "odometry/room_options.h"
#include "odometry/room_source.h"
#include "pair/options.h"
#include "pair/result.h"
#include "room_model/page.h"
#include "room_model/room_files.h"
#include "verbs/common.h"

namespace cli {
namespace {

struct Arguments {
  Common common;
  std::string folder, source, poses, camera;
  double fps = 0;
  RoomSettings settings;
  RoomTruthOptions truth;
  std::string true_poses;
};

const char* const kNoSurface = "no surface: nothing was measured by two keyframes";

std::string summary(const RoomSource& from, const RoomModel& model, const OutputSet& files,
                    const std::string& notes) {
  std::string text = summary_line("source", "%s, %zu frames with a pose", from.name.c_str(),
                                  from.scene.views.size());
  text += notes + room_summary(from.scene, model);
  std::string names;
  for (const std::string& name : files.names()) names += " " + name;
  return text + summary_line("files", "%s:%s%s", files.folder().c_str(), names.c_str(),
                             model.depth_maps.empty() ? "" : " depth/");
}

// The source, once its pictures are found to agree with its poses. Those of a flight were made from
// them: a dozen pictures from its first third on show whether it is still the same source.
RoomSource confirmed(RoomSource from, bool is_flight, const std::atomic<bool>& stop,
                     const Arguments& a) {
  constexpr size_t kOfFlight = 12;
  const Stopwatch watch(!a.common.quiet, "room: matching pictures against the poses");
  if (is_flight)
    add_posed_points(from, from.scene.views.size() / 3, kOfFlight, stop);
  else
    add_posed_points(from, 0, from.scene.views.size(), stop);
  return from;
}

// Finds out what FOLDER is, and reads it: frames with the poses of --poses, a model of COLMAP, or
// the results of a flight.
RoomSource source_of(const Arguments& a, const std::atomic<bool>& stop) {
  if (!a.poses.empty()) {
    if (!a.source.empty())
      throw BadInput("--source is for the results of twoview odometry and models of COLMAP");
    return confirmed(room_source_of_poses(a.folder, a.poses, a.camera, a.fps), false, stop, a);
  }
  if (!a.camera.empty() || a.fps > 0) throw BadInput("--camera and --fps are for --poses");
  std::error_code error;
  const std::filesystem::path folder = a.folder;
  const bool is_flight = std::filesystem::exists(folder / "result.json", error);
  if (!is_flight && std::filesystem::exists(folder / "images.txt", error)) {
    if (a.source.empty())
      throw BadInput("--source is required: the folder of the pictures of the model " + a.folder);
    return confirmed(room_source_of_colmap(a.folder, a.source), false, stop, a);
  }
  if (!is_flight && std::filesystem::exists(folder / "images.bin", error))
    throw BadInput(a.folder +
                   " is a binary model of COLMAP: make it text with colmap model_converter "
                   "--output_type TXT");
  if (!is_flight && std::filesystem::exists(folder / "frames.txt", error))
    throw BadInput("--poses is required: " + a.folder +
                   " holds frames without poses (or run twoview odometry first)");
  return confirmed(room_source_of_flight(a.folder, a.source), true, stop, a);
}

int room(Arguments& a) {
  Common& common = a.common;
  const TrueRoom true_room(a.truth);
  if (!a.true_poses.empty() && !true_room.is_given())
    throw BadInput("--truth is for --truth-mesh and --truth-depth");
  const std::atomic<bool>& stop = stop_flag_for_signals();
  RoomSource from = source_of(a, stop);
  std::optional<TrueSurface> truth;
  if (true_room.is_given()) {
    const TruePath path = true_path(from, a.true_poses);
    truth = true_room.surface(from.scene, path);
    if (!path.problem.empty()) from.notes.push_back(path.problem);
    from.notes.insert(from.notes.end(), path.notes.begin(), path.notes.end());
  }
  OutputSet files(common.output);
  for (const std::string& name : from.files) files.keep(name);
  for (const std::string& name : true_room.files()) files.keep(name);
  for (const std::string& name : {from.truth_file, a.true_poses}) files.keep(name);
  std::vector<std::string> names = kRoomFiles;
  names.insert(names.end(), {"result.json", "report.html"});
  files.require_own({"room", names, {"result.json"}, {"frames.csv"}});
  RoomBuilder builder(from.scene, a.settings);
  read_pictures_with_progress(*from.source, from.masks, from.still, builder, stop, !common.quiet,
                              {});
  RoomModel model = finish_with_progress(builder, !common.quiet);
  from.scene = builder.scene();
  if (truth) add_truth([&truth] { return *truth; }, from.scene, model, !common.quiet, common);
  for (const std::string& mask : from.masks.files()) files.keep(mask);
  for (const std::string& note : from.notes) common.note(note);
  for (const std::string& note : room_notes(model, stop)) common.note(note);
  nlohmann::ordered_json json;
  json["room"] = room_json(from.scene, model);
  json["source"] = from.given;
  json["scale"] = from.scene.is_metric ? "metric" : "unit";
  json["scale_sigma"] = from.scene.scale_sigma > 0 ? nlohmann::ordered_json(from.scene.scale_sigma)
                                                   : nlohmann::ordered_json(nullptr);
  json["notes"] = common.notes;
  json["interrupted"] = stop.load();
  json["options"] = room_options_json(a.settings, a.truth);
  json["options"]["folder"] = a.folder;
  json["options"]["poses"] = nullptr;
  if (!a.poses.empty()) json["options"]["poses"] = a.poses;
  json["options"]["truth"] = nullptr;
  if (!a.true_poses.empty()) json["options"]["truth"] = a.true_poses;
  json["version"] = tv_version_string();
  files.add("result.json", json_text(json));
  files.add("report.html", room_report(from.scene, model, from.name, common.notes, json));
  add_room_files(from.scene, model, files);
  DepthFolder depth(files.folder(), model);
  if (common.json) print(json_text(json));
  const std::string notes = common.note_lines();
  if (common.speaks()) print(summary(from, model, files, notes));
  files.commit();
  files.remove_others(kRoomFiles);
  depth.commit();
  if (!model.triangles.empty()) return kExitPose;
  std::fprintf(stderr, "twoview: %s\n", kNoSurface);
  return kExitNoPose;
}

}  // namespace

void add_room(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = program.add_subcommand(
      "room", "the surface of a room, of the pictures and poses of a flight");
  verb->add_option("FOLDER", a->folder,
                   "what twoview odometry wrote of the flight; frames, with --poses; a model of "
                   "COLMAP as text, with --source")
      ->required()
      ->type_name("FOLDER");
  verb->add_option("--source", a->source,
                   "where the flight's pictures lie now; without: where they lay then; of a model "
                   "of COLMAP: its pictures")
      ->type_name("SOURCE");
  verb->add_option("--poses", a->poses,
                   "poses world_from_cam of the frames: TUM, EuRoC or KITTI; FOLDER is then a "
                   "folder of frames or a film, as for odometry")
      ->type_name("FILE");
  verb->add_option("--camera", a->camera, "camera file, with --poses; without: what FOLDER says")
      ->type_name("FILE");
  add_number(*verb, "fps", &a->fps, 0.001, 10000,
             "frames a second, with --poses, of images without times")
      ->default_str("");
  verb->add_option("--truth", a->true_poses,
                   "true poses of the frames (TUM, EuRoC or KITTI), for --truth-mesh and "
                   "--truth-depth; without: those of the flight's source")
      ->type_name("FILE");
  add_room_options(*verb, a->settings, a->truth);
  add_common(*verb, a->common, 0, "folder for the results");
  verb->final_callback([a, &run] { run = [a] { return room(*a); }; });
}

}  // namespace cli
