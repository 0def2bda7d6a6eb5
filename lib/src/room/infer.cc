#include "room/infer.h"

#include <cmath>
#include <cstring>

#include "geometry/vector3.h"

namespace tv {
namespace {

// A measured distance lies on a plane within three standard deviations and a voxel.
constexpr double kNearSigmas = 3;
// A plane is carried into a region without texture where at least so many of the pixels in it and
// along its edge were measured on the plane, and this share of the number of those along its edge.
constexpr int32_t kLeastVotes = 24;
constexpr double kLeastShare = 0.1;
// How far from the region, in pixels, what its edge shows may be measured: texture begins where the
// smoothed picture has its edge, and a depth map rarely reaches to there.
constexpr int32_t kEdgeReach = 6;
// The largest ratio of the pixels that were measured beyond the plane to those that were measured
// on it.
constexpr double kMostBeyond = 0.15;
// The most of the region's measured pixels that may lie on none of the planes carried into it.
constexpr double kMostOff = 0.3;
// A plane is a wall of the room where a smaller share of the measured surface lies behind it.
constexpr double kMostBehindWall = 0.03;
// The least cosine between the ray and the plane's normal: 80 degrees.
constexpr double kLeastCosine = 0.17;

// kOutside: the image shows nothing of the scene there, or the camera has no ray.
enum State : uint8_t { kTextured, kPlain, kTaken, kOutside };

struct Picture {
  int32_t width, height;
  uint8_t* grey;    // smoothed
  uint8_t* state;   // a State
  int32_t* region;  // pixels of the region at hand
};

int32_t grey_at(const tv_depth_map& map, int32_t x, int32_t y) {
  const uint8_t* p = map.pixels + y * map.pixel_stride_bytes + map.channels * x;
  return map.channels == 1 ? p[0] : (77 * p[0] + 150 * p[1] + 29 * p[2] + 128) >> 8;
}

int32_t clamped(int32_t value, int32_t end) {
  return value < 0 ? 0 : value >= end ? end - 1 : value;
}

// Replaces each level by the mean of 3 x 3 pixels, which removes two thirds of the noise. A pixel
// outside the image counts as the middle one, so that the outline of the image does not become an
// edge.
void smooth(const tv_depth_map& map, const Picture& picture) {
  for (int32_t y = 0; y < map.height; ++y) {
    for (int32_t x = 0; x < map.width; ++x) {
      const int32_t own = grey_at(map, x, y);
      int32_t sum = 4;
      for (int32_t k = 0; k < 9; ++k) {
        const int32_t nx = clamped(x + k % 3 - 1, map.width);
        const int32_t ny = clamped(y + k / 3 - 1, map.height);
        sum += picture.state[ny * map.width + nx] == kOutside ? own : grey_at(map, nx, ny);
      }
      picture.grey[y * map.width + x] = static_cast<uint8_t>(sum / 9);
    }
  }
}

// A pixel is plain where no step to a neighbour is above max_step.
void find_plain(const Picture& picture, int32_t max_step) {
  const int32_t w = picture.width, h = picture.height;
  for (int32_t y = 0; y < h; ++y) {
    for (int32_t x = 0; x < w; ++x) {
      const int32_t at = y * w + x, grey = picture.grey[at];
      if (picture.state[at] == kOutside) continue;
      const int32_t around[4] = {x > 0 ? at - 1 : at, x + 1 < w ? at + 1 : at, y > 0 ? at - w : at,
                                 y + 1 < h ? at + w : at};
      bool plain = true;
      for (const int32_t n : around) {
        const int32_t step = picture.state[n] == kOutside ? 0 : picture.grey[n] - grey;
        plain = plain && step <= max_step && -step <= max_step;
      }
      picture.state[at] = plain ? kPlain : kTextured;
    }
  }
}

struct Sight {
  double ray[3];  // in the world
};

bool sight_at(const RoomView& view, int32_t at, Sight* sight) {
  Vec3 ray;
  if (!unproject(view.camera, Vec2(at % view.map.width, at / view.map.width), &ray, nullptr)) {
    return false;
  }
  const double d[3] = {ray[0], ray[1], ray[2]};
  rotate(view.rotation, d, sight->ray);
  return true;
}

void find_outside(const RoomView& view, const Picture& picture) {
  for (int32_t at = 0; at < picture.width * picture.height; ++at) {
    Sight sight;
    const bool inside =
        shows_scene(view.map, at % picture.width, at / picture.width) && sight_at(view, at, &sight);
    picture.state[at] = inside ? kTextured : kOutside;
  }
}

// Where the ray meets the plane from its free side; 0 where it does not, or at too small an angle.
double distance_to(const tv_room_plane& plane, const RoomView& view, const Sight& sight) {
  const double cosine = -dot(plane.normal, sight.ray);
  if (cosine < kLeastCosine) return 0;
  const double c[3] = {view.centre[0], view.centre[1], view.centre[2]};
  const double distance = (dot(plane.normal, c) - plane.offset) / cosine;
  return distance > 0 ? distance : 0;
}

// Whether one of the room's own walls, behind which next to nothing was measured, is nearer on this
// ray.
bool is_beyond_a_wall(const RoomView& view, const InferRequest& request, const Sight& sight,
                      double distance) {
  for (int32_t p = 0; p < request.num_planes; ++p) {
    const tv_room_plane& plane = request.planes[p];
    if (plane.share_behind >= kMostBehindWall || !(dot(plane.normal, sight.ray) < 0)) continue;
    const double at[3] = {view.centre[0] + distance * sight.ray[0],
                          view.centre[1] + distance * sight.ray[1],
                          view.centre[2] + distance * sight.ray[2]};
    if (dot(plane.normal, at) < plane.offset - 3 * plane.sigma) return true;
  }
  return false;
}

struct Votes {
  int32_t on[TV_ROOM_MAX_PLANES];      // measured on the plane, in the region or along its edge
  int32_t beyond[TV_ROOM_MAX_PLANES];  // measured farther than the plane, there
  int32_t measured, off;               // in the region: measured, and on no plane
  int32_t edge;                        // pixels along its edge
};

// Counts a measured pixel. Returns the plane that it lies on, kOnNone, or kNotMeasured.
constexpr int32_t kOnNone = -1, kNotMeasured = -2;

int32_t vote(const Readings& readings, const RoomView& view, const InferRequest& request,
             int32_t at, Votes* votes) {
  const Measured m = measured_at(readings, at % view.map.width, at / view.map.width);
  Sight sight;
  if (m.weight == 0 || !sight_at(view, at, &sight)) return kNotMeasured;
  const double most = kNearSigmas * m.sigma + readings.voxel;
  int32_t best = kOnNone;
  double least = most;
  for (int32_t p = 0; p < request.num_planes; ++p) {
    const double distance = distance_to(request.planes[p], view, sight);
    if (!(distance > 0)) continue;
    const double off = std::fabs(distance - m.distance);
    if (off < least) least = off, best = p;
    votes->beyond[p] += m.distance - distance > most;
  }
  if (best >= 0) ++votes->on[best];
  return best;
}

// Whether a map saw a surface, or through, at a point of the world.
bool is_measured(const tv_room& room, const double point[3]) {
  const double voxel = room.options.voxel;
  int32_t c[3];
  for (int i = 0; i < 3; ++i) {
    const double at = point[i] / voxel;
    if (!(at > -kBlockReach && at < kBlockReach)) return true;
    c[i] = floor_of(at);
  }
  const auto half = [](int32_t v) { return (v - (v & (kBlockSide - 1))) / kBlockSide; };
  const int32_t block =
      find_block(room, block_key(room, {half(c[0]), half(c[1]), half(c[2]), false}));
  if (block < 0) return false;
  const int32_t in = kBlockSide - 1;
  const int32_t v = ((c[2] & in) * kBlockSide + (c[1] & in)) * kBlockSide + (c[0] & in);
  return voxels_of(room, block)[v].evidence != 0;
}

// Counts what was measured first on the way from a pixel outwards.
void vote_beyond(const Readings& readings, const RoomView& view, const InferRequest& request,
                 int32_t x, int32_t y, int32_t dx, int32_t dy, Votes* votes) {
  for (int32_t k = 0; k < kEdgeReach; ++k, x += dx, y += dy) {
    if (x < 0 || y < 0 || x >= view.map.width || y >= view.map.height) break;
    if (vote(readings, view, request, y * view.map.width + x, votes) != kNotMeasured) break;
  }
}

// Whether the region may be a part of the plane. What was measured on the plane is evidence for it,
// and what was measured beyond it evidence against it, because it was seen through the plane; what
// is nearer may stand before it.
bool may_be_of(const Votes& votes, int32_t plane) {
  const int32_t on = votes.on[plane];
  return on >= kLeastVotes && on >= kLeastShare * votes.edge &&
         votes.beyond[plane] <= kMostBeyond * on;
}

// Collects the region of plain pixels around a pixel, and what was measured in it and at its edge.
int32_t grow(const Readings& readings, const RoomView& view, const InferRequest& request,
             const Picture& picture, int32_t from, Votes* votes) {
  const int32_t w = picture.width, h = picture.height;
  int32_t size = 0;
  picture.region[size++] = from;
  picture.state[from] = kTaken;
  for (int32_t k = 0; k < size; ++k) {
    const int32_t at = picture.region[k], x = at % w, y = at / w;
    for (int32_t side = 0; side < 4; ++side) {
      const int32_t dx = side == 0 ? -1 : side == 1 ? 1 : 0, dy = side == 2 ? -1 : side == 3;
      if (x + dx < 0 || x + dx >= w || y + dy < 0 || y + dy >= h) continue;
      const int32_t n = at + dy * w + dx;
      if (picture.state[n] == kPlain) {
        picture.state[n] = kTaken;
        picture.region[size++] = n;
      } else if (picture.state[n] == kTextured) {
        vote_beyond(readings, view, request, x + dx, y + dy, dx, dy, votes);
        ++votes->edge;
      }
    }
  }
  return size;
}

}  // namespace

size_t infer_bytes(int32_t width, int32_t height) {
  const size_t pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  return 2 * arena_bytes<uint8_t>(pixels) + arena_bytes<int32_t>(pixels);
}

int32_t infer_distances(const tv_room& room, const RoomView& view, const InferRequest& request,
                        Arena& arena, float* distance, float* sigma) {
  const tv_depth_map& map = view.map;
  const Readings readings = readings_of(room, view);
  const size_t pixels = static_cast<size_t>(map.width) * static_cast<size_t>(map.height);
  Picture picture = {map.width, map.height, arena_alloc<uint8_t>(arena, pixels),
                     arena_alloc<uint8_t>(arena, pixels), arena_alloc<int32_t>(arena, pixels)};
  find_outside(view, picture);
  smooth(map, picture);
  find_plain(picture, request.max_step);
  std::memset(distance, 0, pixels * sizeof *distance);
  std::memset(sigma, 0, pixels * sizeof *sigma);
  int32_t inferred = 0;
  for (int32_t from = 0; from < static_cast<int32_t>(pixels); ++from) {
    if (picture.state[from] != kPlain) continue;
    Votes votes = {};
    const int32_t size = grow(readings, view, request, picture, from, &votes);
    for (int32_t k = 0; k < size; ++k) {
      const int32_t plane = vote(readings, view, request, picture.region[k], &votes);
      votes.measured += plane != kNotMeasured;
      votes.off += plane == kOnNone;
    }
    if (votes.off > kMostOff * votes.measured) continue;
    for (int32_t k = 0; k < size; ++k) {
      const int32_t at = picture.region[k];
      Sight sight;
      if (is_known(readings, at % map.width, at / map.width) || !sight_at(view, at, &sight)) {
        continue;
      }
      // Of several planes the camera sees the nearest one.
      double nearest = 0;
      const tv_room_plane* seen = nullptr;
      for (int32_t p = 0; p < request.num_planes; ++p) {
        if (!may_be_of(votes, p)) continue;
        const double d = distance_to(request.planes[p], view, sight);
        if (d > 0 && (seen == nullptr || d < nearest)) nearest = d, seen = &request.planes[p];
      }
      if (seen == nullptr || is_beyond_a_wall(view, request, sight, nearest)) continue;
      double point[3];
      for (int i = 0; i < 3; ++i) point[i] = view.centre[i] + nearest * sight.ray[i];
      if (is_measured(room, point)) continue;
      const double cosine = -dot(seen->normal, sight.ray);
      distance[at] = static_cast<float>(nearest);
      sigma[at] = static_cast<float>((seen->sigma + 0.5 * room.options.voxel) / cosine);
      ++inferred;
    }
  }
  return inferred;
}

}  // namespace tv
