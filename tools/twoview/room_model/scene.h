// What a room is made from, how, and what comes out.
#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/matrix.h"
#include "room_model/truth_scores.h"
#include "twoview/camera.h"
#include "twoview/room.h"

namespace cli {

// A frame with its pose world_from_cam.
struct RoomView {
  int index = 0;  // of its picture among all frames of the source
  std::string name;
  Matrix3 R{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 t{0, 0, 0};
  bool is_keyframe = false;  // gets a depth map
  double time_s = 0;         // of the frame, where the source has times
  bool has_picture = true;   // false: of a live source, and not kept
};

// The frames of one segment, in the order in which their pictures come, and points that they see.
struct RoomScene {
  tv_camera camera{};  // of every picture
  std::vector<RoomView> views;
  std::vector<Vector3> points;
  bool is_metric = false;
  double scale_sigma = 0;          // relative, where is_metric; 0: not known
  std::optional<Vector3> gravity;  // the direction down in the world, of length 1
  // Whether the views follow each other in time, so that those nearby show the same place.
  bool is_flight = true;
};

struct RoomSettings {
  double voxel = 0;  // in the unit of the poses; 0: from the scene
  int32_t max_memory_mib = 64;
  bool measured_only = false;     // nothing is carried across what has no texture
  bool keeps_depth_maps = false;  // for depth/
};

// What became of the pixels of the depth maps, as counts.
struct PixelCounts {
  int64_t measured = 0;     // a distance that at least two other pictures confirm
  int64_t no_texture = 0;   // a plain area: there is nothing to compare
  int64_t one_place = 0;    // of keyframes without a picture from a place that is far enough away
  int64_t unconfirmed = 0;  // a distance that fewer than two other pictures confirm
  int64_t ambiguous = 0;    // texture, but no distance: too far, moving, mirrored, or out of view
  int64_t total() const { return measured + no_texture + one_place + unconfirmed + ambiguous; }
  void add(const PixelCounts& other) {
    measured += other.measured;
    no_texture += other.no_texture;
    one_place += other.one_place;
    unconfirmed += other.unconfirmed;
    ambiguous += other.ambiguous;
  }
};

// Where the pixels of keyframes look: along the room's axes as its plan shows them, whichever is
// nearest.
enum Direction { kPlanRight, kPlanLeft, kPlanTop, kPlanBottom, kUpwards, kDownwards };
constexpr size_t kNumDirections = 6;

// A depth map as it is written: distance along the optical axis, 0 where it is unknown.
struct DepthPicture {
  int index = 0;  // of the source's frame
  std::string name;
  std::vector<float> depth;
};

// A surface; each vertex is of a triangle.
struct RoomMesh {
  std::vector<tv_room_vertex> vertices;
  std::vector<tv_room_triangle> triangles;
  double voxel = 0;
};

struct RoomModel {
  std::vector<tv_room_vertex> vertices;
  std::vector<tv_room_triangle> triangles;
  RoomMesh page_mesh;  // the same surface, with voxels so coarse that a page can show it
  std::vector<tv_room_plane> planes;
  double voxel = 0;            // that the surface ended with
  double first_voxel = 0;      // that it began with: smaller where the memory was full
  Vector3 up{0, -1, 0};        // of length 1, in the world
  const char* up_source = "";  // "gravity", "level surfaces" or "cameras"
  // room_from_world: the rows are directions along the walls, across them, and up.
  Matrix3 axes{1, 0, 0, 0, 1, 0, 0, 0, 1};
  double floor = 0;       // the height of the lowest surface along `up`
  Vector3 size{0, 0, 0};  // of the surface's box, along the walls, across them, and upwards
  // 255 where the room is free from above, in cells along the first two axes.
  cv::Mat free_cells;
  double free_cell = 1;                // side of a cell
  cv::Point2d free_origin;             // corner of the first cell, in room axes
  int keyframes_used = 0;              // that gave a depth map
  int keyframes_without = 0;           // that did not
  int inferred_without_memory = 0;     // keyframes whose plain walls did not fit
  int pictures_missing = 0;            // pictures of keyframes and partners that could not be read
  double ms_depth = 0, ms_fusion = 0;  // CPU time a keyframe
  double ms_mesh = 0;                  // in all
  size_t memory_bytes = 0;             // of the room
  double median_depth = 0;             // of the points that the keyframes see
  PixelCounts pixels;
  std::array<PixelCounts, kNumDirections> pixels_towards;
  tv_camera map_camera{};                // of the depth maps
  std::vector<DepthPicture> depth_maps;  // where they are kept
  std::optional<RoomTruth> truth;        // beside the true surface, where that is known
};

}  // namespace cli
