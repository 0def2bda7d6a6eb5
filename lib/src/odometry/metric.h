// Metres and the vertical: what heights, velocities and attitudes say of the map.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// What the frame's sensors say, as far as it can be used: finite, and an attitude that is a
// rotation.
void read_sensors(const tv_odometry_frame& input, Frame* frame);

// Whether the frame's attitude fits its pose in an upright map. An attitude that does not is
// forgotten.
bool check_attitude(const Odometry& odometry, Frame* frame);

// Adds the way from the frame before, which was tracked, to the travel; or begins another one.
void add_travel(Odometry* odometry, const Frame& frame);
void begin_travel(Odometry* odometry, const Rigid& cam_from_world, int32_t keyframe_id);

// Whether the way of the map since the travel began is another one than that of the velocities.
bool is_contrary(const Odometry& odometry, const Frame& frame);

// Stores what the frame's sensors measured, for the test whether a later frame can have been
// reached.
void measure_reach(const Odometry& odometry, const Frame& frame, Reach* reach);

// Adds the longest way that the camera may have gone since the frame before to most_m: by its
// velocity; without a bound after a gap, or without a velocity.
void add_reach(Odometry* odometry, const Frame& frame, bool gap);

// Whether the sensors allow that a frame that was lost is where it was found. Places look alike.
bool is_reachable(const Odometry& odometry, const Frame& frame);

// Stores with the newest keyframe the way from the keyframe before, as the velocities measure it;
// makes the metre the unit of the segment once the scale is known to 10 %.
void measure_scale(Odometry* odometry, Frame* frame);

// Computes the evidence on the scale anew, from the ways between the segment's keyframes as they
// lie now.
void gather_ways(Odometry* odometry);

// An estimate of the scale from evidence: product / square is the scale, and 1 / square its
// variance. `source` (tv_scale_source) names the sensors of all the evidence together.
struct ScaleEstimate {
  int32_t source;
  double product, square;
};
ScaleEstimate height_estimate(const MetricScale& scale);
ScaleEstimate velocity_estimate(const MetricScale& scale);
ScaleEstimate estimate_of(const MetricScale& scale);

// The evidence that corresponds to an estimate read from a map's bytes, which hold the estimate
// alone, and none that was contradicted.
MetricScale scale_of(const ScaleEstimate& estimate, int32_t source, double sigma);

// After a segment became part of the tracked one: adds its evidence on the scale. One unit of that
// segment is `scale` units of the tracked one.
void join_scale(const MetricScale& other, double scale, Odometry* odometry);

// Stores the evidence on the scale of the segment `from`, and continues with that of the segment
// `to`.
void change_scale(Odometry* odometry, int32_t from, int32_t to);

// Makes the segment the one of the frames that follow: sets whether it is upright, and continues
// with its evidence on the scale.
void enter_segment(Odometry* odometry, int32_t segment);

}  // namespace tv
