// A furnished room to fly through, rendered with its true poses and depths.
// World and body frames are those of the drivers: x forward, y right, z down; z = 0 is the floor,
// so what lies above it has z < 0.
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

// A camera frame (x right, y down, z forward) in the world: world = rotation camera + position.
struct CameraPose {
  Mat3 world_from_camera;
  Vec3 position;  // metres
};

// A camera fixed in the body: camera axes in the body frame. Looking forward: x of the camera is y
// of the body, y is z, z is x.
extern const Mat3 kForwardCamera;

// Attitude by yaw, pitch, roll (aerospace order z y x; nose up, right side down are positive), then
// the camera in the body.
Mat3 world_from_body(double yaw_rad, double pitch_rad, double roll_rad);
CameraPose camera_pose(const Mat3& world_from_body, const Mat3& body_from_camera,
                       const Vec3& position);

// cam1_from_cam0 of two poses: R row-major, t in metres.
void relative_pose(const CameraPose& cam0, const CameraPose& cam1, Mat3& R, Vec3& t);

// The viewing rays of a camera's pixels, found once.
class Eye {
 public:
  // Throws std::invalid_argument for a camera that the library refuses.
  explicit Eye(const tv_camera& camera);
  int width() const { return width_; }
  int height() const { return height_; }
  // Unit ray, or zeros where the lens sees nothing.
  const float* ray(int x, int y) const { return &rays_[3 * static_cast<size_t>(y * width_ + x)]; }
  // The angle between neighbouring pixels' rays, radians, in the middle of the image.
  double pixel_angle() const { return pixel_angle_; }

 private:
  int width_, height_;
  double pixel_angle_;
  std::vector<float> rays_;
};

class Room {
 public:
  // 9 x 7 x 3 metres with cupboards, tables, pillars and pictures; the seed moves textures only.
  explicit Room(uint64_t seed = 1);

  // Grey levels, row by row; depth: null, or z in the camera frame, metres, 0 where no ray goes.
  void render(const Eye& eye, const CameraPose& pose, uint8_t* luma, int64_t stride_bytes,
              float* depth = nullptr) const;

  // Height of what lies under a point: what an ultrasound altimeter measures, metres.
  double height_above_ground(const Vec3& position) const;

  // True where a ball of this radius fits.
  bool is_free(const Vec3& position, double radius) const;

 private:
  // Sides parallel to the axes. The walls are seen from inside, all else from outside.
  struct Box {
    Vec3 low, high;
    int texture;
  };
  // Where a ray meets a side of a box: at a distance, a side across `axis`, low (0) or high (1).
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

// Sensor noise of `sigma` grey levels, the same for a seed.
void add_sensor_noise(uint8_t* luma, int width, int height, int64_t stride_bytes, double sigma,
                      uint64_t seed);

}  // namespace room
