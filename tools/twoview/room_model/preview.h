// A coarse room that grows while a flight lasts: a small depth map of each keyframe, fused as soon
// as it is made, and moved as the map moves its keyframe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "room_model/depth.h"
#include "room_model/partners.h"
#include "room_model/scene.h"

namespace cli {

// A keyframe with its partners, all of one camera: the keyframe comes first.
struct PreviewKey {
  tv_camera camera{};
  std::vector<RoomView> views;
  std::vector<RoomPicture> pictures;
  DepthRange range;
};

// Where a keyframe is now, world_from_cam, and how many units of the map its old unit has become.
struct PreviewPlace {
  bool is_present = false;  // whether it is in the segment that is shown
  Matrix3 R{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 t{0, 0, 0};
  double scale = 1;
};

// A surface as a page on this computer reads it, in the computer's own byte order: how many
// vertices and triangles there are (uint32), the vertices' positions (three float32 each), the
// triangles' corners (three uint32 each), the vertices' colours (three bytes each). Empty without
// triangles.
std::string surface_bytes(const std::vector<tv_room_vertex>& vertices,
                          const std::vector<tv_room_triangle>& triangles);

// It may be used by one thread at a time only.
class RoomPreview {
 public:
  RoomPreview();
  ~RoomPreview();
  RoomPreview(const RoomPreview&) = delete;
  RoomPreview& operator=(const RoomPreview&) = delete;

  // Fuses the depth map of one more keyframe. `places`: of all keyframes so far and of this one, in
  // the order in which they came. Throws BadInput where no depth map can be made.
  void add(const PreviewKey& key, const std::vector<PreviewPlace>& places);
  // Fuses some of the maps anew whose keyframes have moved by more than half a voxel: as many as
  // take about the time of one `add`. Returns whether more are left.
  bool settle();
  size_t num_keyframes() const { return maps_.size(); }
  // The surface in the format of surface_bytes().
  std::string surface();

 private:
  struct Map;
  void begin(double voxel);
  bool fuse(Map& map);
  void remove(Map& map);
  bool has_moved(const Map& map) const;
  tv_status with_room(const Map& map, const PreviewPlace& place, bool adds);

  std::vector<uint8_t> memory_;
  tv_room* room_ = nullptr;  // in memory_
  double voxel_ = 0;
  std::unique_ptr<DepthSweep> sweep_;
  tv_camera camera_{};  // that sweep_ was made for
  std::vector<std::unique_ptr<Map>> maps_;
  MapPixels pixels_;  // of the map that is in work
};

}  // namespace cli
