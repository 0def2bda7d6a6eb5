#include "room/fuse.h"

#include <cmath>
#include <cstring>

namespace tv {

bool shows_scene(const tv_depth_map& map, int32_t x, int32_t y) {
  return map.mask == nullptr || map.mask[y * map.mask_stride_bytes + x] != 0;
}

namespace {

// Without sigmas, a hundredth of the distance.
constexpr double kRelativeSigma = 0.01;
// The weight of a pixel whose sigma is a voxel. With the largest weight of 64 the smallest sigma
// that counts is half a voxel: the voxels' own resolution.
constexpr double kUnitWeight = 16;
// Where the nearest pixel is unknown, a neighbour stands in for it with this part of its weight: it
// fills holes, and yet moves an outline, where others see it, by little.
constexpr int32_t kBorrowed = 4;
// Inferred distances have no errors that average out: they are fused at most so many voxels before
// and behind their surface. That is a voxel across it where it is seen at an angle of 20 degrees.
constexpr int32_t kInferredVoxels = 3;

struct Fusion {
  const tv_room& room;
  const RoomView& view;
  double voxel, truncation, max_distance;
  int32_t reach_voxels;  // the map is fused so far before and behind its surface
};

Fusion fusion_of(const tv_room& room, const RoomView& view) {
  const tv_room_options& o = room.options;
  const bool is_near = view.map.inferred != 0 && o.truncation_voxels > kInferredVoxels;
  return {room,
          view,
          o.voxel,
          o.voxel * o.truncation_voxels,
          o.max_distance > 0 ? o.max_distance : 1e30,
          is_near ? kInferredVoxels : o.truncation_voxels};
}

Measured measured_at(const Fusion& f, int32_t x, int32_t y) {
  const tv_depth_map& map = f.view.map;
  const ptrdiff_t at = static_cast<ptrdiff_t>(y) * map.stride + x;
  const Measured unknown = {0, 0, 0};
  if (map.witnesses != nullptr && map.witnesses[at] == 0) return unknown;
  if (!shows_scene(map, x, y)) return unknown;
  const double distance = static_cast<double>(map.distance[at]);
  if (!(distance > 0 && distance <= f.max_distance)) return unknown;
  const double sigma =
      map.sigma != nullptr ? static_cast<double>(map.sigma[at]) : kRelativeSigma * distance;
  if (!(sigma > 0)) return unknown;
  const double ratio = f.voxel / sigma;
  const double weight = kUnitWeight * (ratio * ratio) + 0.5;
  return {distance, sigma, weight < kMaxWeight ? static_cast<int32_t>(weight) : kMaxWeight};
}

// The known pixel that is nearest to (u, v), of the four around it. Its weight is 0 where none is
// known.
Measured nearest_known(const Fusion& f, double u, double v, int32_t* x, int32_t* y) {
  const int32_t x0 = floor_of(u), y0 = floor_of(v);
  const bool right = u - x0 >= 0.5, low = v - y0 >= 0.5;
  const double a = right ? x0 + 1 - u : u - x0, b = low ? y0 + 1 - v : v - y0;
  Measured m = {0, 0, 0};
  for (int k = 0; k < 4 && m.weight == 0; ++k) {
    // The nearest first, the opposite last, between them the one across the smaller gap.
    const bool across = k == 3 || k == (a > b ? 1 : 2);
    const bool down = k == 3 || k == (a > b ? 2 : 1);
    *x = x0 + (right != across), *y = y0 + (low != down);
    const tv_depth_map& map = f.view.map;
    if (*x >= 0 && *y >= 0 && *x < map.width && *y < map.height) m = measured_at(f, *x, *y);
    if (k > 0 && m.weight > 0) m.weight = (m.weight + kBorrowed - 1) / kBorrowed;
  }
  return m;
}

// The distance at a pixel (u, v), nearest to (x, y): interpolated, where the four pixels around it
// are known and lie on one surface.
double distance_near(const Fusion& f, double u, double v, const Measured& nearest) {
  const tv_depth_map& map = f.view.map;
  const int32_t x = floor_of(u), y = floor_of(v);
  if (x < 0 || y < 0 || x + 1 >= map.width || y + 1 >= map.height) return nearest.distance;
  const double a = u - x, b = v - y;
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    const Measured m = measured_at(f, x + (k & 1), y + (k >> 1));
    const double step = m.distance - nearest.distance;
    if (m.weight == 0 || step > f.truncation || -step > f.truncation) return nearest.distance;
    sum += m.distance * ((k & 1) != 0 ? a : 1 - a) * ((k >> 1) != 0 ? b : 1 - b);
  }
  return sum;
}

// Red, green and blue, at a pixel, packed as a voxel's sums.
uint64_t colour_at(const tv_depth_map& map, int32_t x, int32_t y) {
  int64_t rgb[3] = {128, 128, 128};
  if (map.pixels != nullptr) {
    const uint8_t* p = map.pixels + y * map.pixel_stride_bytes + map.channels * x;
    for (int k = 0; k < 3; ++k) rgb[k] = p[map.channels == 3 ? k : 0];
  }
  return pack_colour(rgb);
}

// The pixel of a point; false where it lies outside the map.
bool pixel_of(const RoomView& view, const Vec3& point, double* u, double* v) {
  Vec2 pixel;
  if (view.camera.model.model == TV_CAMERA_PINHOLE) {
    if (!(point[2] > 0)) return false;
    const double inverse = 1 / point[2];
    *u = view.camera.model.fx * (point[0] * inverse) + view.camera.model.cx;
    *v = view.camera.model.fy * (point[1] * inverse) + view.camera.model.cy;
  } else {
    if (!project(view.camera, point, &pixel, nullptr)) return false;
    *u = pixel[0];
    *v = pixel[1];
  }
  return *u >= -0.5 && *v >= -0.5 && *u < view.map.width - 0.5 && *v < view.map.height - 0.5;
}

// What the view contributes to a voxel at a point of its camera's frame; false where that is
// nothing. near: the voxel may be near the surface; else only seeing through it counts.
bool contribution(const Fusion& f, const Vec3& point, bool near, Voxel* added) {
  double u, v;
  if (!pixel_of(f.view, point, &u, &v)) return false;
  int32_t x = 0, y = 0;
  const Measured m = nearest_known(f, u, v, &x, &y);
  if (m.weight == 0) return false;
  const double range = std::sqrt((point[0] * point[0] + point[1] * point[1]) + point[2] * point[2]);
  const double in_front = m.distance - range;
  if (in_front > f.truncation) {
    *added = {kSeenThrough, 0};
    return f.view.map.inferred == 0 && in_front > 3 * m.sigma;
  }
  if (!near) return false;
  const double distance = distance_near(f, u, v, m) - range;
  const double reach = f.voxel * f.reach_voxels;
  if (!(distance <= reach && distance >= -reach)) return false;
  const double share = distance / f.truncation;
  const int32_t steps = floor_of(share * kMaxDistance + 0.5);
  // The weight falls from a third of the truncation behind the surface on: what lies there may be
  // the other side of a thin wall.
  const double fade = share < -1.0 / 3 ? 1.5 * (1 + share) : 1;
  const int32_t faded = static_cast<int32_t>(fade * m.weight + 0.5);
  const int32_t weight = faded > 0 ? faded : 1;
  *added = {pack_evidence(int64_t{steps} * weight, weight, 1, 0), colour_at(f.view.map, x, y)};
  return true;
}

// Adds the view to a block, or subtracts it. near: the block is one of those around its surface.
void fuse_block(const Fusion& f, int32_t index, bool near, bool subtract) {
  const BlockPlace place = place_of(f.room.blocks[index].key);
  const Mat3& R = f.view.rotation;
  const double side = f.voxel * kBlockSide, half = 0.5 * f.voxel;  // a voxel is its centre
  const double from[3] = {place.x * side + half - f.view.centre[0],
                          place.y * side + half - f.view.centre[1],
                          place.z * side + half - f.view.centre[2]};
  Vec3 corner, axis[3];
  for (int i = 0; i < 3; ++i) {
    corner[i] = (R(0, i) * from[0] + R(1, i) * from[1]) + R(2, i) * from[2];
    for (int k = 0; k < 3; ++k) axis[k][i] = R(k, i) * f.voxel;
  }
  Voxel* voxel = voxels_of(f.room, index);
  for (int z = 0; z < kBlockSide; ++z) {
    for (int y = 0; y < kBlockSide; ++y) {
      for (int x = 0; x < kBlockSide; ++x, ++voxel) {
        Vec3 point;
        for (int i = 0; i < 3; ++i) {
          point[i] = corner[i] + ((x * axis[0][i] + y * axis[1][i]) + z * axis[2][i]);
        }
        Voxel added;
        if (!contribution(f, point, near, &added)) continue;
        voxel->evidence += subtract ? ~added.evidence + 1 : added.evidence;
        voxel->colour += subtract ? ~added.colour + 1 : added.colour;
      }
    }
  }
}

// Whether the view may see something of a block through which it could see.
bool may_see(const Fusion& f, int32_t index) {
  const BlockPlace place = place_of(f.room.blocks[index].key);
  const double side = f.voxel * kBlockSide, half = 0.5 * side;
  const double from[3] = {place.x * side + half - f.view.centre[0],
                          place.y * side + half - f.view.centre[1],
                          place.z * side + half - f.view.centre[2]};
  const Mat3& R = f.view.rotation;
  Vec3 point;
  for (int i = 0; i < 3; ++i)
    point[i] = (R(0, i) * from[0] + R(1, i) * from[1]) + R(2, i) * from[2];
  double u, v;
  return pixel_of(f.view, point, &u, &v);
}

// Calls visit(key) for the blocks within the view's reach of each measured point: of one pixel in
// each square of `step` pixels. Stops where it returns false, and returns false then.
template <typename Visit>
bool visit_near(const Fusion& f, const Visit& visit) {
  const tv_depth_map& map = f.view.map;
  const double block = f.voxel * kBlockSide;
  double farthest = 0;
  for (int32_t y = 0; y < map.height; ++y) {
    for (int32_t x = 0; x < map.width; ++x) {
      const Measured m = measured_at(f, x, y);
      if (m.weight > 0 && m.distance > farthest) farthest = m.distance;
    }
  }
  // Squares that are at most half a block large where the surface is farthest.
  const tv_camera& lens = f.view.camera.model;
  const double pixel = farthest / (lens.fx < lens.fy ? lens.fx : lens.fy);
  const int32_t step = 8 * pixel < block ? 4 : 4 * pixel < block ? 2 : 1;
  uint64_t last = 0;
  for (int32_t y = 0; y < map.height; y += step) {
    for (int32_t x = 0; x < map.width; x += step) {
      int32_t k = 0;
      Measured m = {0, 0, 0};
      for (; k < step * step; ++k) {
        const int32_t px = x + k % step, py = y + k / step;
        if (px < map.width && py < map.height) m = measured_at(f, px, py);
        if (m.weight > 0) break;
      }
      Vec3 ray;
      if (m.weight == 0 ||
          !unproject(f.view.camera, Vec2(x + k % step, y + k / step), &ray, nullptr)) {
        continue;
      }
      const double d[3] = {ray[0], ray[1], ray[2]};
      double direction[3];
      for (int i = 0; i < 3; ++i) {
        const Mat3& R = f.view.rotation;
        direction[i] = ((R(i, 0) * d[0] + R(i, 1) * d[1]) + R(i, 2) * d[2]);
      }
      for (int32_t s = -f.reach_voxels; s <= f.reach_voxels; s += 2) {
        const double range = m.distance + s * f.voxel;
        int32_t place[3];
        bool inside = range > 0;
        for (int i = 0; i < 3; ++i) {
          const double c = (f.view.centre[i] + range * direction[i]) / block;
          inside = inside && c >= -kBlockReach + 1 && c < kBlockReach - 1;
          place[i] = inside ? floor_of(c) : 0;
        }
        if (!inside) continue;
        const uint64_t key =
            block_key(f.room, {place[0], place[1], place[2], f.view.map.inferred != 0});
        if (key != last && !visit(key)) return false;
        last = key;
      }
    }
  }
  return true;
}

void fuse(tv_room& room, const RoomView& view, uint32_t added_at, bool subtract) {
  const Fusion f = fusion_of(room, view);
  const bool sees_through = f.view.map.inferred == 0;
  for (int32_t k = 0; k < room.num_near; ++k) {
    if (room.blocks[room.near[k]].born_at <= added_at) fuse_block(f, room.near[k], true, subtract);
  }
  for (int32_t index = 0; sees_through && index < room.end_blocks; ++index) {
    const Block& block = room.blocks[index];
    if (block.key == 0 || block.used_at == room.num_calls || block.born_at > added_at) continue;
    if (may_see(f, index)) fuse_block(f, index, false, subtract);
  }
  for (int32_t k = 0; k < room.num_near; ++k) {
    if (!has_surface(room, room.near[k], 1)) free_block(room, room.near[k]);
  }
}

uint64_t mix(uint64_t digest, uint64_t word) {
  digest = (digest ^ word) * 0x9e3779b97f4a7c15u;
  return digest ^ digest >> 29;
}

uint64_t digest_bytes(uint64_t digest, const void* bytes, size_t count) {
  const uint8_t* b = static_cast<const uint8_t*>(bytes);
  for (; count > 0;) {
    const size_t part = count < 8 ? count : 8;
    uint64_t word = part;
    std::memcpy(&word, b, part);
    digest = mix(digest, word);
    b += part, count -= part;
  }
  return digest;
}

uint64_t digest_rows(uint64_t digest, const void* data, size_t row_bytes, int64_t stride_bytes,
                     int32_t rows) {
  for (int32_t y = 0; data != nullptr && y < rows; ++y) {
    digest = digest_bytes(digest, static_cast<const uint8_t*>(data) + y * stride_bytes, row_bytes);
  }
  return mix(digest, data != nullptr);
}

}  // namespace

Measured measured_at(const tv_room& room, const RoomView& view, int32_t x, int32_t y) {
  return measured_at(fusion_of(room, view), x, y);
}

uint64_t digest_of(const RoomView& view) {
  const tv_depth_map& map = view.map;
  const size_t width = static_cast<size_t>(map.width);
  uint64_t digest = mix(0x7477, static_cast<uint64_t>(map.inferred));
  digest = digest_bytes(digest, &view.camera.model, sizeof view.camera.model);
  digest = digest_bytes(digest, view.rotation.data(), 9 * sizeof(double));
  digest = digest_bytes(digest, view.centre.data(), 3 * sizeof(double));
  digest = digest_rows(digest, map.distance, 4 * width, int64_t{4} * map.stride, map.height);
  digest = digest_rows(digest, map.sigma, 4 * width, int64_t{4} * map.stride, map.height);
  digest = digest_rows(digest, map.witnesses, width, map.stride, map.height);
  digest = digest_rows(digest, map.mask, width, map.mask_stride_bytes, map.height);
  const size_t channels = map.pixels != nullptr ? static_cast<size_t>(map.channels) : 0;
  return digest_rows(digest, map.pixels, width * channels, map.pixel_stride_bytes, map.height);
}

bool list_near_blocks(tv_room& room, const RoomView& view, bool make) {
  ++room.num_calls;
  room.num_near = 0;
  const bool listed = visit_near(fusion_of(room, view), [&room, make](uint64_t key) {
    int32_t index = find_block(room, key);
    if (index < 0 && !make) return true;
    if (index < 0) index = make_block(room, key);
    if (index < 0) return false;
    Block& block = room.blocks[index];
    if (block.used_at != room.num_calls) room.near[room.num_near++] = index;
    block.used_at = room.num_calls;
    return true;
  });
  for (int32_t k = 0; !listed && k < room.num_near; ++k) {
    if (room.blocks[room.near[k]].born_at == room.num_calls) free_block(room, room.near[k]);
  }
  return listed;
}

void add_view(tv_room& room, const RoomView& view) { fuse(room, view, room.num_calls, false); }

void subtract_view(tv_room& room, const RoomView& view, uint32_t added_at) {
  fuse(room, view, added_at, true);
}

void add_to_new_blocks(tv_room& room, const RoomView& view, uint32_t added_at) {
  list_near_blocks(room, view, false);
  const Fusion f = fusion_of(room, view);
  for (int32_t index = 0; index < room.end_blocks; ++index) {
    const Block& block = room.blocks[index];
    if (block.key == 0 || block.born_at <= added_at) continue;
    const bool near = block.used_at == room.num_calls;
    if (near || (view.map.inferred == 0 && may_see(f, index))) fuse_block(f, index, near, false);
  }
}

}  // namespace tv
