// What a depth map measured: at a pixel, and at most and at least in squares of pixels.
// docs/algorithms/room.md.
#pragma once

#include "geometry/camera.h"
#include "room/blocks.h"

namespace tv {

// A depth map with its lens and its pose, world_from_cam.
struct RoomView {
  Camera camera;
  Mat3 rotation;
  Vec3 centre;
  tv_depth_map map;
};

// What a view measured at a pixel. The weight is 0 where it is unknown.
struct Measured {
  double distance, sigma;
  int32_t weight;
};

// Without sigmas, a hundredth of the distance.
inline constexpr double kRelativeSigma = 0.01;

// The map of a view, and which of its values count.
struct Readings {
  tv_depth_map map;
  double voxel, max_distance;
  float most_sigma;  // beyond it the weight is 0; without sigmas, of the distance
  // A bit for each pixel at which something was measured; null where there is no memory for it.
  const uint64_t* known;
  int32_t row_words;
};

Readings readings_of(const tv_room& room, const RoomView& view);

// Whether the image shows the scene at a pixel.
inline bool shows_scene(const tv_depth_map& map, int32_t x, int32_t y) {
  return map.mask == nullptr || map.mask[y * map.mask_stride_bytes + x] != 0;
}

// Whether something was measured at a pixel.
inline bool is_measured(const Readings& readings, int32_t x, int32_t y) {
  const tv_depth_map& map = readings.map;
  const ptrdiff_t at = static_cast<ptrdiff_t>(y) * map.stride + x;
  const float distance = map.distance[at];
  const float sigma = map.sigma != nullptr ? map.sigma[at] : distance;
  return distance > 0 && static_cast<double>(distance) <= readings.max_distance && sigma > 0 &&
         sigma <= readings.most_sigma && (map.witnesses == nullptr || map.witnesses[at] != 0) &&
         shows_scene(map, x, y);
}

inline bool is_known(const Readings& readings, int32_t x, int32_t y) {
  if (readings.known == nullptr) return is_measured(readings, x, y);
  return (readings.known[static_cast<ptrdiff_t>(y) * readings.row_words + (x >> 6)] >> (x & 63) &
          1) != 0;
}

inline double distance_at(const Readings& readings, int32_t x, int32_t y) {
  return static_cast<double>(
      readings.map.distance[static_cast<ptrdiff_t>(y) * readings.map.stride + x]);
}

// Of a pixel at which something was measured.
inline double sigma_at(const Readings& readings, int32_t x, int32_t y) {
  const tv_depth_map& map = readings.map;
  if (map.sigma == nullptr) return kRelativeSigma * distance_at(readings, x, y);
  return static_cast<double>(map.sigma[static_cast<ptrdiff_t>(y) * map.stride + x]);
}

// The weight of a pixel whose sigma is a voxel. With the largest weight of 64 the smallest sigma
// that counts is half a voxel: the voxels' own resolution.
inline constexpr double kUnitWeight = 16;

inline int32_t weight_of(double voxel, double sigma) {
  const double ratio = voxel / sigma;
  const double weight = kUnitWeight * (ratio * ratio) + 0.5;
  return weight < kMaxWeight ? static_cast<int32_t>(weight) : kMaxWeight;
}

Measured measured_at(const Readings& readings, int32_t x, int32_t y);

// What was measured in a square of pixels. least > most: nothing was.
struct Tile {
  float least, most;  // distances
};

// The depth map divided into squares. Their side is the smallest power of two, at least 8 pixels,
// with which all tiles fit into the given memory.
struct Tiles {
  Tile* tile;
  int32_t columns, rows, shift;  // log2 of the side
};

// A rectangle of tiles, ends included.
struct TileRange {
  int32_t left, top, right, bottom;
};

// Makes the tiles, and the bits of the readings if the memory has room for both.
Tiles make_tiles(Readings* readings, void* memory, size_t size_bytes);

// One tile with the least and the most of all tiles.
Tile joined(const Tiles& tiles);

}  // namespace tv
