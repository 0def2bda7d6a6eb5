#include "room/planes.h"

#include <algorithm>
#include <cmath>

#include "geometry/vector3.h"
#include "room/mesh.h"

namespace tv {
namespace {

// A block's surface belongs to a plane if their normals are within 20 degrees and its mean is
// within a voxel and a half. (With three of its standard deviations, too, imprecise surfaces make
// one oblique plane of several parallel ones.)
constexpr double kLikeNormal = 0.94;
constexpr double kNearVoxels = 1.5;
// What is farther behind a plane than this is not a part of it.
constexpr double kBehindVoxels = 4;
// How many candidates a plane is chosen of, and over how many blocks they are compared.
constexpr int32_t kCandidates = 256, kCompared = 4096;
constexpr int kRefits = 4;
// The errors of so many blocks side by side are taken as one.
constexpr double kPatch = 9;
// A plane is upright or level where it is so to within 10 degrees.
constexpr double kUprightSine = 0.174, kLevelCosine = 0.985;

// The plane of a block is its index, or one of these. kOfLargest and kOfOthers: while a plane is
// fitted, a block of it that is in its largest connected part, or in another part.
constexpr int32_t kOfNone = -1, kIgnored = -2, kOfLargest = -3, kOfOthers = -4;

struct Plane {
  double normal[3], offset;
};

Plane plane_of(const Surfel& s) {
  Plane plane;
  double at[3];
  for (int i = 0; i < 3; ++i) {
    plane.normal[i] = static_cast<double>(s.normal[i]);
    at[i] = static_cast<double>(s.mean[i]);
  }
  plane.offset = dot(plane.normal, at);
  return plane;
}

// The distance of a block's surface from the plane, on the free side above 0.
double distance_from(const double normal[3], double offset, const Surfel& s) {
  const double at[3] = {static_cast<double>(s.mean[0]), static_cast<double>(s.mean[1]),
                        static_cast<double>(s.mean[2])};
  return dot(normal, at) - offset;
}

double distance_from(const Plane& plane, const Surfel& s) {
  return distance_from(plane.normal, plane.offset, s);
}

bool belongs(const Plane& plane, const Surfel& s, double voxel) {
  double cosine = 0;
  for (int i = 0; i < 3; ++i) cosine += plane.normal[i] * static_cast<double>(s.normal[i]);
  if (cosine < kLikeNormal) return false;
  const double distance = distance_from(plane, s);
  return distance <= kNearVoxels * voxel && -distance <= kNearVoxels * voxel;
}

// The weight of a block's surface in a fit: its area, less where it is imprecise.
double weight_of(const Surfel& s, double voxel) {
  const double variance = static_cast<double>(s.sigma) * static_cast<double>(s.sigma);
  return static_cast<double>(s.area) * (voxel * voxel) / (voxel * voxel + variance);
}

double area_near(const tv_room& room, const Plane& plane, int32_t step) {
  double area = 0;
  for (int32_t k = 0; k < room.end_blocks; k += step) {
    const Surfel& s = room.surfels[k];
    if (s.plane == kOfNone && belongs(plane, s, room.options.voxel)) {
      area += static_cast<double>(s.area);
    }
  }
  return area * step;
}

// The candidate that most of the surface lies on; false without one of min_area.
bool best_candidate(const tv_room& room, double min_area, Plane* best) {
  int32_t left = 0;
  for (int32_t k = 0; k < room.end_blocks; ++k) left += room.surfels[k].plane == kOfNone;
  const int32_t every = left / kCandidates + 1, step = room.end_blocks / kCompared + 1;
  double most = 0.5 * min_area;
  bool found = false;
  int32_t seen = 0;
  for (int32_t k = 0; k < room.end_blocks; ++k) {
    if (room.surfels[k].plane != kOfNone || seen++ % every != 0) continue;
    const Plane plane = plane_of(room.surfels[k]);
    const double area = area_near(room, plane, step);
    if (area > most) *best = plane, most = area, found = true;
  }
  return found;
}

// Relabels, from `of` to `as`, the part of the plane's blocks that holds the block `first`, each of
// which touches another one. Returns its area.
double label_part(tv_room& room, const Plane& plane, int32_t first, int32_t of, int32_t as) {
  double area = 0;
  int32_t num = 0;
  const auto take = [&](int32_t index) {
    room.surfels[index].plane = as;
    area += static_cast<double>(room.surfels[index].area);
    room.near[num++] = index;
  };
  take(first);
  for (int32_t k = 0; k < num; ++k) {
    const BlockPlace place = place_of(room.blocks[room.near[k]].key);
    for (int32_t n = 0; n < 27; ++n) {
      const BlockPlace beside = {place.x + n % 3 - 1, place.y + n / 3 % 3 - 1, place.z + n / 9 - 1,
                                 false};
      const int32_t index = find_block(room, block_key(room, beside));
      if (index < 0 || room.surfels[index].plane != of) continue;
      if (belongs(plane, room.surfels[index], room.options.voxel)) take(index);
    }
  }
  return area;
}

// Labels the blocks that belong to the plane: kOfLargest in the connected part of the largest area.
void label_parts(tv_room& room, const Plane& plane) {
  double most = -1;
  int32_t largest = 0;
  for (int32_t k = 0; k < room.end_blocks; ++k) {
    const Surfel& s = room.surfels[k];
    if (s.plane != kOfNone || !belongs(plane, s, room.options.voxel)) continue;
    const double area = label_part(room, plane, k, kOfNone, kOfOthers);
    if (area > most) most = area, largest = k;
  }
  if (most > 0) label_part(room, plane, largest, kOfOthers, kOfLargest);
}

void unlabel_parts(tv_room& room) {
  for (int32_t k = 0; k < room.end_blocks; ++k) {
    int32_t& of = room.surfels[k].plane;
    if (of == kOfLargest || of == kOfOthers) of = kOfNone;
  }
}

// Solves the symmetric positive definite 3 x 3 system A x = b by elimination; A and b are changed.
void solve3(double A[3][3], double b[3], double x[3]) {
  for (int k = 0; k < 3; ++k) {
    for (int r = k + 1; r < 3; ++r) {
      const double factor = A[r][k] / A[k][k];
      for (int c = k; c < 3; ++c) A[r][c] -= factor * A[k][c];
      b[r] -= factor * b[k];
    }
  }
  for (int k = 2; k >= 0; --k) {
    double sum = b[k];
    for (int c = k + 1; c < 3; ++c) sum -= A[k][c] * x[c];
    x[k] = sum / A[k][k];
  }
}

struct Fit {
  double area, weight, spread;  // spread: the weighted mean square of the distances
  double centre[3];
};

// Two unit vectors across the normal; the second is the one that is up, where that is known, or
// nearly.
void axes_of(const PlaneRequest& request, const double normal[3], double u[3], double v[3]) {
  double up[3] = {request.up[0], request.up[1], request.up[2]};
  const double along = request.has_gravity ? dot(up, normal) : 1;
  if (along > 0.9 || along < -0.9) {
    int least = 0;
    for (int i = 1; i < 3; ++i) {
      if (std::fabs(normal[i]) < std::fabs(normal[least])) least = i;
    }
    for (int i = 0; i < 3; ++i) up[i] = i == least;
  }
  cross(up, normal, u);
  scale_by(1 / length_of(u), u);
  cross(normal, u, v);
}

// Moves the plane to the least squares of the blocks of a label that belong to it. Where gravity is
// known and the plane is nearly upright or level, its slope against gravity is drawn to 0 by the
// sigma with which gravity is known.
Fit refit(const tv_room& room, const PlaneRequest& request, int32_t label, Plane* plane) {
  const double voxel = room.options.voxel;
  const double unit = (kBlockSide * voxel) * (kBlockSide * voxel);  // the area of a block's side
  Fit fit = {0, 0, 0, {0, 0, 0}};
  for (int32_t k = 0; k < room.end_blocks; ++k) {
    const Surfel& s = room.surfels[k];
    if (s.plane != label || !belongs(*plane, s, voxel)) continue;
    const double weight = weight_of(s, voxel);
    for (int i = 0; i < 3; ++i) fit.centre[i] += weight * static_cast<double>(s.mean[i]);
    fit.weight += weight;
  }
  if (!(fit.weight > 0)) return fit;
  scale_by(1 / fit.weight, fit.centre);
  double u[3], v[3];
  axes_of(request, plane->normal, u, v);
  double A[3][3] = {}, b[3] = {};
  for (int32_t k = 0; k < room.end_blocks; ++k) {
    const Surfel& s = room.surfels[k];
    if (s.plane != label || !belongs(*plane, s, voxel)) continue;
    double from[3];
    for (int i = 0; i < 3; ++i) from[i] = static_cast<double>(s.mean[i]) - fit.centre[i];
    const double row[3] = {dot(u, from), dot(v, from), 1};
    const double distance = distance_from(*plane, s), weight = weight_of(s, voxel);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) A[r][c] += weight * row[r] * row[c];
      b[r] += weight * row[r] * distance;
    }
    fit.area += static_cast<double>(s.area);
    fit.spread += weight * distance * distance;
  }
  fit.spread /= fit.weight;
  // A plane of one line of blocks keeps its direction.
  for (int i = 0; i < 2; ++i) A[i][i] += 1e-6 * (A[0][0] + A[1][1]) + 1e-12 * fit.weight;
  const double along = request.has_gravity ? dot(request.up, plane->normal) : 0.5;
  const bool upright = std::fabs(along)<kUprightSine, level = std::fabs(along)> kLevelCosine;
  if (upright || level) {
    // The slope x along u and v turns the normal to n - x0 u - x1 v.
    const double variance = fit.spread + 0.0625 * voxel * voxel;
    const double strength =
        kPatch * variance * unit / (request.gravity_sigma * request.gravity_sigma);
    for (int i = upright ? 1 : 0; i < 2; ++i) {
      A[i][i] += strength;
      b[i] += strength * dot(request.up, i == 0 ? u : v) * (upright ? along : along > 0 ? -1 : 1);
    }
  }
  double x[3];
  solve3(A, b, x);
  double middle = plane->offset + x[2];
  // The new plane passes through the centre moved to the mean distance.
  const double old_at_centre = dot(plane->normal, fit.centre);
  double moved[3];
  for (int i = 0; i < 3; ++i) {
    moved[i] = fit.centre[i] + (middle - old_at_centre) * plane->normal[i];
  }
  for (int i = 0; i < 3; ++i) plane->normal[i] -= x[0] * u[i] + x[1] * v[i];
  scale_by(1 / length_of(plane->normal), plane->normal);
  plane->offset = dot(plane->normal, moved);
  for (int i = 0; i < 3; ++i) fit.centre[i] = moved[i];
  return fit;
}

int32_t kind_of(const PlaneRequest& request, const double normal[3]) {
  if (!request.has_gravity) return TV_ROOM_PLANE_OTHER;
  const double along = std::fabs(dot(request.up, normal));
  if (along < kUprightSine) return TV_ROOM_PLANE_UPRIGHT;
  return along > kLevelCosine ? TV_ROOM_PLANE_LEVEL : TV_ROOM_PLANE_OTHER;
}

// Which share of the surface of the surfels at hand lies behind the plane.
double share_behind(const tv_room& room, const tv_room_plane& plane) {
  double all = 0, behind = 0;
  for (int32_t k = 0; k < room.end_blocks; ++k) {
    const Surfel& s = room.surfels[k];
    const double area = static_cast<double>(s.area);
    all += area;
    const double distance = distance_from(plane.normal, plane.offset, s);
    if (distance < -kBehindVoxels * room.options.voxel) behind += area;
  }
  return all > 0 ? behind / all : 0;
}

}  // namespace

bool up_of(const double gravity[3], double up[3]) {
  double length = 0;
  for (int i = 0; i < 3; ++i) length = std::max(length, std::fabs(gravity[i]));
  if (!(length > 0)) return false;
  double sum = 0;
  for (int i = 0; i < 3; ++i) {
    up[i] = -gravity[i] / length;
    sum += up[i] * up[i];
  }
  for (int i = 0; i < 3; ++i) up[i] /= std::sqrt(sum);
  return true;
}

int32_t find_planes(tv_room& room, const PlaneRequest& request, tv_room_plane* planes,
                    int32_t cap) {
  make_surfels(room, 1);  // a ceiling that was seen once bounds the walls, too
  for (int32_t k = 0; k < room.end_blocks; ++k) {
    room.surfels[k].plane = room.surfels[k].area > 0 ? kOfNone : kIgnored;
  }
  int32_t num = 0;
  Plane plane;
  while (num < cap && best_candidate(room, request.min_area, &plane)) {
    // One plane near several surfaces fits none of them: it is fitted to the largest, and then to
    // what else lies on it.
    label_parts(room, plane);
    for (int k = 0; k < kRefits; ++k) refit(room, request, kOfLargest, &plane);
    unlabel_parts(room);
    Fit fit = {0, 0, 0, {0, 0, 0}};
    for (int k = 0; k < kRefits; ++k) fit = refit(room, request, kOfNone, &plane);
    const double area = area_near(room, plane, 1);
    bool any = false;
    for (int32_t k = 0; k < room.end_blocks; ++k) {
      Surfel& s = room.surfels[k];
      if (s.plane != kOfNone || !belongs(plane, s, room.options.voxel)) continue;
      s.plane = area >= request.min_area ? num : kIgnored;
      any = true;
    }
    if (!any) break;
    if (area < request.min_area) continue;
    tv_room_plane* out = &planes[num++];
    *out = {};
    for (int i = 0; i < 3; ++i) out->normal[i] = plane.normal[i], out->centre[i] = fit.centre[i];
    out->offset = plane.offset;
    out->area = area;
    out->sigma = std::sqrt(fit.spread);
    out->kind = kind_of(request, plane.normal);
  }
  if (request.min_maps_behind > 1) make_surfels(room, request.min_maps_behind);
  for (int32_t k = 0; k < num; ++k) planes[k].share_behind = share_behind(room, planes[k]);
  return num;
}

}  // namespace tv
