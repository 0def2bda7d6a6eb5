// What `--truth-mesh` and `--truth-depth` name: the true surface of a room, and where it lies in
// the world of the room.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/cli_fwd.h"
#include "odometry/poses.h"
#include "room_model/truth.h"

namespace cli {

struct RoomTruthOptions {
  std::string mesh, depth;  // a file, a folder
  double depth_scale = 0;   // grey levels a metre
};

// Adds --truth-mesh, --truth-depth and --truth-scale. Returns the options that were added.
std::vector<CLI::Option*> add_truth_options(CLI::App& verb, RoomTruthOptions& options);
nlohmann::ordered_json truth_options_json(const RoomTruthOptions& options);

// True poses of the frames of a scene, in the truth's frame and in metres.
struct TruePath {
  bool is_own = false;             // the scene's poses are the true ones
  Trajectory poses;                // world_from_cam, in the frames' times; empty: not known
  std::string problem;             // a line on their times or rotations; empty: none
  std::vector<std::string> notes;  // on what else is odd of them
};

// The message where --truth-mesh is given without a true path.
extern const char* const kMeshNeedsPath;

class TrueRoom {
 public:
  // Reads what the options name. Throws BadInput.
  explicit TrueRoom(const RoomTruthOptions& options);
  bool is_given() const { return !options_.mesh.empty() || !options_.depth.empty(); }
  // The files of the truth, read or still to be read, which no output may replace.
  const std::vector<std::string>& files() const { return files_; }

  // The surface in its frame. A mesh needs the true path; pictures of depths that have none lie
  // where the scene's poses put them, with a scale fitted to the scene's points unless it is in
  // metres. Throws BadInput where it cannot be placed.
  TrueSurface surface(const RoomScene& scene, const TruePath& path) const;

 private:
  struct Shown {
    size_t view;
    TrueDepth picture;
  };
  std::vector<Shown> pictures_of(const RoomScene& scene) const;

  RoomTruthOptions options_;
  TriangleMesh mesh_;
  std::vector<std::string> files_;
};

}  // namespace cli
