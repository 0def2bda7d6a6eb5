#include "room/room.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "room/random.h"

namespace room {
namespace {

Vec3 minus(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vec3 times(const Mat3& m, const Vec3& x) {
  return {m[0] * x[0] + m[1] * x[1] + m[2] * x[2], m[3] * x[0] + m[4] * x[1] + m[5] * x[2],
          m[6] * x[0] + m[7] * x[1] + m[8] * x[2]};
}
Mat3 transposed(const Mat3& m) { return {m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]}; }
Mat3 times(const Mat3& a, const Mat3& b) {
  Mat3 product{};
  for (size_t i = 0; i < 3; ++i) {
    for (size_t j = 0; j < 3; ++j) {
      for (size_t k = 0; k < 3; ++k) product[3 * i + j] += a[3 * i + k] * b[3 * k + j];
    }
  }
  return product;
}

// The index of each texture in the room's list of textures.
enum { kWall, kFloor, kCeiling, kFurniture, kPillar, kPicture, kNumTextures };

}  // namespace

const Mat3 kForwardCamera = {0, 0, 1, 1, 0, 0, 0, 1, 0};

Mat3 world_from_body(double yaw_rad, double pitch_rad, double roll_rad) {
  const double cy = std::cos(yaw_rad), sy = std::sin(yaw_rad);
  const double cp = std::cos(pitch_rad), sp = std::sin(pitch_rad);
  const double cr = std::cos(roll_rad), sr = std::sin(roll_rad);
  const Mat3 yaw = {cy, -sy, 0, sy, cy, 0, 0, 0, 1};
  const Mat3 pitch = {cp, 0, sp, 0, 1, 0, -sp, 0, cp};
  const Mat3 roll = {1, 0, 0, 0, cr, -sr, 0, sr, cr};
  return times(yaw, times(pitch, roll));
}

CameraPose camera_pose(const Mat3& world_from_body, const Mat3& body_from_camera,
                       const Vec3& position) {
  return {times(world_from_body, body_from_camera), position};
}

void relative_pose(const CameraPose& cam0, const CameraPose& cam1, Mat3& R, Vec3& t) {
  const Mat3 cam1_from_world = transposed(cam1.world_from_camera);
  R = times(cam1_from_world, cam0.world_from_camera);
  t = times(cam1_from_world, minus(cam0.position, cam1.position));
}

Eye::Eye(const tv_camera& camera)
    : width_(camera.width),
      height_(camera.height),
      pixel_angle_(1 / std::max(camera.fx, camera.fy)) {
  if (tv_camera_check(&camera) != TV_OK) throw std::invalid_argument("not a valid camera");
  std::vector<double> pixels(2 * static_cast<size_t>(width_)),
      rays(3 * static_cast<size_t>(width_));
  std::vector<uint8_t> inside(static_cast<size_t>(width_));
  for (int y = 0; y < height_; ++y) {
    for (int x = 0; x < width_; ++x) {
      pixels[2 * static_cast<size_t>(x)] = x;
      pixels[2 * static_cast<size_t>(x) + 1] = y;
    }
    tv_camera_unproject_points(&camera, pixels.data(), width_, rays.data(), inside.data());
    rays_.insert(rays_.end(), rays.begin(), rays.end());
  }
}

Room::Room(uint64_t seed)
    : boxes_{
          {{5.6, -3.4, -2.0}, {6.4, -1.6, 0}, kFurniture},   // cupboard, far left
          {{5.9, 1.2, -0.9}, {6.9, 3.2, 0}, kFurniture},     // sideboard, far right
          {{3.2, 2.2, -0.75}, {4.6, 3.3, 0}, kFurniture},    // table on the right
          {{3.6, 2.5, -1.15}, {4.0, 2.9, -0.75}, kPillar},   // box on the table
          {{2.6, -3.4, -1.2}, {3.6, -2.5, 0}, kFurniture},   // shelf on the left
          {{4.3, -1.9, -3.0}, {4.6, -1.6, 0}, kPillar},      // pillar, left of the middle
          {{5.0, 0.9, -3.0}, {5.25, 1.15, 0}, kPillar},
          {{6.1, -0.6, -0.5}, {6.7, 0.2, 0}, kPillar},       // crate straight ahead
          {{6.9, -0.9, -2.3}, {6.98, 0.6, -1.2}, kPicture},  // picture on the far wall
          {{6.9, 1.4, -2.4}, {6.98, 2.4, -1.4}, kPicture},
      },
      walls_{{-2, -3.5, -3}, {7, 3.5, 0}, kWall} {
  for (int k = 0; k < kNumTextures; ++k) {
    const uint64_t own = seed * 1000 + static_cast<uint64_t>(k);
    textures_.push_back(k == kFloor ? Texture::planks(own) : Texture::pattern(own));
  }
}

// Slabs: a ray is inside a box between the last of its entries and the first of its exits (T. L.
// Kay, J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986). `from` lies within the walls.
Room::Hit Room::first_hit(const Vec3& from, const Vec3& ray) const {
  const Vec3 inverse = {1 / ray[0], 1 / ray[1], 1 / ray[2]};
  Hit hit{HUGE_VAL, &walls_, 0, 0};
  for (size_t k = 0; k < 3; ++k) {
    if (ray[k] == 0) continue;  // parallel to both walls across axis k
    const int side = ray[k] > 0 ? 1 : 0;
    const double exit = ((side == 1 ? walls_.high[k] : walls_.low[k]) - from[k]) * inverse[k];
    if (exit < hit.distance) hit = {exit, &walls_, k, side};
  }
  for (const Box& box : boxes_) {
    double entry = 0, exit = hit.distance;
    size_t axis = 3;
    for (size_t k = 0; k < 3; ++k) {
      const double to_low = (box.low[k] - from[k]) * inverse[k];
      const double to_high = (box.high[k] - from[k]) * inverse[k];
      if (std::min(to_low, to_high) > entry) {
        entry = std::min(to_low, to_high);
        axis = k;
      }
      exit = std::min(exit, std::max(to_low, to_high));
    }
    if (axis < 3 && entry < exit) hit = {entry, &box, axis, ray[axis] > 0 ? 0 : 1};
  }
  return hit;
}

float Room::grey_at(const Vec3& from, const Vec3& ray, const Hit& hit, double pixel_angle) const {
  constexpr double kTilesPerMetre = 0.45;
  const Box& box = *hit.box;
  const size_t u_axis = (hit.axis + 1) % 3, v_axis = (hit.axis + 2) % 3;
  // The shift gives each side of a box its own piece of the texture, so that no two sides look the
  // same.
  const double shift =
      0.37 * static_cast<double>(6 * (&box == &walls_ ? 0 : &box - &boxes_[0] + 1) +
                                 2 * static_cast<int>(hit.axis) + hit.side);
  const double u = (from[u_axis] + hit.distance * ray[u_axis] - box.low[u_axis]) * kTilesPerMetre;
  const double v = (from[v_axis] + hit.distance * ray[v_axis] - box.low[v_axis]) * kTilesPerMetre;
  int texture = box.texture;
  if (&box == &walls_ && hit.axis == 2) texture = hit.side == 1 ? kFloor : kCeiling;
  // The side, in tiles, of a square with the area that a pixel covers on the surface. A slanted
  // surface stretches this area in one direction.
  const double slant = std::max(std::abs(ray[hit.axis]), 0.05);
  const double footprint = hit.distance * pixel_angle / std::sqrt(slant) * kTilesPerMetre;
  const double light =
      1.0 - 0.13 * static_cast<double>((hit.axis + static_cast<size_t>(hit.side)) % 3);
  return static_cast<float>(light) *
         textures_[static_cast<size_t>(texture)].sample(u + shift, v + 1.7 * shift, footprint);
}

void Room::render(const Eye& eye, const CameraPose& pose, uint8_t* luma, int64_t stride_bytes,
                  float* depth) const {
  for (int y = 0; y < eye.height(); ++y) {
    for (int x = 0; x < eye.width(); ++x) {
      const float* r = eye.ray(x, y);
      float grey = 0, z = 0;
      if (r[2] != 0 || r[1] != 0 || r[0] != 0) {
        const Vec3 ray = times(pose.world_from_camera, Vec3{r[0], r[1], r[2]});
        const Hit hit = first_hit(pose.position, ray);
        grey = grey_at(pose.position, ray, hit, eye.pixel_angle());
        z = static_cast<float>(hit.distance) * r[2];
      }
      luma[y * stride_bytes + x] = static_cast<uint8_t>(grey + 0.5f);
      if (depth != nullptr) depth[y * eye.width() + x] = z;
    }
  }
}

double Room::height_above_ground(const Vec3& position) const {
  double ground = walls_.high[2];
  for (const Box& box : boxes_) {
    const bool over = position[0] >= box.low[0] && position[0] <= box.high[0] &&
                      position[1] >= box.low[1] && position[1] <= box.high[1];
    if (over && box.low[2] >= position[2]) ground = std::min(ground, box.low[2]);
  }
  return ground - position[2];
}

std::vector<std::array<Vec3, 2>> Room::surfaces() const {
  std::vector<std::array<Vec3, 2>> all = {{walls_.low, walls_.high}};
  for (const Box& box : boxes_) all.push_back({box.low, box.high});
  return all;
}

bool Room::is_free(const Vec3& position, double radius) const {
  for (size_t k = 0; k < 3; ++k) {
    if (position[k] - radius < walls_.low[k] || position[k] + radius > walls_.high[k]) return false;
  }
  return std::none_of(boxes_.begin(), boxes_.end(), [&](const Box& box) {
    double away_sq = 0;
    for (size_t k = 0; k < 3; ++k) {
      const double out = std::max({box.low[k] - position[k], position[k] - box.high[k], 0.0});
      away_sq += out * out;
    }
    return away_sq < radius * radius;
  });
}

void add_sensor_noise(uint8_t* luma, int width, int height, int64_t stride_bytes, double sigma,
                      uint64_t seed) {
  // The noise is drawn from a table of 4096 normal numbers, which is much faster than drawing each
  // one anew.
  Random random(seed);
  std::array<int8_t, 4096> noise;
  for (int8_t& value : noise) {
    value = static_cast<int8_t>(std::clamp(std::lround(sigma * random.normal()), -127l, 127l));
  }
  for (int y = 0; y < height; ++y) {
    uint64_t word = 0;
    for (int x = 0; x < width; ++x) {
      word = x % 5 == 0 ? random.next() : word >> 12;
      uint8_t& pixel = luma[y * stride_bytes + x];
      pixel = static_cast<uint8_t>(std::clamp(pixel + noise[word & 4095], 0, 255));
    }
  }
}

}  // namespace room
