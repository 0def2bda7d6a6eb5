#include "room/readings.h"

#include <cstring>

namespace tv {
namespace {

constexpr Tile kEmpty = {3e38f, -3e38f};

float float_of_bits(uint32_t bits) {
  float value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

// The largest number whose weight as a sigma, `unit` times as large, is not 0. Weights fall with
// sigma, and positive floats are ordered as their bits.
float most_sigma(double voxel, double unit) {
  uint32_t bits = 0;
  for (uint32_t bit = 1u << 30; bit != 0; bit >>= 1) {
    if ((bits | bit) >= 0x7f800000u) continue;  // not finite
    const double sigma = unit * static_cast<double>(float_of_bits(bits | bit));
    if (weight_of(voxel, sigma) > 0) bits |= bit;
  }
  return float_of_bits(bits);
}

}  // namespace

Readings readings_of(const tv_room& room, const RoomView& view) {
  const tv_room_options& o = room.options;
  return {view.map,
          o.voxel,
          o.max_distance > 0 ? o.max_distance : 1e30,
          most_sigma(o.voxel, view.map.sigma != nullptr ? 1 : kRelativeSigma),
          nullptr,
          0};
}

Measured measured_at(const Readings& readings, int32_t x, int32_t y) {
  if (!is_known(readings, x, y)) return {0, 0, 0};
  const double sigma = sigma_at(readings, x, y);
  return {distance_at(readings, x, y), sigma, weight_of(readings.voxel, sigma)};
}

Tiles make_tiles(Readings* readings, void* memory, size_t size_bytes) {
  const tv_depth_map& map = readings->map;
  const int32_t words = ((map.width - 1) >> 6) + 1;
  const size_t num_words = static_cast<size_t>(words) * static_cast<size_t>(map.height);
  // The bits are made only where they leave a third of the memory for the tiles, so that these stay
  // small.
  uint64_t* known = nullptr;
  if (3 * num_words * sizeof *known <= 2 * size_bytes) {
    known = static_cast<uint64_t*>(memory);
    memory = known + num_words;
    size_bytes -= num_words * sizeof *known;
  }
  Tiles tiles = {static_cast<Tile*>(memory), 0, 0, 2};
  do {
    ++tiles.shift;
    tiles.columns = ((map.width - 1) >> tiles.shift) + 1;
    tiles.rows = ((map.height - 1) >> tiles.shift) + 1;
  } while (static_cast<size_t>(tiles.columns) * static_cast<size_t>(tiles.rows) * sizeof(Tile) >
           size_bytes);
  for (int32_t k = 0; k < tiles.columns * tiles.rows; ++k) tiles.tile[k] = kEmpty;
  for (int32_t y = 0; y < map.height; ++y) {
    Tile* const row = tiles.tile + (y >> tiles.shift) * tiles.columns;
    uint64_t word = 0;
    for (int32_t x = 0; x < map.width; ++x) {
      if (is_measured(*readings, x, y)) {
        word |= uint64_t{1} << (x & 63);
        const float distance = map.distance[static_cast<ptrdiff_t>(y) * map.stride + x];
        Tile& tile = row[x >> tiles.shift];
        if (distance < tile.least) tile.least = distance;
        if (distance > tile.most) tile.most = distance;
      }
      if (known != nullptr && ((x & 63) == 63 || x + 1 == map.width)) {
        known[static_cast<ptrdiff_t>(y) * words + (x >> 6)] = word;
        word = 0;
      }
    }
  }
  readings->known = known;
  readings->row_words = words;
  return tiles;
}

Tile joined(const Tiles& tiles) {
  Tile all = kEmpty;
  for (int32_t k = 0; k < tiles.columns * tiles.rows; ++k) {
    const Tile& tile = tiles.tile[k];
    if (tile.least < all.least) all.least = tile.least;
    if (tile.most > all.most) all.most = tile.most;
  }
  return all;
}

}  // namespace tv
