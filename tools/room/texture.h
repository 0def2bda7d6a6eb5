// Procedural textures with enough corners for features at every distance. The same seed gives the
// same texture.
#pragma once

#include <cstdint>
#include <vector>

namespace room {

// A square grey tile that repeats in both directions, with its mip levels: level k is 2^k times
// smaller.
class Texture {
 public:
  static constexpr int kSide = 1024;

  // Fractal noise below randomly placed discs, boxes and strokes of all sizes and grey levels.
  static Texture pattern(uint64_t seed);
  // Wooden boards with seams, used for a floor.
  static Texture planks(uint64_t seed);

  // The grey level at (u, v), in units of tiles; both must be above -4. A pixel covers `footprint`
  // tiles; the interpolation is trilinear.
  float sample(double u, double v, double footprint) const;

 private:
  explicit Texture(std::vector<uint8_t> base);
  std::vector<std::vector<uint8_t>> levels_;
};

}  // namespace room
