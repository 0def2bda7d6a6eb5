// Keyframes: when a frame becomes one, and the points that it adds to the map.
#pragma once

#include "odometry/odometry.h"
#include "twoview/match.h"

namespace tv {

// Makes the frame a keyframe, with the points that it sees, and returns its index.
int32_t make_keyframe(Odometry* odometry, const Frame& frame);

// Makes points of the newest keyframe's keypoints that match those of earlier keyframes, and checks
// the map by these matches. `frame` became the keyframe. Where it can wait, half of the earlier
// keyframes are left to the next call, unless a pair disagreed.
void make_points(Odometry* odometry, int32_t keyframe, const Frame& frame, bool can_wait);

// Removes keyframes until there is room for `wanted` more: those between whose neighbours the
// camera moved and turned least; the first and the last one of a segment where there are no others,
// and never the one to which poses are relative.
void make_room(Odometry* odometry, int32_t wanted);

// Makes points of matched keypoints of two keyframes. `greys` are those of the second one's
// keypoints. Returns how many points it made.
int32_t triangulate_matches(Odometry* odometry, int32_t keyframe0, int32_t keyframe1,
                            const tv_correspondence* matches, int32_t num, double least_angle_rad,
                            const uint8_t* greys);

// The covariance of a point's position: its distance along the ray from where it was first seen,
// and a pixel across.
void point_covariance(const Odometry& odometry, const MapPoint& point, double covariance[9]);

// Removes points that frames do not find where they must appear.
void remove_bad_points(Odometry* odometry);

// Lists the points around a keyframe, those of the keyframes that share most points with it, at
// most max_matched. Returns how many they are.
int32_t list_points(Odometry* odometry, int32_t keyframe, int32_t* points);

// Lists the points around the keyframe that are looked for in the next frames.
void list_local_points(Odometry* odometry, int32_t keyframe);

// Gives the frame the pose and the points of the keyframe that was made from it.
void take_keyframe(const Odometry& odometry, int32_t keyframe, Frame* frame);

// Sets the depth of the scene to the median depth of the points that the frame sees.
void measure_depth(Odometry* odometry, const Frame& frame);

}  // namespace tv
