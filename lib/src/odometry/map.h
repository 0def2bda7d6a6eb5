// The map: keyframes, points, and which keypoint of a keyframe sees which point. All of it lies in
// arrays of a fixed size. Tests: test/api/test_odometry_api.c.
#pragma once

#include "base/arena.h"
#include "pose/rigid.h"
#include "twoview/feature.h"

namespace tv {

inline constexpr int32_t kNoPoint = -1;
// How many keyframes keep all their descriptors: the last ones, with which new points are made.
// The others keep those of the points that they see.
inline constexpr int32_t kDescribedKeyframes = 16;
// The size of a keypoint of the finest level, of which a pixel's sigma is 1.
inline constexpr float kFinestSize = 4.0f;

struct MapKeypoint {
  float x, y, size;
};

struct MapKeyframe {
  int32_t id, segment, frame;
  int32_t room;  // which part of the keypoints' array is its own
  int32_t num_keypoints, num_observations;
  int32_t described;  // which part of the descriptors' array is its own; -1: none
  double time_s;
  Rigid cam_from_world;
  double down[3], down_sigma_rad;   // gravity in the camera's frame; sigma 0: not known
  double height_m, height_sigma_m;  // sigma 0: not known
  double scale;                     // by which loops have multiplied its surroundings since then
  // The way from the keyframe before, as the velocities say, in the camera's axes, which turn with
  // the map. Variance 0: not known. No part of a map's bytes, which hold time_s to scale as they
  // are.
  double way_m[3], way_variance;
  bool is_followed;  // all frames since the keyframe before were tracked, one from the other
  bool is_contrary;  // the way of the map, or of a frame since then, contradicted the velocities
};

struct MapPoint {
  double position[3];
  int32_t id;  // -1: the place is free
  int32_t segment;
  int32_t num_observations;
  int32_t num_visible, num_found;  // in how many searches, and frames, since it was made
  int32_t made_at;                 // the id of the keyframe that made it
  float depth_sigma;               // of the logarithm of its distance from `seen_from`
  float seen_from[3];
  int32_t grey;
};

// Where a keyframe that was removed lies relative to one that the map has.
struct RemovedKeyframe {
  int32_t id, kept_id;
  Rigid kept_from_removed;  // cameras, in the unit of the one that was kept when it was made
  double scale;             // from the removed one's unit when it was made to that unit
};

struct MapSizes {
  int32_t max_keypoints, max_keyframes, max_points;
};

struct Map {
  MapSizes sizes;
  MapKeyframe* keyframes;  // in ascending order of id
  int32_t num_keyframes;
  MapKeypoint* keypoints;  // max_keypoints for each room
  int32_t* seen;           // as many: the index of the point that each keypoint sees, or kNoPoint
  int32_t* free_rooms;
  int32_t num_free_rooms;
  MapPoint* points;
  uint8_t* point_descriptors;      // TV_DESCRIPTOR_BYTES for each point
  int32_t num_points, end_points;  // those that are in use, and the end of the used places
  uint32_t* marks;  // a bit for each point, and before them those of kNoPoint, which stay 0
  int32_t* free_points;
  int32_t num_free_points;
  uint8_t* descriptors;  // kDescribedKeyframes times max_keypoints times TV_DESCRIPTOR_BYTES
  double* planes;  // as many times two: where each keypoint's ray meets the plane z = 1, once it
                   // was computed for a window, else not a number
  int32_t next_described;
  RemovedKeyframe* removed;  // in ascending order of id
  int32_t num_removed;
  int32_t next_keyframe_id, next_point_id;
};

inline int32_t max_removed(const MapSizes& sizes) { return 16 * sizes.max_keyframes; }

size_t map_bytes(const MapSizes& sizes);
void make_map(const MapSizes& sizes, Arena& arena, Map* map);  // its arrays; clear_map comes next
void clear_map(Map* map);

// The sigma of a keypoint's pixel, relative to that of a keypoint of the finest level.
inline double sigma_of(const MapKeypoint& keypoint) {
  return static_cast<double>(keypoint.size / kFinestSize);
}

inline MapKeypoint* keypoints_of(const Map& map, const MapKeyframe& keyframe) {
  return map.keypoints +
         static_cast<size_t>(keyframe.room) * static_cast<size_t>(map.sizes.max_keypoints);
}

// The points that the keypoints of a keyframe see. They lie apart from the rest of the keypoints,
// because many passes over the whole map read them alone.
inline int32_t* seen_by(const Map& map, const MapKeyframe& keyframe) {
  return map.seen +
         static_cast<size_t>(keyframe.room) * static_cast<size_t>(map.sizes.max_keypoints);
}

inline uint8_t* descriptors_of(const Map& map, const MapKeyframe& keyframe) {
  return map.descriptors + static_cast<size_t>(keyframe.described) *
                               static_cast<size_t>(map.sizes.max_keypoints) * TV_DESCRIPTOR_BYTES;
}

inline double* planes_of(const Map& map, const MapKeyframe& keyframe) {
  return map.planes +
         2 * static_cast<size_t>(keyframe.described) * static_cast<size_t>(map.sizes.max_keypoints);
}

inline uint8_t* descriptor_of(const Map& map, int32_t point) {
  return map.point_descriptors + static_cast<size_t>(point) * TV_DESCRIPTOR_BYTES;
}

// The index of the keyframe of this id among the keyframes; -1 where the map has none.
int32_t find_keyframe(const Map& map, int32_t id);
// The index of the first keyframe whose id is at least this one; num_keyframes where there is none.
int32_t first_from(const Map& map, int32_t id);

// A set of the map's points, a bit each: passes over all keypoints of all keyframes mark points in
// it and look them up.
void clear_marks(Map* map);
inline void mark_point(Map* map, int32_t point) {
  map->marks[1 + (point >> 5)] |= uint32_t{1} << (point & 31);
}
inline bool is_marked(const Map& map, int32_t point) {
  return (map.marks[1 + (point >> 5)] >> (point & 31) & 1) != 0;
}
// Marks these points, and no others; kNoPoint may be among them.
void mark_points(Map* map, const int32_t* points, int32_t num);
int32_t count_marked(const Map& map, const MapKeyframe& keyframe);

// Forgets the cached planes of a keyframe that still has its descriptors; they are computed again
// when they are needed.
void forget_planes(const Map& map, const MapKeyframe& keyframe);

// Adds a keyframe with the keypoints and descriptors of a frame, none of which sees a point, and
// returns its index. The map must have room for it.
int32_t add_keyframe(Map* map, const tv_keypoint* keypoints, const uint8_t* descriptors,
                     int32_t num);

// Adds a point that no keyframe sees, and returns its index; kNoPoint when the map is full.
int32_t add_point(Map* map, const double position[3], const uint8_t* descriptor, int32_t segment);

void observe(Map* map, int32_t keyframe, int32_t keypoint, int32_t point);
void forget_observation(Map* map, int32_t keyframe, int32_t keypoint);

// Writes the places of the points in the order of their ids, and for each place in use the rank of
// its point in that order. Both arrays have room for end_points.
void rank_points(const Map& map, int32_t* places, int32_t* ranks);

// The new pose of a keyframe, and the factor by which the distances of its points change. Factor 0:
// the keyframe is not moved, and the pose is not read.
struct MovedKeyframe {
  Rigid cam_from_world;
  double scale;
};

// Moves the keyframes, and each point with the keyframe that made it, or one near it that is left.
void move_keyframes(Map* map, const MovedKeyframe* moved);

// Removes the marked points, also from the keyframes that see them. Places that are free may be
// marked, too.
void remove_marked_points(Map* map);

// Removes the points that fewer than two keyframes see.
void remove_lone_points(Map* map);

// Whether attitudes keep a segment upright.
bool is_upright(const Map& map, int32_t segment);

// Turns a pose relative to a keyframe, in that one's unit, into world_from_cam, also where the
// keyframe was removed since. Returns the index of the keyframe that it hangs on now; -1 where the
// map does not know the keyframe, and the pose is of no use then.
int32_t pose_in_world(const Map& map, int32_t reference_id, Rigid* pose);

// Forgets where the first `num` keyframes that were removed lie.
void forget_removed(Map* map, int32_t num);

// The newest keyframe of a segment before the place `end`; -1 where there is none.
int32_t newest_of(const Map& map, int32_t segment, int32_t end);

// Removes a keyframe. Its points stay, also those that only one other keyframe sees then. Frames
// that are relative to it are relative to the keyframe `kept` from now on; -1: to none.
void remove_keyframe(Map* map, int32_t keyframe, int32_t kept);

}  // namespace tv
