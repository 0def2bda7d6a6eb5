#include "room/flatten.h"

#include <cmath>

#include "geometry/vector3.h"

namespace tv {
namespace {

// A plane of a room, a wall or a table's top, is flat to within this part of a voxel.
constexpr double kFlatVoxels = 1.0 / 3;
// The smallest sigma that counts is half a voxel, as in fusion: the voxels' own resolution.
constexpr double kLeastVoxels = 0.5;
// A vertex may lie on a plane within so many standard deviations, and turned by less than 45
// degrees: the normals of a noisy surface are noisier than its positions.
constexpr double kNearSigmas = 1.5;
constexpr double kLeastCosine = 0.7;

}  // namespace

void draw_to_planes(const tv_room& room, const tv_room_plane* planes, int32_t num_planes,
                    tv_room_vertex* vertex) {
  double at[3], normal[3];
  for (int i = 0; i < 3; ++i) {
    at[i] = static_cast<double>(vertex->position[i]);
    normal[i] = static_cast<double>(vertex->normal[i]);
  }
  const double least = kLeastVoxels * room.options.voxel, flat = kFlatVoxels * room.options.voxel;
  const double given = static_cast<double>(vertex->sigma), sigma = given < least ? least : given;
  const double variance = sigma * sigma, of_both = variance + flat * flat;
  double nearest_sq = kNearSigmas * kNearSigmas * of_both, distance = 0;
  const tv_room_plane* plane = nullptr;
  for (int32_t k = 0; k < num_planes; ++k) {
    if (dot(planes[k].normal, normal) < kLeastCosine) continue;
    const double away = dot(planes[k].normal, at) - planes[k].offset;
    if (!(away * away <= nearest_sq)) continue;
    nearest_sq = away * away, distance = away, plane = &planes[k];
  }
  if (plane == nullptr) return;
  const double share = variance / of_both;
  for (int i = 0; i < 3; ++i) normal[i] += share * (plane->normal[i] - normal[i]);
  const double length = length_of(normal);
  for (int i = 0; i < 3; ++i) {
    vertex->position[i] = static_cast<float>(at[i] - share * distance * plane->normal[i]);
    vertex->normal[i] = static_cast<float>(normal[i] / length);
  }
  vertex->sigma = static_cast<float>(flat * std::sqrt(share));
}

}  // namespace tv
