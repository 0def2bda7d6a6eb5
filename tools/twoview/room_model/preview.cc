#include "room_model/preview.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/error.h"

namespace cli {
namespace {

// A fifth of the pixels of a room's depth maps and two thirds of their planes: about a seventh of
// their time. The voxels are twice as large, which keeps the surface of a room of 8 x 6 x 3 m below
// 100,000 triangles.
constexpr int32_t kMapPixels = 40000, kMapPlanes = 64;
constexpr double kVoxelShare = 0.024;           // of the median depth
constexpr size_t kRoomBytes = size_t{8} << 20;  // 7,600 blocks
constexpr int kMostMoves = 8;                   // of maps in one settle()
constexpr int32_t kFewestMaps = 2;              // that must have seen a surface
constexpr double kMostSigmaVoxels = 1.5;
// If the map's unit has changed by more than this factor, the room is made again with voxels of
// another size.
constexpr double kMostScale = 1.25;

tv_depth_options sweep_options() {
  tv_depth_options options;
  tv_depth_options_init(&options);
  options.max_pixels = kMapPixels;
  options.max_planes = kMapPlanes;
  return options;
}

template <class T>
void append(std::string& bytes, const T* values, size_t count) {
  bytes.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

}  // namespace

struct RoomPreview::Map {
  tv_camera camera{};  // of the map
  KnownPixels pixels;
  double depth = 0;             // median, in the unit of that time
  PreviewPlace wanted, placed;  // placed.is_present: it is in the room
  bool is_lost = false;         // it does not fit
};

RoomPreview::RoomPreview() = default;
RoomPreview::~RoomPreview() = default;

// Makes the room anew and empty; settle() brings the maps back.
void RoomPreview::begin(double voxel) {
  memory_.resize(kRoomBytes + TV_CONTEXT_ALIGNMENT);
  tv_room_options options;
  tv_room_options_init(&options);
  options.voxel = voxel_ = voxel;
  check(tv_room_init(&room_, &options, aligned(memory_), kRoomBytes), "the room of the page");
  for (const auto& map : maps_) map->placed.is_present = false;
}

void RoomPreview::add(const PreviewKey& key, const std::vector<PreviewPlace>& places) {
  if (!sweep_ || std::memcmp(&camera_, &key.camera, sizeof camera_) != 0) {
    sweep_ = std::make_unique<DepthSweep>(key.camera, sweep_options());
    camera_ = key.camera;
  }
  std::vector<const RoomView*> views;
  std::vector<const RoomPicture*> pictures;
  for (const RoomView& view : key.views) views.push_back(&view);
  for (const RoomPicture& picture : key.pictures) pictures.push_back(&picture);
  TileCounts counts;
  auto map =
      std::make_unique<Map>(Map{sweep_->map_camera(),
                                sweep_->run(views, pictures, key.range.near, key.range.far, counts),
                                key.range.median,
                                {},
                                {},
                                false});
  maps_.push_back(std::move(map));
  for (size_t k = 0; k < maps_.size() && k < places.size(); ++k) maps_[k]->wanted = places[k];
  const Map& newest = *maps_.back();
  const double voxel = kVoxelShare * newest.depth;
  // The unit of the map may have become the metre, which none of the voxels fits.
  double scale = 1;
  for (const auto& old : maps_)
    if (old->placed.is_present && old->wanted.is_present)
      scale = old->wanted.scale / old->placed.scale;
  if (room_ == nullptr)
    begin(voxel);
  else if (scale > kMostScale || scale * kMostScale < 1)
    begin(scale * voxel_);
  if (newest.wanted.is_present) fuse(*maps_.back());
}

// Adds the map to the room, or removes it.
tv_status RoomPreview::with_room(const Map& map, const PreviewPlace& place, bool adds) {
  map.pixels.unpack(pixels_);
  const auto scale = static_cast<float>(place.scale);
  for (float& value : pixels_.distance) value *= scale;
  for (float& value : pixels_.sigma) value *= scale;
  tv_depth_map given;
  tv_depth_map_init(&given);
  given.width = given.stride = map.camera.width;
  given.height = map.camera.height;
  given.camera = &map.camera;
  std::copy(place.R.begin(), place.R.end(), given.world_from_cam_R);
  std::copy(place.t.begin(), place.t.end(), given.world_from_cam_t);
  given.distance = pixels_.distance.data();
  given.sigma = pixels_.sigma.data();
  given.pixels = pixels_.rgb.data();
  given.pixel_stride_bytes = 3 * static_cast<int64_t>(map.camera.width);
  given.channels = 3;
  given.mask = pixels_.shown.data();
  given.mask_stride_bytes = map.camera.width;
  return (adds ? tv_room_add : tv_room_remove)(room_, &given);
}

// Returns false where the memory was too small for the map, so that the room has begun anew with
// voxels of twice the side.
bool RoomPreview::fuse(Map& map) {
  const tv_status status = with_room(map, map.wanted, true);
  if (status == TV_ERR_CAPACITY) {
    // A map that fills the memory by itself is not needed for a first look.
    map.is_lost = std::none_of(maps_.begin(), maps_.end(),
                               [](const auto& other) { return other->placed.is_present; });
    begin(2 * voxel_);
    return false;
  }
  if (status == TV_ERR_LIMITS) {
    map.is_lost = true;
    return true;
  }
  check(status, "the room of the page");
  map.placed = map.wanted;
  return true;
}

void RoomPreview::remove(Map& map) {
  check(with_room(map, map.placed, false), "the room of the page");
  map.placed.is_present = false;
}

bool RoomPreview::has_moved(const Map& map) const {
  if (map.is_lost) return false;
  if (map.wanted.is_present != map.placed.is_present) return true;
  if (!map.wanted.is_present) return false;
  // Of what the map shows at its median depth, to the left above and to the right below.
  for (const double side : {-0.5, 0.5}) {
    const Vector3 ray{side * map.depth, 0.75 * side * map.depth, map.depth};
    const Vector3 before = applied(map.placed.R, ray), after = applied(map.wanted.R, ray);
    Vector3 moved;
    for (size_t k = 0; k < 3; ++k)
      moved[k] = map.wanted.scale * after[k] + map.wanted.t[k] - map.placed.scale * before[k] -
                 map.placed.t[k];
    if (norm(moved) > 0.5 * voxel_) return true;
  }
  return false;
}

bool RoomPreview::settle() {
  int moves = 0;
  // The newest first, since the page looks at them.
  for (size_t k = maps_.size(); k > 0; --k) {
    Map& map = *maps_[k - 1];
    if (!has_moved(map)) continue;
    if (moves++ == kMostMoves) return true;
    if (map.placed.is_present) remove(map);
    if (map.wanted.is_present && !fuse(map)) return true;
  }
  return false;
}

std::string RoomPreview::surface() {
  if (room_ == nullptr) return "";
  tv_room_mesh_options options;
  tv_room_mesh_options_init(&options);
  const auto placed = std::count_if(maps_.begin(), maps_.end(),
                                    [](const auto& map) { return map->placed.is_present; });
  options.min_maps = std::clamp(static_cast<int32_t>(placed), 1, kFewestMaps);
  options.max_sigma = kMostSigmaVoxels * voxel_;
  int32_t num_vertices = 0, num_triangles = 0;
  tv_status status =
      tv_room_mesh(room_, &options, nullptr, 0, &num_vertices, nullptr, 0, &num_triangles);
  std::vector<tv_room_vertex> vertices(static_cast<size_t>(num_vertices));
  std::vector<tv_room_triangle> triangles(static_cast<size_t>(num_triangles));
  if (status == TV_ERR_CAPACITY)
    status = tv_room_mesh(room_, &options, vertices.data(), num_vertices, &num_vertices,
                          triangles.data(), num_triangles, &num_triangles);
  check(status, "the surface of the page");
  return surface_bytes(vertices, triangles);
}

std::string surface_bytes(const std::vector<tv_room_vertex>& vertices,
                          const std::vector<tv_room_triangle>& triangles) {
  std::string bytes;
  if (triangles.empty()) return bytes;
  const uint32_t counts[2] = {static_cast<uint32_t>(vertices.size()),
                              static_cast<uint32_t>(triangles.size())};
  bytes.reserve(sizeof counts + 15 * vertices.size() + 12 * triangles.size());
  append(bytes, counts, 2);
  for (const tv_room_vertex& vertex : vertices) append(bytes, vertex.position, 3);
  for (const tv_room_triangle& triangle : triangles) append(bytes, triangle.idx_vertex, 3);
  for (const tv_room_vertex& vertex : vertices) append(bytes, vertex.rgb, 3);
  return bytes;
}

}  // namespace cli
