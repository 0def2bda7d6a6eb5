// Loops: the camera sees again what it saw long before. The keyframes in between are corrected by
// what the path drifted in position, attitude and scale, as in the pose chain of G. Dubbelman,
// B. Browning, "COP-SLAM: closed-form online pose-chain optimization for visual SLAM", 2015, and
// then adjusted together in the frames that follow. A segment that meets another one becomes part
// of it. Tests: test/unit/test_loop_closure.cc.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// What the loop's keyframe would be in the frame of coordinates of what it sees again: a point x of
// its camera is `scale` times as far away there.
struct LoopEnd {
  int32_t keyframe;      // the old keyframe that was seen again
  Rigid cam_from_world;  // of the newest keyframe
  double scale;
};

// Writes for each keyframe the length of the segment's path since then.
void measure_paths(const Map& map, int32_t segment, double* lengths);

// Whether a keyframe is so far from where it was that this is a jump of its segment's path.
bool is_jump(Odometry* odometry, const Rigid& before, int32_t keyframe);

// Whether drift over a path of this length can explain where the frame is now and where it must be
// for a loop.
bool is_plausible(const Odometry& odometry, const Frame& frame, double path, const LoopEnd& end);

// Whether a loop with few inliers, or with a large correction, agrees with the last such loop; this
// loop is then remembered in its place. `frame` has its pose.
bool is_seen_twice(Odometry* odometry, const Frame& frame, const LoopEnd& end);

// Whether a loop closes: at once, or together with another one that agrees. `path`: the length of
// the path since the end's keyframe.
bool is_believed(Odometry* odometry, const Frame& frame, double path, int32_t num_inliers,
                 int32_t num_matches, const LoopEnd& end);

// Looks for the tracked frame in `count` keyframes that do not share its points. True: *end is
// known, and `again`, with the frame's keypoints, has the old points that they see.
bool find_loop(Odometry* odometry, const Frame& frame, int32_t count, Frame* again, LoopEnd* end);

// Corrects the keyframes and points, roughly: the rest is left to the frames that follow
// (odometry/spread.h). `keyframe` has the keypoints of `again`; it is the newest one where it is of
// the same segment as the loop's end. Returns whether the path jumps.
bool close_loop(Odometry* odometry, int32_t keyframe, const Frame& again, const LoopEnd& end);

// Compares the keyframes from number `first` on with those before it that are of other segments.
// Where two segments meet, the later one becomes part of the earlier one. Returns how many segments
// were joined.
int32_t join_segments(Odometry* odometry, int32_t first);

}  // namespace tv
