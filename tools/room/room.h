// A furnished room to fly through, which is rendered with its true poses and depths. The world and
// body frames are those of the drivers: x forward, y right, z down. The floor is z = 0, so
// everything above the floor has z < 0.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "room/texture.h"
#include "twoview/camera.h"

namespace room {

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<double, 9>;  // row-major

// The pose of a camera (x right, y down, z forward) in the world: x_world = world_from_camera *
// x_camera + position.
struct CameraPose {
  Mat3 world_from_camera;
  Vec3 position;  // metres
};

// The rotation from camera axes to body axes of a camera that looks forward: the camera's x axis is
// the body's y axis, its y axis is the body's z axis, and its z axis is the body's x axis.
extern const Mat3 kForwardCamera;

// The rotation from body to world for yaw, pitch and roll in the aerospace order z y x. A raised
// nose and a lowered right side are positive angles.
Mat3 world_from_body(double yaw_rad, double pitch_rad, double roll_rad);
CameraPose camera_pose(const Mat3& world_from_body, const Mat3& body_from_camera,
                       const Vec3& position);

// Computes R (row-major) and t (metres) of cam1_from_cam0 from the poses of two cameras.
void relative_pose(const CameraPose& cam0, const CameraPose& cam1, Mat3& R, Vec3& t);

// The viewing ray of each pixel of a camera, computed once for all renderings.
class Eye {
 public:
  // Throws std::invalid_argument for a camera that the library refuses.
  explicit Eye(const tv_camera& camera);
  int width() const { return width_; }
  int height() const { return height_; }
  // The unit ray of a pixel; three zeros where the lens model gives no ray.
  const float* ray(int x, int y) const { return &rays_[3 * static_cast<size_t>(y * width_ + x)]; }
  // The angle between the rays of neighbouring pixels in the middle of the image, in radians.
  double pixel_angle() const { return pixel_angle_; }

 private:
  int width_, height_;
  double pixel_angle_;
  std::vector<float> rays_;
};

class Room {
 public:
  // Builds a room of 9 x 7 x 3 metres with cupboards, tables, pillars and pictures. The seed
  // changes only the textures.
  explicit Room(uint64_t seed = 1);

  // Renders grey levels, row by row. `depth` may be null; otherwise it receives z in the camera
  // frame in metres, and 0 where a pixel has no ray.
  void render(const Eye& eye, const CameraPose& pose, uint8_t* luma, int64_t stride_bytes,
              float* depth = nullptr) const;

  // The height of a point above the floor or furniture below it, in metres. An ultrasound altimeter
  // measures this height.
  double height_above_ground(const Vec3& position) const;

  // The low and the high corner of the walls, which are seen from inside, and then of every piece
  // of furniture: boxes with sides parallel to the axes.
  std::vector<std::array<Vec3, 2>> surfaces() const;

  // Returns true if a ball of this radius at this position touches nothing.
  bool is_free(const Vec3& position, double radius) const;

 private:
  // A box whose sides are parallel to the axes. The walls of the room are seen from inside, all
  // other boxes from outside.
  struct Box {
    Vec3 low, high;
    int texture;
  };
  // The point where a ray meets a side of a box: its distance, the axis that the side is
  // perpendicular to, and whether it is the low (0) or the high (1) side.
  struct Hit {
    double distance;
    const Box* box;
    size_t axis;
    int side;
  };
  Hit first_hit(const Vec3& from, const Vec3& ray) const;
  float grey_at(const Vec3& from, const Vec3& ray, const Hit& hit, double pixel_angle) const;

  std::vector<Texture> textures_;
  std::vector<Box> boxes_;
  Box walls_;
};

// Adds Gaussian noise with a standard deviation of `sigma` grey levels. The same seed gives the
// same noise.
void add_sensor_noise(uint8_t* luma, int width, int height, int64_t stride_bytes, double sigma,
                      uint64_t seed);

}  // namespace room
