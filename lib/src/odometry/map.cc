#include "odometry/map.h"

#include <algorithm>
#include <cstring>

#include "geometry/vector3.h"

namespace tv {
namespace {

size_t as_size(int32_t n) { return static_cast<size_t>(n); }

size_t num_map_keypoints(const MapSizes& sizes) {
  return as_size(sizes.max_keyframes) * as_size(sizes.max_keypoints);
}

size_t num_described(const MapSizes& sizes) {
  return as_size(kDescribedKeyframes) * as_size(sizes.max_keypoints) * TV_DESCRIPTOR_BYTES;
}

size_t num_marks(const MapSizes& sizes) { return 1 + (as_size(sizes.max_points) + 31) / 32; }

size_t num_planes(const MapSizes& sizes) {
  return 2 * as_size(kDescribedKeyframes) * as_size(sizes.max_keypoints);
}

void release_point(Map* map, int32_t point) {
  map->points[point].id = -1;
  map->free_points[map->num_free_points++] = point;
  --map->num_points;
}

// After the keyframe before `own` was removed: the way to `own` becomes the sum of the way to the
// removed keyframe and its own.
void join_ways(const MapKeyframe& removed, MapKeyframe* own) {
  Rigid way = motion_between(removed.cam_from_world, own->cam_from_world);
  std::copy_n(own->way_m, 3, way.t);
  transform(way, removed.way_m, own->way_m);
  const bool is_known = removed.way_variance > 0 && own->way_variance > 0;
  own->way_variance = is_known ? own->way_variance + removed.way_variance : 0;
  own->is_followed = removed.is_followed && own->is_followed;
  own->is_contrary = removed.is_contrary || own->is_contrary;
}

// The poses of frames that were relative to a keyframe which is removed now, or to one that was
// removed before and is relative to it, become relative to the keyframe `stays`.
void keep_relation(Map* map, const MapKeyframe& removed, const MapKeyframe& stays) {
  RemovedKeyframe own{removed.id, stays.id,
                      motion_between(removed.cam_from_world, stays.cam_from_world),
                      removed.scale / stays.scale};
  for (double& t : own.kept_from_removed.t) t /= stays.scale;
  for (int32_t n = 0; n < map->num_removed; ++n) {
    RemovedKeyframe& other = map->removed[n];
    if (other.kept_id != own.id) continue;
    scale_by(own.scale, other.kept_from_removed.t);
    other.kept_from_removed = compose(own.kept_from_removed, other.kept_from_removed);
    other.scale *= own.scale;
    other.kept_id = own.kept_id;
  }
  if (map->num_removed == max_removed(map->sizes)) forget_removed(map, 1);
  int32_t at = map->num_removed++;
  for (; at > 0 && map->removed[at - 1].id > own.id; --at) map->removed[at] = map->removed[at - 1];
  map->removed[at] = own;
}

}  // namespace

void forget_removed(Map* map, int32_t num) {
  map->num_removed -= num;
  std::memmove(map->removed, map->removed + num, as_size(map->num_removed) * sizeof *map->removed);
}

int32_t pose_in_world(const Map& map, int32_t reference_id, Rigid* pose) {
  int32_t id = reference_id;
  int32_t k = find_keyframe(map, id);
  // A removed keyframe leads to a kept one in one step, in maps of earlier versions in several.
  for (int32_t steps = 0; k < 0 && steps <= map.num_removed; ++steps) {
    int32_t n = 0;
    while (n < map.num_removed && map.removed[n].id != id) ++n;
    if (n == map.num_removed) return -1;
    scale_by(map.removed[n].scale, pose->t);
    *pose = compose(map.removed[n].kept_from_removed, *pose);
    id = map.removed[n].kept_id;
    k = find_keyframe(map, id);
  }
  if (k < 0) return -1;
  scale_by(map.keyframes[k].scale, pose->t);
  *pose = compose(inverse(map.keyframes[k].cam_from_world), *pose);
  return k;
}

void make_map(const MapSizes& sizes, Arena& arena, Map* map) {
  const size_t points = as_size(sizes.max_points);
  map->sizes = sizes;
  map->keyframes = arena_alloc<MapKeyframe>(arena, as_size(sizes.max_keyframes));
  map->keypoints = arena_alloc<MapKeypoint>(arena, num_map_keypoints(sizes));
  map->seen = arena_alloc<int32_t>(arena, num_map_keypoints(sizes));
  map->free_rooms = arena_alloc<int32_t>(arena, as_size(sizes.max_keyframes));
  map->points = arena_alloc<MapPoint>(arena, points);
  map->point_descriptors = arena_alloc<uint8_t>(arena, points * TV_DESCRIPTOR_BYTES);
  map->free_points = arena_alloc<int32_t>(arena, points);
  map->marks = arena_alloc<uint32_t>(arena, num_marks(sizes));
  map->descriptors = arena_alloc<uint8_t>(arena, num_described(sizes));
  map->planes = arena_alloc<double>(arena, num_planes(sizes));
  map->removed = arena_alloc<RemovedKeyframe>(arena, as_size(max_removed(sizes)));
}

size_t map_bytes(const MapSizes& sizes) {
  Map map;
  Arena arena = measuring_arena();
  make_map(sizes, arena, &map);
  return arena.used_bytes;
}

void clear_map(Map* map) {
  map->num_keyframes = map->num_points = map->end_points = map->num_removed = 0;
  map->next_described = map->next_keyframe_id = map->next_point_id = 0;
  map->num_free_rooms = map->sizes.max_keyframes;
  for (int32_t k = 0; k < map->num_free_rooms; ++k) {
    map->free_rooms[k] = map->num_free_rooms - 1 - k;
  }
  map->num_free_points = 0;
}

void clear_marks(Map* map) { std::fill_n(map->marks, num_marks(map->sizes), 0u); }

void mark_points(Map* map, const int32_t* points, int32_t num) {
  clear_marks(map);
  for (int32_t i = 0; i < num; ++i) {
    if (points[i] != kNoPoint) mark_point(map, points[i]);
  }
}

int32_t count_marked(const Map& map, const MapKeyframe& keyframe) {
  const int32_t* seen = seen_by(map, keyframe);
  int32_t num = 0;
  for (int32_t i = 0; i < keyframe.num_keypoints; ++i) num += is_marked(map, seen[i]);
  return num;
}

int32_t first_from(const Map& map, int32_t id) {
  int32_t low = 0, high = map.num_keyframes;
  while (low < high) {
    const int32_t middle = (low + high) / 2;
    if (map.keyframes[middle].id < id)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

int32_t find_keyframe(const Map& map, int32_t id) {
  const int32_t low = first_from(map, id);
  return low < map.num_keyframes && map.keyframes[low].id == id ? low : -1;
}

void forget_planes(const Map& map, const MapKeyframe& keyframe) {
  std::fill_n(planes_of(map, keyframe), 2 * keyframe.num_keypoints, __builtin_nan(""));
}

int32_t add_keyframe(Map* map, const tv_keypoint* keypoints, const uint8_t* descriptors,
                     int32_t num) {
  const int32_t idx = map->num_keyframes++;
  MapKeyframe* keyframe = &map->keyframes[idx];
  *keyframe = MapKeyframe{};
  keyframe->scale = 1;
  keyframe->id = map->next_keyframe_id++;
  keyframe->room = map->free_rooms[--map->num_free_rooms];
  keyframe->num_keypoints = num;
  keyframe->described = map->next_described;
  map->next_described = (map->next_described + 1) % kDescribedKeyframes;
  for (int32_t k = 0; k < idx; ++k) {
    if (map->keyframes[k].described == keyframe->described) map->keyframes[k].described = -1;
  }
  MapKeypoint* own = keypoints_of(*map, *keyframe);
  for (int32_t k = 0; k < num; ++k) {
    own[k] = {keypoints[k].x, keypoints[k].y, keypoints[k].size};
  }
  std::fill_n(seen_by(*map, *keyframe), num, kNoPoint);
  std::memcpy(descriptors_of(*map, *keyframe), descriptors, as_size(num) * TV_DESCRIPTOR_BYTES);
  forget_planes(*map, *keyframe);
  return idx;
}

int32_t add_point(Map* map, const double position[3], const uint8_t* descriptor, int32_t segment) {
  int32_t idx = kNoPoint;
  if (map->num_free_points > 0) {
    idx = map->free_points[--map->num_free_points];
  } else if (map->end_points < map->sizes.max_points) {
    idx = map->end_points++;
  } else {
    return kNoPoint;
  }
  MapPoint* point = &map->points[idx];
  *point = MapPoint{};
  for (int k = 0; k < 3; ++k) point->position[k] = position[k];
  point->id = map->next_point_id++;
  point->segment = segment;
  std::memcpy(descriptor_of(*map, idx), descriptor, TV_DESCRIPTOR_BYTES);
  ++map->num_points;
  return idx;
}

void observe(Map* map, int32_t keyframe, int32_t keypoint, int32_t point) {
  seen_by(*map, map->keyframes[keyframe])[keypoint] = point;
  ++map->keyframes[keyframe].num_observations;
  ++map->points[point].num_observations;
}

void forget_observation(Map* map, int32_t keyframe, int32_t keypoint) {
  int32_t* point = &seen_by(*map, map->keyframes[keyframe])[keypoint];
  --map->keyframes[keyframe].num_observations;
  --map->points[*point].num_observations;
  *point = kNoPoint;
}

void rank_points(const Map& map, int32_t* places, int32_t* ranks) {
  int32_t num = 0;
  for (int32_t p = 0; p < map.end_points; ++p) {
    if (map.points[p].id >= 0) places[num++] = p;
  }
  // D. Shell's sort, with D. Knuth's gaps: shorter than std::sort, at most num^1.5 steps.
  int32_t gap = 1;
  while (gap < num / 3) gap = 3 * gap + 1;
  for (; gap > 0; gap /= 3) {
    for (int32_t n = gap; n < num; ++n) {
      const int32_t place = places[n], id = map.points[place].id;
      int32_t at = n;
      for (; at >= gap && map.points[places[at - gap]].id > id; at -= gap) {
        places[at] = places[at - gap];
      }
      places[at] = place;
    }
  }
  for (int32_t n = 0; n < num; ++n) ranks[places[n]] = n;
}

void remove_marked_points(Map* map) {
  int32_t num_left = 0;  // observations of them
  for (int32_t p = 0; p < map->end_points; ++p) {
    if (is_marked(*map, p) && map->points[p].id >= 0) num_left += map->points[p].num_observations;
  }
  // The newest keyframes see most of them.
  for (int32_t k = map->num_keyframes - 1; k >= 0 && num_left > 0; --k) {
    const int32_t* seen = seen_by(*map, map->keyframes[k]);
    for (int32_t i = 0; i < map->keyframes[k].num_keypoints; ++i) {
      if (!is_marked(*map, seen[i])) continue;
      forget_observation(map, k, i);
      --num_left;
    }
  }
  for (int32_t p = 0; p < map->end_points; ++p) {
    if (is_marked(*map, p) && map->points[p].id >= 0) release_point(map, p);
  }
}

void move_keyframes(Map* map, const MovedKeyframe* moved) {
  for (int32_t p = 0; p < map->end_points; ++p) {
    MapPoint& point = map->points[p];
    if (point.id < 0) continue;
    int32_t k = first_from(*map, point.made_at);
    while (k < map->num_keyframes && map->keyframes[k].segment != point.segment) ++k;
    if (k == map->num_keyframes) k = newest_of(*map, point.segment, k);
    if (k < 0 || moved[k].scale == 0) continue;
    const Rigid world_from_cam = inverse(moved[k].cam_from_world);
    double x[3], seen[3];
    const double from[3] = {static_cast<double>(point.seen_from[0]),
                            static_cast<double>(point.seen_from[1]),
                            static_cast<double>(point.seen_from[2])};
    transform(map->keyframes[k].cam_from_world, point.position, x);
    transform(map->keyframes[k].cam_from_world, from, seen);
    scale_by(moved[k].scale, x);
    scale_by(moved[k].scale, seen);
    transform(world_from_cam, x, point.position);
    transform(world_from_cam, seen, seen);
    for (int c = 0; c < 3; ++c) point.seen_from[c] = static_cast<float>(seen[c]);
  }
  for (int32_t k = 0; k < map->num_keyframes; ++k) {
    if (moved[k].scale == 0) continue;
    map->keyframes[k].cam_from_world = orthonormalised(moved[k].cam_from_world);
    map->keyframes[k].scale *= moved[k].scale;
  }
}

void remove_lone_points(Map* map) {
  clear_marks(map);
  for (int32_t p = 0; p < map->end_points; ++p) {
    if (map->points[p].num_observations < 2) mark_point(map, p);
  }
  remove_marked_points(map);
}

bool is_upright(const Map& map, int32_t segment) {
  for (int32_t k = 0; k < map.num_keyframes; ++k) {
    if (map.keyframes[k].segment == segment && map.keyframes[k].down_sigma_rad > 0) return true;
  }
  return false;
}

int32_t newest_of(const Map& map, int32_t segment, int32_t end) {
  do --end;
  while (end >= 0 && map.keyframes[end].segment != segment);
  return end;
}

void remove_keyframe(Map* map, int32_t keyframe, int32_t kept) {
  MapKeyframe* removed = &map->keyframes[keyframe];
  if (kept >= 0) keep_relation(map, *removed, map->keyframes[kept]);
  const int32_t* seen = seen_by(*map, *removed);
  for (int32_t i = 0; i < removed->num_keypoints; ++i) {
    if (seen[i] != kNoPoint) forget_observation(map, keyframe, i);
  }
  map->free_rooms[map->num_free_rooms++] = removed->room;
  if (keyframe + 1 < map->num_keyframes) join_ways(*removed, removed + 1);
  std::memmove(removed, removed + 1, as_size(map->num_keyframes - keyframe - 1) * sizeof *removed);
  --map->num_keyframes;
}

}  // namespace tv
