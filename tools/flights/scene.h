// A scene of boxes, each turned about the vertical axis: ray casting, light and rendering. World:
// z down, metres (as room/room.h). Each side of a box has a texture of its own that never repeats.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "flights/canvas.h"
#include "room/room.h"

namespace flights {

using room::CameraPose;
using room::Eye;
using room::Mat3;
using room::Vec3;

// A lit grey surface with its mip levels: level k is 2^k times smaller.
class Surface {
 public:
  Surface() = default;
  // `light` is a grid of factors, from corner to corner of the canvas.
  Surface(Canvas& canvas, const std::vector<float>& light, int light_columns, int light_rows);
  // The grey level at a point in metres from the corner; a pixel covers `footprint` metres.
  float sample(float u, float v, float footprint) const;

 private:
  struct Level {
    int columns, rows;
    std::vector<uint8_t> texels;
  };
  std::vector<Level> levels_;
};

// The material of each side of a box; side 2 k + s is perpendicular to its axis k, on the low (s =
// 0) or high (s = 1) end. The room itself is a box that is seen from inside.
struct Box {
  Vec3 centre, half;  // metres
  double yaw_rad = 0;
  bool is_room = false;
  std::array<Material, 6> materials{};
};

struct Lamp {
  Vec3 position;
  double half_width;  // of its square area, metres
  double power;       // relative to the other lamps
};

class Scene {
 public:
  // boxes[0] is the room. The seed selects the textures.
  Scene(std::vector<Box> boxes, const std::vector<Lamp>& lamps, uint64_t seed);

  const std::vector<Box>& boxes() const { return boxes_; }

  // Renders grey levels that are proportional to the light, row by row, as a pinhole camera without
  // motion blur sees them. A pixel in which two sides of boxes meet is sampled four times. `depth`
  // may be null; otherwise it receives z in the camera frame, metres.
  void render(const Eye& eye, const CameraPose& pose, float* grey, float* depth = nullptr) const;

  // The height above the floor or furniture below, as an ultrasound altimeter measures it, metres.
  double height_above_ground(const Vec3& position) const;

 private:
  struct Ready;  // a box with what one view needs
  bool is_lit(const Vec3& point, const Vec3& lamp) const;
  std::vector<float> light_of(size_t box, int side, const std::vector<Lamp>& lamps, int columns,
                              int rows) const;
  struct Rays;  // up to a square of pixels, and what each ray meets
  static void cast(const std::vector<Ready>& near, Rays& rays);
  float grey_at(const std::vector<Ready>& all, const Rays& rays, size_t ray, float angle) const;

  std::vector<Box> boxes_;
  std::vector<Surface> surfaces_;  // 6 a box
};

// The distance from a point to the sides of a box: 0 on them, positive inside and outside, metres.
double distance_to_sides(const Box& box, const Vec3& point);
// The distance from a point to a solid box, 0 inside it, metres.
double distance_to_solid(const Box& box, const Vec3& point);

}  // namespace flights
