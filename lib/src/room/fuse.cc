#include "room/fuse.h"

#include <cmath>

#include "geometry/vector3.h"

namespace tv {
namespace {

// Where the pixel nearest to a voxel is unknown, the nearest known neighbour is used with 1 /
// kBorrowed of its weight. This closes holes, and hardly moves an outline where other views see it.
constexpr int32_t kBorrowed = 4;
// Inferred distances are not averaged over views: they are fused up to this many voxels before and
// behind their surface, which is one voxel across the surface where it is seen at an angle of 20
// degrees.
constexpr int32_t kInferredVoxels = 3;
// Comparisons with what a tile measured at most or at least leave this part of a distance for what
// numbers are rounded by.
constexpr double kRounding = 1e-6;

struct Fusion {
  const tv_room& room;
  const RoomView& view;
  Readings readings;
  double voxel, truncation;
  int32_t reach_voxels;  // the map is fused so far before and behind its surface
  double reach;
  Tiles tiles;
  Tile whole;  // all of them in one
};

Fusion fusion_of(const tv_room& room, const RoomView& view) {
  const tv_room_options& o = room.options;
  const bool is_near = view.map.inferred != 0 && o.truncation_voxels > kInferredVoxels;
  const int32_t reach_voxels = is_near ? kInferredVoxels : o.truncation_voxels;
  Fusion f = {room,
              view,
              readings_of(room, view),
              o.voxel,
              o.voxel * o.truncation_voxels,
              reach_voxels,
              o.voxel * reach_voxels,
              {},
              {}};
  f.tiles =
      make_tiles(&f.readings, room.surfels, static_cast<size_t>(room.cap_blocks) * sizeof(Surfel));
  f.whole = joined(f.tiles);
  return f;
}

// A pixel.
struct Place {
  int32_t x, y;
};

// The four pixels around (u, v): left and right above, left and right below.
struct Corners {
  int32_t x, y;   // of the first
  double a, b;    // where (u, v) lies between them
  int32_t known;  // bit k: something was measured at the k-th
};

Corners corners_of(const Fusion& f, double u, double v) {
  const int32_t x = floor_of(u), y = floor_of(v);
  const tv_depth_map& map = f.view.map;
  int32_t known = 0;
  for (int32_t k = 0; k < 4; ++k) {
    const int32_t px = x + (k & 1), py = y + (k >> 1);
    const bool inside = px >= 0 && py >= 0 && px < map.width && py < map.height;
    known |= (inside && is_known(f.readings, px, py) ? 1 : 0) << k;
  }
  return {x, y, u - x, v - y, known};
}

// Of the four corners the nearest that is known; at least one is. is_borrowed: the nearest corner
// is unknown.
Place nearest_known(const Corners& c, bool* is_borrowed) {
  const bool right = c.a >= 0.5, low = c.b >= 0.5;
  const int32_t nearest = (right ? 1 : 0) + (low ? 2 : 0);
  int32_t k = nearest;
  *is_borrowed = (c.known >> nearest & 1) == 0;
  if (*is_borrowed) {
    // The one across the smaller gap, then that across the other, then the opposite one.
    const double gap_x = right ? 1 - c.a : c.a, gap_y = low ? 1 - c.b : c.b;
    const int32_t first = gap_x > gap_y ? 1 : 2;
    k = (c.known >> (nearest ^ first) & 1) != 0         ? nearest ^ first
        : (c.known >> (nearest ^ (3 - first)) & 1) != 0 ? nearest ^ (3 - first)
                                                        : nearest ^ 3;
  }
  return {c.x + (k & 1), c.y + (k >> 1)};
}

// The distance between the corners, near one of that distance: interpolated, where all are known
// and lie on one surface.
double distance_near(const Fusion& f, const Corners& c, double nearest) {
  if (c.known != 15) return nearest;
  double sum = 0;
  for (int k = 0; k < 4; ++k) {
    const double distance = distance_at(f.readings, c.x + (k & 1), c.y + (k >> 1));
    const double step = distance - nearest;
    if (step > f.truncation || -step > f.truncation) return nearest;
    sum += distance * ((k & 1) != 0 ? c.a : 1 - c.a) * ((k >> 1) != 0 ? c.b : 1 - c.b);
  }
  return sum;
}

// Red, green and blue, at a pixel, packed as a voxel's sums.
uint64_t colour_at(const tv_depth_map& map, const Place& at) {
  int64_t rgb[3] = {128, 128, 128};
  if (map.pixels != nullptr) {
    const uint8_t* p = map.pixels + at.y * map.pixel_stride_bytes + map.channels * at.x;
    for (int k = 0; k < 3; ++k) rgb[k] = p[map.channels == 3 ? k : 0];
  }
  return pack_colour(rgb);
}

// The pixel of a point; false where it lies outside the map.
bool pixel_of(const RoomView& view, const Vec3& point, double* u, double* v) {
  const tv_camera& lens = view.camera.model;
  if (lens.model == TV_CAMERA_PINHOLE) {
    if (!(point[2] > 0)) return false;
    const double inverse = 1 / point[2];
    *u = lens.fx * (point[0] * inverse) + lens.cx;
    *v = lens.fy * (point[1] * inverse) + lens.cy;
  } else {
    Vec2 pixel;
    if (!project(view.camera, point, &pixel, nullptr)) return false;
    *u = pixel[0];
    *v = pixel[1];
  }
  return *u >= -0.5 && *v >= -0.5 && *u < view.map.width - 0.5 && *v < view.map.height - 0.5;
}

// How the view sees the voxels of a block: at which pixels, and how far away. What lies outside the
// map has kOutside for u.
constexpr double kOutside = -1;
struct Sights {
  double u[kBlockVoxels], v[kBlockVoxels], range[kBlockVoxels];
};

// The centres of a block's voxels, in the camera's frame.
void place_voxels(const Fusion& f, int32_t index, double points[3][kBlockVoxels]) {
  const BlockPlace place = place_of(f.room.blocks[index].key);
  const Mat3& R = f.view.rotation;
  const double side = f.voxel * kBlockSide, half = 0.5 * f.voxel;  // a voxel is its centre
  const double from[3] = {place.x * side + half - f.view.centre[0],
                          place.y * side + half - f.view.centre[1],
                          place.z * side + half - f.view.centre[2]};
  for (int i = 0; i < 3; ++i) {
    const double corner = (R(0, i) * from[0] + R(1, i) * from[1]) + R(2, i) * from[2];
    const double axis[3] = {R(0, i) * f.voxel, R(1, i) * f.voxel, R(2, i) * f.voxel};
    double* point = points[i];
    for (int z = 0; z < kBlockSide; ++z) {
      for (int y = 0; y < kBlockSide; ++y) {
        for (int x = 0; x < kBlockSide; ++x) {
          *point++ = corner + ((x * axis[0] + y * axis[1]) + z * axis[2]);
        }
      }
    }
  }
}

void see_voxels(const Fusion& f, int32_t index, Sights* s) {
  double p[3][kBlockVoxels];
  place_voxels(f, index, p);
  for (int n = 0; n < kBlockVoxels; ++n) {
    s->range[n] = std::sqrt((p[0][n] * p[0][n] + p[1][n] * p[1][n]) + p[2][n] * p[2][n]);
  }
  const RoomView& view = f.view;
  const tv_camera& lens = view.camera.model;
  if (lens.model == TV_CAMERA_PINHOLE) {
    for (int n = 0; n < kBlockVoxels; ++n) {
      const double inverse = 1 / p[2][n];
      s->u[n] = lens.fx * (p[0][n] * inverse) + lens.cx;
      s->v[n] = lens.fy * (p[1][n] * inverse) + lens.cy;
    }
    const double right = view.map.width - 0.5, bottom = view.map.height - 0.5;
    for (int n = 0; n < kBlockVoxels; ++n) {
      const bool inside =
          p[2][n] > 0 && s->u[n] >= -0.5 && s->v[n] >= -0.5 && s->u[n] < right && s->v[n] < bottom;
      s->u[n] = inside ? s->u[n] : kOutside;
    }
  } else {
    for (int n = 0; n < kBlockVoxels; ++n) {
      if (!pixel_of(view, Vec3(p[0][n], p[1][n], p[2][n]), &s->u[n], &s->v[n])) s->u[n] = kOutside;
    }
  }
}

// What the view contributes to a voxel that it sees at (u, v) and so far away; false where that is
// nothing. near: the voxel may be near the surface; else only seeing through it counts.
bool contribution(const Fusion& f, double u, double v, double range, bool near, Voxel* added) {
  const Corners corners = corners_of(f, u, v);
  if (corners.known == 0) return false;
  bool is_borrowed;
  const Place at = nearest_known(corners, &is_borrowed);
  const double nearest = distance_at(f.readings, at.x, at.y);
  const double in_front = nearest - range;
  if (in_front > f.truncation) {
    *added = {kSeenThrough, 0};
    return f.view.map.inferred == 0 && in_front > 3 * sigma_at(f.readings, at.x, at.y);
  }
  if (!near) return false;
  const double distance = distance_near(f, corners, nearest) - range;
  if (!(distance <= f.reach && distance >= -f.reach)) return false;
  const int32_t full = weight_of(f.voxel, sigma_at(f.readings, at.x, at.y));
  const int32_t known = is_borrowed ? (full + kBorrowed - 1) / kBorrowed : full;
  const double share = distance / f.truncation;
  const int32_t steps = floor_of(share * kMaxDistance + 0.5);
  // The weight falls from a third of the truncation behind the surface on: what lies there may be
  // the other side of a thin wall.
  const double fade = share < -1.0 / 3 ? 1.5 * (1 + share) : 1;
  const int32_t faded = static_cast<int32_t>(fade * known + 0.5);
  const int32_t weight = faded > 0 ? faded : 1;
  *added = {pack_evidence(int64_t{steps} * weight, weight, 1, 0), colour_at(f.view.map, at)};
  return true;
}

// Adds the view to a block, or subtracts it. near: the block is one of those around its surface.
void fuse_block(const Fusion& f, int32_t index, bool near, bool subtract) {
  Sights s;
  see_voxels(f, index, &s);
  Voxel* const voxels = voxels_of(f.room, index);
  for (int n = 0; n < kBlockVoxels; ++n) {
    Voxel added;
    if (s.u[n] == kOutside) continue;
    if (!contribution(f, s.u[n], s.v[n], s.range[n], near, &added)) continue;
    voxels[n].evidence += subtract ? ~added.evidence + 1 : added.evidence;
    voxels[n].colour += subtract ? ~added.colour + 1 : added.colour;
  }
}

// A ball around a block, in the camera's frame.
struct Ball {
  Vec3 centre;
  double radius, range;  // range: of its centre
};

Ball ball_of(const Fusion& f, int32_t index) {
  const BlockPlace place = place_of(f.room.blocks[index].key);
  const double side = f.voxel * kBlockSide, half = 0.5 * side;
  const double from[3] = {place.x * side + half - f.view.centre[0],
                          place.y * side + half - f.view.centre[1],
                          place.z * side + half - f.view.centre[2]};
  const Mat3& R = f.view.rotation;
  double centre[3];
  for (int i = 0; i < 3; ++i)
    centre[i] = (R(0, i) * from[0] + R(1, i) * from[1]) + R(2, i) * from[2];
  return {Vec3(centre[0], centre[1], centre[2]), 0.8661 * side, length_of(centre)};
}

// The tiles whose pixels, or neighbours of these, may show something of the ball.
TileRange tiles_around(const Fusion& f, const Ball& ball) {
  const TileRange all = {0, 0, f.tiles.columns - 1, f.tiles.rows - 1}, none = {0, 0, -1, -1};
  const tv_depth_map& map = f.view.map;
  const tv_camera& lens = f.view.camera.model;
  const double x = ball.centre[0], y = ball.centre[1], z = ball.centre[2];
  if (lens.model != TV_CAMERA_PINHOLE) return all;
  if (z < -ball.radius) return none;
  if (z < 2 * ball.radius) return all;
  // |x / z - x0 / z0| of a point in the ball is at most radius (z0 + |x0|) / (z0 (z0 - radius)).
  const double inverse = 1 / z, scale = ball.radius * inverse / (z - ball.radius);
  const double u = lens.fx * (x * inverse) + lens.cx, v = lens.fy * (y * inverse) + lens.cy;
  const double across = lens.fx * scale * (z + std::fabs(x)) + 1;
  const double down = lens.fy * scale * (z + std::fabs(y)) + 1;
  if (!(u + across > 0 && v + down > 0 && u - across < map.width && v - down < map.height)) {
    return none;
  }
  const auto tile_at = [&f](double pixel, int32_t end) {
    const double inside = pixel < 0 ? 0 : pixel > end - 1 ? end - 1 : pixel;
    return static_cast<int32_t>(inside) >> f.tiles.shift;
  };
  return {tile_at(u - across, map.width), tile_at(v - down, map.height),
          tile_at(u + across, map.width), tile_at(v + down, map.height)};
}

// Whether some part of a block whose centre the view sees may lie in front of what the view
// measured, by more than the truncation.
bool may_see_through(const Fusion& f, int32_t index) {
  const Ball ball = ball_of(f, index);
  double u, v;
  if (!pixel_of(f.view, ball.centre, &u, &v)) return false;
  const double least = (ball.range - ball.radius + f.truncation) * (1 - kRounding);
  if (static_cast<double>(f.whole.most) < least) return false;
  const TileRange range = tiles_around(f, ball);
  for (int32_t y = range.top; y <= range.bottom; ++y) {
    for (int32_t x = range.left; x <= range.right; ++x) {
      if (static_cast<double>(f.tiles.tile[y * f.tiles.columns + x].most) >= least) return true;
    }
  }
  return false;
}

// Whether a block may be near the view's surface.
bool may_be_near(const Fusion& f, int32_t index) {
  const Ball ball = ball_of(f, index);
  const double within = ball.radius + f.reach + kRounding * (ball.range + f.reach);
  if (ball.range + within < static_cast<double>(f.whole.least)) return false;
  if (ball.range - within > static_cast<double>(f.whole.most)) return false;
  const TileRange range = tiles_around(f, ball);
  return range.left <= range.right;
}

// The first known pixel of a square of pixels.
Place first_known(const Fusion& f, const Place& corner, int32_t side) {
  const tv_depth_map& map = f.view.map;
  for (int32_t k = 0; k < side * side; ++k) {
    const Place at = {corner.x + k % side, corner.y + k / side};
    if (at.x < map.width && at.y < map.height && is_known(f.readings, at.x, at.y)) return at;
  }
  return {-1, -1};
}

// The block of a measured point that is moved along its ray; false beyond all blocks.
bool block_at(const Fusion& f, const double direction[3], double range, int32_t place[3]) {
  const double block = f.voxel * kBlockSide;
  bool inside = range > 0;
  for (int i = 0; i < 3; ++i) {
    const double c = (f.view.centre[i] + range * direction[i]) / block;
    inside = inside && c >= -kBlockReach + 1 && c < kBlockReach - 1;
    place[i] = inside ? floor_of(c) : 0;
  }
  return inside;
}

// The side of the squares of pixels of which one is enough: at most half a block where the surface
// is farthest.
int32_t square_side(const Fusion& f) {
  const double farthest = f.whole.most > 0 ? static_cast<double>(f.whole.most) : 0;
  const tv_camera& lens = f.view.camera.model;
  const double pixel = farthest / (lens.fx < lens.fy ? lens.fx : lens.fy);
  const double block = f.voxel * kBlockSide;
  return 8 * pixel < block ? 4 : 4 * pixel < block ? 2 : 1;
}

// Calls visit(key) for the blocks within the view's reach of each measured point: of one pixel in
// each square of pixels. Stops where it returns false, and returns false then.
template <typename Visit>
bool visit_near(const Fusion& f, const Visit& visit) {
  const tv_depth_map& map = f.view.map;
  const int32_t side = square_side(f);
  // Many points lie in a block that a point nearby has just visited: a small table holds the blocks
  // visited last.
  constexpr int kVisitedBits = 8;
  uint64_t visited[1 << kVisitedBits] = {};
  for (int32_t y = 0; y < map.height; y += side) {
    for (int32_t x = 0; x < map.width; x += side) {
      const Place at = first_known(f, {x, y}, side);
      Vec3 ray;
      if (at.x < 0 || !unproject(f.view.camera, Vec2(at.x, at.y), &ray, nullptr)) continue;
      const double d[3] = {ray[0], ray[1], ray[2]};
      double direction[3];
      rotate(f.view.rotation, d, direction);
      const double distance = distance_at(f.readings, at.x, at.y);
      for (int32_t s = -f.reach_voxels; s <= f.reach_voxels; s += 2) {
        int32_t place[3];
        if (!block_at(f, direction, distance + s * f.voxel, place)) continue;
        const uint64_t key =
            block_key(f.room, {place[0], place[1], place[2], f.view.map.inferred != 0});
        uint64_t& before = visited[key * 0x9e3779b97f4a7c15u >> (64 - kVisitedBits)];
        if (key == before) continue;
        if (!visit(key)) return false;
        before = key;
      }
    }
  }
  return true;
}

// Lists the blocks near the view's surface in room.near. make: adds the blocks that the room does
// not have; without memory for them it returns false and leaves the room as it was.
bool list_near_blocks(tv_room& room, const Fusion& f, bool make) {
  ++room.num_calls;
  room.num_near = 0;
  const bool listed = visit_near(f, [&room, make](uint64_t key) {
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

// Adds the view to the blocks of room.near, and what it sees through to all others; or subtracts
// it. Blocks that were made after added_at are left out.
void fuse(tv_room& room, const Fusion& f, uint32_t added_at, bool subtract) {
  const bool sees_through = f.view.map.inferred == 0;
  for (int32_t k = 0; k < room.num_near; ++k) {
    if (room.blocks[room.near[k]].born_at <= added_at) fuse_block(f, room.near[k], true, subtract);
  }
  for (int32_t index = 0; sees_through && index < room.end_blocks; ++index) {
    const Block& block = room.blocks[index];
    if (block.key == 0 || block.used_at == room.num_calls || block.born_at > added_at) continue;
    if (may_see_through(f, index)) fuse_block(f, index, false, subtract);
  }
  for (int32_t k = 0; k < room.num_near; ++k) {
    if (!has_surface(room, room.near[k], 1)) free_block(room, room.near[k]);
  }
}

}  // namespace

bool add_view(tv_room& room, const RoomView& view) {
  const Fusion f = fusion_of(room, view);
  if (!list_near_blocks(room, f, true)) return false;
  fuse(room, f, room.num_calls, false);
  return true;
}

void subtract_view(tv_room& room, const RoomView& view, uint32_t added_at) {
  const Fusion f = fusion_of(room, view);
  list_near_blocks(room, f, false);
  fuse(room, f, added_at, true);
}

void add_to_new_blocks(tv_room& room, const RoomView& view, uint32_t added_at) {
  const Fusion f = fusion_of(room, view);
  const bool inferred = view.map.inferred != 0;
  ++room.num_calls;
  const auto is_new = [added_at](const Block& block) {
    return block.key != 0 && block.born_at > added_at;
  };
  bool any_near = false;
  for (int32_t index = 0; index < room.end_blocks && !any_near; ++index) {
    const Block& block = room.blocks[index];
    any_near = is_new(block) && place_of(block.key).inferred == inferred && may_be_near(f, index);
  }
  if (any_near) {
    visit_near(f, [&room](uint64_t key) {
      const int32_t index = find_block(room, key);
      if (index >= 0) room.blocks[index].used_at = room.num_calls;
      return true;
    });
  }
  for (int32_t index = 0; index < room.end_blocks; ++index) {
    const Block& block = room.blocks[index];
    if (!is_new(block)) continue;
    const bool near = block.used_at == room.num_calls;
    if (near || (!inferred && may_see_through(f, index))) fuse_block(f, index, near, false);
  }
}

}  // namespace tv
