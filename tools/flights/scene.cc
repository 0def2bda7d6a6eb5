#include "flights/scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace flights {
namespace {

constexpr double kLightGrid = 0.08;  // metres between the points at which light is computed
constexpr double kAmbient = 0.9;  // light that comes from everywhere, in units of the lamps' mean
constexpr int kTile = 16;         // pixels a side of the squares that share a list of boxes

// The axes of a side's texture: v is the height wherever the side is upright.
constexpr size_t kAxisU[3] = {1, 0, 0}, kAxisV[3] = {2, 2, 1};

Vec3 to_local(const Box& box, const Vec3& point) {
  const double c = std::cos(box.yaw_rad), s = std::sin(box.yaw_rad);
  const Vec3 d{point[0] - box.centre[0], point[1] - box.centre[1], point[2] - box.centre[2]};
  return {c * d[0] + s * d[1], c * d[1] - s * d[0], d[2]};
}

Vec3 turned(const Box& box, const Vec3& local) {
  const double c = std::cos(box.yaw_rad), s = std::sin(box.yaw_rad);
  return {c * local[0] - s * local[1], s * local[0] + c * local[1], local[2]};
}

Vec3 plus(const Vec3& a, const Vec3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

float bilinear(const uint8_t* texels, int columns, int rows, float x, float y) {
  x = std::clamp(x, 0.0f, static_cast<float>(columns - 1));
  y = std::clamp(y, 0.0f, static_cast<float>(rows - 1));
  const int i = std::min(static_cast<int>(x), columns - 2);
  const int j = std::min(static_cast<int>(y), rows - 2);
  const float a = x - static_cast<float>(i), b = y - static_cast<float>(j);
  const uint8_t* p = texels + static_cast<ptrdiff_t>(j) * columns + i;
  const float top = static_cast<float>(p[0]) * (1 - a) + static_cast<float>(p[1]) * a;
  const float bottom =
      static_cast<float>(p[columns]) * (1 - a) + static_cast<float>(p[columns + 1]) * a;
  return top * (1 - b) + bottom * b;
}

}  // namespace

Surface::Surface(Canvas& canvas, const std::vector<float>& light, int light_columns,
                 int light_rows) {
  Level base{canvas.columns(), canvas.rows(), {}};
  base.texels.resize(static_cast<size_t>(base.columns) * static_cast<size_t>(base.rows));
  size_t texel = 0;
  for (int row = 0; row < base.rows; ++row) {
    const float y = static_cast<float>(row) / static_cast<float>(base.rows - 1) *
                    static_cast<float>(light_rows - 1);
    const int j = std::min(static_cast<int>(y), light_rows - 2);
    const float b = y - static_cast<float>(j);
    for (int column = 0; column < base.columns; ++column) {
      const float x = static_cast<float>(column) / static_cast<float>(base.columns - 1) *
                      static_cast<float>(light_columns - 1);
      const int i = std::min(static_cast<int>(x), light_columns - 2);
      const float a = x - static_cast<float>(i);
      const float* p = &light[static_cast<size_t>(j * light_columns + i)];
      const float factor = (p[0] * (1 - a) + p[1] * a) * (1 - b) +
                           (p[light_columns] * (1 - a) + p[light_columns + 1] * a) * b;
      base.texels[texel++] =
          static_cast<uint8_t>(std::clamp(canvas.at(column, row) * factor + 0.5f, 0.0f, 255.0f));
    }
  }
  levels_.push_back(std::move(base));
  while (std::min(levels_.back().columns, levels_.back().rows) >= 4) {
    const Level& fine = levels_.back();
    Level coarse{fine.columns / 2, fine.rows / 2, {}};
    coarse.texels.reserve(static_cast<size_t>(coarse.columns) * static_cast<size_t>(coarse.rows));
    for (int row = 0; row < coarse.rows; ++row) {
      const uint8_t* above =
          &fine.texels[static_cast<size_t>(2 * row) * static_cast<size_t>(fine.columns)];
      const uint8_t* below = above + fine.columns;
      for (int column = 0; column < coarse.columns; ++column) {
        const int k = 2 * column;
        coarse.texels.push_back(
            static_cast<uint8_t>((above[k] + above[k + 1] + below[k] + below[k + 1] + 2) / 4));
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

float Surface::sample(float u, float v, float footprint) const {
  const float texel = static_cast<float>(Canvas::kTexel);
  // The level whose texels are at most as large as the footprint, and the share of the next one.
  float size = std::max(footprint / texel, 1.0f);
  int level = 0;
  const int last = static_cast<int>(levels_.size()) - 1;
  while (size >= 2 && level < last) {
    size *= 0.5f;
    ++level;
  }
  const auto at = [&](int k) {
    const Level& l = levels_[static_cast<size_t>(k)];
    const float scale = 1 / (texel * static_cast<float>(1 << k));
    // The texels of level 0 lie at the corners of the side; a texel of a higher level lies in the
    // middle of those of level 0 that it is the mean of.
    const float offset = 0.5f - 0.5f / static_cast<float>(1 << k);
    return bilinear(l.texels.data(), l.columns, l.rows, u * scale - offset, v * scale - offset);
  };
  // Near a level's own size one level is enough.
  const float share = level == last ? 0.0f : size - 1;
  if (share < 0.15f) return at(level);
  if (share > 0.85f) return at(level + 1);
  const float fine = at(level);
  return fine + share * (at(level + 1) - fine);
}

struct Scene::Ready {
  int index;
  bool is_room;
  float cosine, sine;
  float from[3];  // the camera's centre in the box's frame
  float half[3];
  float to_centre[3], distance, radius;  // the ball around the box, from the camera
};

bool Scene::is_lit(const Vec3& point, const Vec3& lamp) const {
  for (size_t k = 1; k < boxes_.size(); ++k) {
    const Vec3 from = to_local(boxes_[k], point), to = to_local(boxes_[k], lamp);
    double entry = 0, exit = 1;
    for (size_t axis = 0; axis < 3 && entry < exit; ++axis) {
      const double step = to[axis] - from[axis];
      const double half = boxes_[k].half[axis];
      if (std::abs(step) < 1e-9) {
        if (std::abs(from[axis]) > half) exit = -1;
        continue;
      }
      const double a = (-half - from[axis]) / step, b = (half - from[axis]) / step;
      entry = std::max(entry, std::min(a, b));
      exit = std::min(exit, std::max(a, b));
    }
    if (entry < exit) return false;
  }
  return true;
}

// Lambert's law with soft shadows: five points of each lamp.
std::vector<float> Scene::light_of(size_t box, int side, const std::vector<Lamp>& lamps,
                                   int columns, int rows) const {
  const Box& b = boxes_[box];
  const size_t axis = static_cast<size_t>(side / 2), iu = kAxisU[axis], iv = kAxisV[axis];
  const double sign = (side % 2 == 1 ? 1 : -1);
  Vec3 local_normal{};
  local_normal[axis] = b.is_room ? -sign : sign;
  const Vec3 normal = turned(b, local_normal);
  std::vector<float> light;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      Vec3 local{};
      local[axis] = sign * b.half[axis];
      // Points on the very edge would lie in neighbouring boxes.
      local[iu] = b.half[iu] * 0.995 * (2.0 * column / (columns - 1) - 1);
      local[iv] = b.half[iv] * 0.995 * (2.0 * row / (rows - 1) - 1);
      Vec3 point = plus(turned(b, local), b.centre);
      for (size_t k = 0; k < 3; ++k) point[k] += 1e-3 * normal[k];
      double sum = kAmbient;
      for (const Lamp& lamp : lamps) {
        constexpr double kOffsets[5][2] = {{0, 0}, {1, 1}, {1, -1}, {-1, 1}, {-1, -1}};
        for (const auto& offset : kOffsets) {
          const Vec3 at{lamp.position[0] + lamp.half_width * offset[0],
                        lamp.position[1] + lamp.half_width * offset[1], lamp.position[2]};
          double along = 0, length_sq = 0;
          for (size_t k = 0; k < 3; ++k) {
            along += (at[k] - point[k]) * normal[k];
            length_sq += (at[k] - point[k]) * (at[k] - point[k]);
          }
          if (along <= 0 || !is_lit(point, at)) continue;
          sum += 0.2 * lamp.power * along / (std::sqrt(length_sq) * (length_sq + 0.5));
        }
      }
      light.push_back(static_cast<float>(sum));
    }
  }
  return light;
}

Scene::Scene(std::vector<Box> boxes, const std::vector<Lamp>& lamps, uint64_t seed)
    : boxes_(std::move(boxes)) {
  struct Lit {
    int columns, rows;
    std::vector<float> light;
  };
  std::vector<Lit> lit;
  double sum = 0, area = 0;
  for (size_t box = 0; box < boxes_.size(); ++box) {
    for (int side = 0; side < 6; ++side) {
      const size_t axis = static_cast<size_t>(side / 2);
      const double width = 2 * boxes_[box].half[kAxisU[axis]];
      const double height = 2 * boxes_[box].half[kAxisV[axis]];
      Lit l{std::max(2, static_cast<int>(width / kLightGrid)),
            std::max(2, static_cast<int>(height / kLightGrid)),
            {}};
      l.light = light_of(box, side, lamps, l.columns, l.rows);
      for (const float value : l.light) {
        if (box == 0) sum += value * width * height / static_cast<double>(l.light.size());
      }
      if (box == 0) area += width * height;
      lit.push_back(std::move(l));
    }
  }
  const float scale = static_cast<float>(0.85 * area / sum);
  Random random(seed);
  const Noise noise(random);
  for (size_t box = 0; box < boxes_.size(); ++box) {
    for (int side = 0; side < 6; ++side) {
      const size_t axis = static_cast<size_t>(side / 2);
      Lit& l = lit[6 * box + static_cast<size_t>(side)];
      for (float& value : l.light) value = std::clamp(value * scale, 0.2f, 1.5f);
      Canvas canvas = painted(boxes_[box].materials[static_cast<size_t>(side)],
                              2 * boxes_[box].half[kAxisU[axis]],
                              2 * boxes_[box].half[kAxisV[axis]], noise, random);
      surfaces_.emplace_back(canvas, l.light, l.columns, l.rows);
    }
  }
}

struct Scene::Rays {
  static constexpr size_t kMost = kTile * kTile;
  size_t count = 0;
  float x[kMost], y[kMost], z[kMost];  // unit rays in the world
  float distance[kMost];               // along the ray, metres
  float face[kMost];                   // 6 box + side; a float, so that the loop below is one of
                                       // vectors of one type
};

// Slabs: a ray is inside a box between the last of its entries and the first of its exits (T. L.
// Kay, J. T. Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986). The camera lies in the room,
// which is met at the exit. The conditions have no short cuts, so that the compiler makes vector
// instructions of the inner loop; a component of 0 gives infinities, which compare as they should.
void Scene::cast(const std::vector<Ready>& near, Rays& rays) {
  for (size_t i = 0; i < rays.count; ++i) {
    rays.distance[i] = std::numeric_limits<float>::max();
    rays.face[i] = 0;
  }
  const auto least = [](float a, float b) { return a < b ? a : b; };
  const auto most = [](float a, float b) { return a > b ? a : b; };
  for (const Ready& box : near) {
    const float c = box.cosine, s = box.sine;
    const float fx = box.from[0], fy = box.from[1], fz = box.from[2];
    const float hx = box.half[0], hy = box.half[1], hz = box.half[2];
    const float base = static_cast<float>(6 * box.index);
    // The side that a ray along the positive axis meets: the high one of the room, else the low
    // one.
    const float ahead = base + (box.is_room ? 1.0f : 0.0f);
    const float behind = base + (box.is_room ? 0.0f : 1.0f);
    const size_t count = rays.count;
    if (box.is_room) {
      for (size_t i = 0; i < count; ++i) {
        const float x = c * rays.x[i] + s * rays.y[i], y = c * rays.y[i] - s * rays.x[i];
        const float z = rays.z[i];
        const float far_x = most((-hx - fx) / x, (hx - fx) / x);
        const float far_y = most((-hy - fy) / y, (hy - fy) / y);
        const float far_z = most((-hz - fz) / z, (hz - fz) / z);
        const float exit = least(far_x, least(far_y, far_z));
        const float across = exit == far_z ? z : exit == far_y ? y : x;
        const float axis = exit == far_z ? 4.0f : exit == far_y ? 2.0f : 0.0f;
        const float face = (across > 0 ? ahead : behind) + axis;
        const bool is_hit = exit < rays.distance[i];
        rays.distance[i] = is_hit ? exit : rays.distance[i];
        rays.face[i] = is_hit ? face : rays.face[i];
      }
      continue;
    }
    for (size_t i = 0; i < count; ++i) {
      const float x = c * rays.x[i] + s * rays.y[i], y = c * rays.y[i] - s * rays.x[i];
      const float z = rays.z[i];
      const float ax = (-hx - fx) / x, bx = (hx - fx) / x;
      const float ay = (-hy - fy) / y, by = (hy - fy) / y;
      const float az = (-hz - fz) / z, bz = (hz - fz) / z;
      const float near_x = least(ax, bx), near_y = least(ay, by), near_z = least(az, bz);
      const float entry = most(near_x, most(near_y, near_z));
      const float exit = least(most(ax, bx), least(most(ay, by), most(az, bz)));
      const float across = entry == near_z ? z : entry == near_y ? y : x;
      const float axis = entry == near_z ? 4.0f : entry == near_y ? 2.0f : 0.0f;
      const float face = (across > 0 ? ahead : behind) + axis;
      const bool is_hit =
          static_cast<bool>(static_cast<int>(entry > 0) & static_cast<int>(entry < exit) &
                            static_cast<int>(entry < rays.distance[i]));
      rays.distance[i] = is_hit ? entry : rays.distance[i];
      rays.face[i] = is_hit ? face : rays.face[i];
    }
  }
}

float Scene::grey_at(const std::vector<Ready>& all, const Rays& rays, size_t ray,
                     float angle) const {
  const size_t face = static_cast<size_t>(rays.face[ray]);
  const Ready& box = all[face / 6];
  const size_t axis = face % 6 / 2;
  const float local[3] = {box.cosine * rays.x[ray] + box.sine * rays.y[ray],
                          box.cosine * rays.y[ray] - box.sine * rays.x[ray], rays.z[ray]};
  const size_t iu = kAxisU[axis], iv = kAxisV[axis];
  const float distance = rays.distance[ray];
  const float slant = std::max(std::abs(local[axis]), 0.05f);
  return surfaces_[face].sample(box.from[iu] + distance * local[iu] + box.half[iu],
                                box.from[iv] + distance * local[iv] + box.half[iv],
                                0.85f * distance * angle / std::sqrt(slant));
}

void Scene::render(const Eye& eye, const CameraPose& pose, float* grey, float* depth) const {
  const int width = eye.width(), height = eye.height();
  std::vector<Ready> all;
  for (size_t k = 0; k < boxes_.size(); ++k) {
    const Box& box = boxes_[k];
    Ready r;
    r.index = static_cast<int>(k);
    r.is_room = box.is_room;
    r.cosine = static_cast<float>(std::cos(box.yaw_rad));
    r.sine = static_cast<float>(std::sin(box.yaw_rad));
    const Vec3 from = to_local(box, pose.position);
    double distance_sq = 0, radius_sq = 0;
    for (size_t i = 0; i < 3; ++i) {
      r.from[i] = static_cast<float>(from[i]);
      r.half[i] = static_cast<float>(box.half[i]);
      r.to_centre[i] = static_cast<float>(box.centre[i] - pose.position[i]);
      distance_sq += from[i] * from[i];
      radius_sq += box.half[i] * box.half[i];
    }
    r.distance = static_cast<float>(std::sqrt(distance_sq));
    r.radius = static_cast<float>(std::sqrt(radius_sq));
    all.push_back(r);
  }
  float m[9];
  for (size_t k = 0; k < 9; ++k) m[k] = static_cast<float>(pose.world_from_camera[k]);
  const auto turn = [&m](const float* r, float out[3]) {
    for (int i = 0; i < 3; ++i)
      out[i] = m[3 * i] * r[0] + m[3 * i + 1] * r[1] + m[3 * i + 2] * r[2];
  };
  const auto set_ray = [&turn](Rays& rays, const float* camera_ray, size_t i) {
    float ray[3];
    turn(camera_ray, ray);
    rays.x[i] = ray[0];
    rays.y[i] = ray[1];
    rays.z[i] = ray[2];
  };
  const float angle = static_cast<float>(eye.pixel_angle());
  std::vector<int> faces(static_cast<size_t>(width * height), -1);
  // The boxes that each square of pixels may see: those whose ball meets the square's cone.
  const int across = (width + kTile - 1) / kTile;
  std::vector<std::vector<Ready>> near(static_cast<size_t>(across) *
                                       static_cast<size_t>((height + kTile - 1) / kTile));
  for (int y0 = 0; y0 < height; y0 += kTile) {
    for (int x0 = 0; x0 < width; x0 += kTile) {
      const int x1 = std::min(x0 + kTile, width) - 1, y1 = std::min(y0 + kTile, height) - 1;
      float axis[3], corner[3];
      turn(eye.ray((x0 + x1) / 2, (y0 + y1) / 2), axis);
      float cosine = 1;
      for (const auto& [x, y] : {std::pair{x0, y0}, {x1, y0}, {x0, y1}, {x1, y1}}) {
        turn(eye.ray(x, y), corner);
        cosine = std::min(cosine, axis[0] * corner[0] + axis[1] * corner[1] + axis[2] * corner[2]);
      }
      const float half_angle = std::acos(std::clamp(cosine, -1.0f, 1.0f)) + 2 * angle;
      std::vector<Ready>& list = near[static_cast<size_t>((y0 / kTile) * across + x0 / kTile)];
      for (const Ready& box : all) {
        if (!box.is_room && box.distance > box.radius) {
          const float along = (axis[0] * box.to_centre[0] + axis[1] * box.to_centre[1] +
                               axis[2] * box.to_centre[2]) /
                              box.distance;
          const float off = std::acos(std::clamp(along, -1.0f, 1.0f));
          if (off > half_angle + std::asin(box.radius / box.distance)) continue;
        }
        list.push_back(box);
      }
      Rays rays;
      size_t pixels[Rays::kMost];
      for (int y = y0; y <= y1; ++y) {
        for (int x = x0; x <= x1; ++x) {
          const size_t pixel = static_cast<size_t>(y * width + x);
          const float* r = eye.ray(x, y);
          grey[pixel] = 0;
          if (depth != nullptr) depth[pixel] = 0;
          if (r[0] == 0 && r[1] == 0 && r[2] == 0) continue;  // the lens gives no ray
          pixels[rays.count] = pixel;
          set_ray(rays, r, rays.count++);
        }
      }
      cast(list, rays);
      for (size_t i = 0; i < rays.count; ++i) {
        faces[pixels[i]] = static_cast<int>(rays.face[i]);
        grey[pixels[i]] = grey_at(all, rays, i, angle);
        if (depth == nullptr) continue;
        const int pixel = static_cast<int>(pixels[i]);
        depth[pixels[i]] = rays.distance[i] * eye.ray(pixel % width, pixel / width)[2];
      }
    }
  }
  // Pixels in which two sides meet: the mean of four rays in the pixel's quarters.
  for (int y = 0; y + 1 < height; ++y) {
    for (int x = 0; x + 1 < width; ++x) {
      const size_t pixel = static_cast<size_t>(y * width + x);
      const int face = faces[pixel];
      if (face < 0 || faces[pixel + 1] < 0 || faces[pixel + static_cast<size_t>(width)] < 0)
        continue;
      const bool is_edge = face != faces[pixel + 1] ||
                           face != faces[pixel + static_cast<size_t>(width)] ||
                           (x > 0 && face != faces[pixel - 1]) ||
                           (y > 0 && face != faces[pixel - static_cast<size_t>(width)]);
      if (!is_edge) continue;
      const float* here = eye.ray(x, y);
      const float* right = eye.ray(x + 1, y);
      const float* below = eye.ray(x, y + 1);
      Rays rays;
      rays.count = 4;
      for (size_t k = 0; k < 4; ++k) {
        const float a = k % 2 == 0 ? -0.25f : 0.25f, b = k < 2 ? -0.25f : 0.25f;
        float bent[3];
        for (int i = 0; i < 3; ++i)
          bent[i] = here[i] + a * (right[i] - here[i]) + b * (below[i] - here[i]);
        set_ray(rays, bent, k);
      }
      cast(near[static_cast<size_t>((y / kTile) * across + x / kTile)], rays);
      float sum = 0;
      for (size_t k = 0; k < 4; ++k) sum += grey_at(all, rays, k, angle);
      grey[pixel] = sum / 4;
    }
  }
}

double Scene::height_above_ground(const Vec3& position) const {
  double ground = boxes_[0].centre[2] + boxes_[0].half[2];
  for (size_t k = 1; k < boxes_.size(); ++k) {
    const Vec3 local = to_local(boxes_[k], position);
    const double top = boxes_[k].centre[2] - boxes_[k].half[2];
    if (std::abs(local[0]) <= boxes_[k].half[0] && std::abs(local[1]) <= boxes_[k].half[1] &&
        top >= position[2])
      ground = std::min(ground, top);
  }
  return ground - position[2];
}

double distance_to_solid(const Box& box, const Vec3& point) {
  const Vec3 local = to_local(box, point);
  double out_sq = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double out = std::max(std::abs(local[k]) - box.half[k], 0.0);
    out_sq += out * out;
  }
  return std::sqrt(out_sq);
}

double distance_to_sides(const Box& box, const Vec3& point) {
  const double out = distance_to_solid(box, point);
  if (out > 0) return out;
  const Vec3 local = to_local(box, point);
  double inside = std::numeric_limits<double>::max();
  for (size_t k = 0; k < 3; ++k) inside = std::min(inside, box.half[k] - std::abs(local[k]));
  return inside;
}

}  // namespace flights
