// Textures made by the program: enough corners for features at every distance, the same for a seed.
#pragma once

#include <cstdint>
#include <vector>

namespace room {

// A square grey tile that repeats, with its mip levels: level k is 2^k times smaller.
class Texture {
 public:
  static constexpr int kSide = 1024;

  // Fractal noise under a scatter of discs, boxes and strokes of all sizes and greys.
  static Texture pattern(uint64_t seed);
  // Boards with seams, for a floor.
  static Texture planks(uint64_t seed);

  // Grey level at (u, v) tiles, both above -4, seen so that one pixel covers `footprint` tiles:
  // trilinear.
  float sample(double u, double v, double footprint) const;

 private:
  explicit Texture(std::vector<uint8_t> base);
  std::vector<std::vector<uint8_t>> levels_;
};

}  // namespace room
