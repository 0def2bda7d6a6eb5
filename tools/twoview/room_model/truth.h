// A room's surface beside the true one: precision, recall and F at 5 cm, as docs/room.md defines
// them.
#pragma once

#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "room_model/scene.h"
#include "room_model/triangle_tree.h"

namespace cli {

// A picture of true distances, of the size of `camera`, in the truth's frame.
struct TrueDepth {
  tv_camera camera{};
  Matrix3 R{1, 0, 0, 0, 1, 0, 0, 0, 1};  // truth_from_cam
  Vector3 t{0, 0, 0};
  cv::Mat depth;  // CV_32F: metres along the optical axis, 0 where it is unknown
};

// The true surface, in its own frame and in metres.
struct TrueSurface {
  TriangleMesh mesh;
  // Where the surface is known from pictures: what none of them shows is not judged. Empty: all of
  // it is known.
  std::vector<TrueDepth> pictures;
  Placement truth_from_world;
  std::string placed_by;  // what truth_from_world is from, in words
};

// The triangles between neighbouring pixels of the pictures, but not across edges in depth.
TriangleMesh mesh_of(const std::vector<TrueDepth>& pictures);

// The scene's camera and views are those that the model was made of. Throws BadInput where two
// keyframes could see nothing of the truth.
RoomTruth compared(const RoomScene& scene, const RoomModel& model, const TrueSurface& truth);

nlohmann::ordered_json truth_json(const RoomTruth& truth);
// A sentence without an end.
std::string truth_words(const RoomTruth& truth);

}  // namespace cli
