// The state of the odometry, which all its files work on. docs/algorithms/odometry.md.
#pragma once

#include "base/arena.h"
#include "geometry/camera.h"
#include "kernels/kernels.h"
#include "odometry/map.h"
#include "odometry/tracking_state.h"
#include "twoview/odometry.h"

namespace tv {

// What is known of a frame beside its picture; what has a sigma of 0 is not known.
struct Sensors {
  double world_from_cam[9], attitude_sigma_rad;
  double height_m, height_sigma_m;
  double velocity_m_s[3], velocity_sigma_m_s;
};

// A frame: its keypoints, and the points of the map that they see.
struct Frame {
  tv_keypoint* keypoints;
  uint8_t* descriptors;
  int32_t* points;     // for each keypoint, or kNoPoint
  int32_t* distances;  // of its descriptor to that of the point, squared
  float* sigmas;       // of its pixel, relative to that of a keypoint of the finest level
  uint8_t* greys;      // of the pixel next to it
  int32_t num;
  int32_t* cell_starts;  // of each cell of the grid, into cell_items; one more at the end
  int32_t* cell_items;
  int32_t number;  // how many frames were given before it
  double time_s;
  int32_t next_try;  // while it waits for a second view: the first frame to match it with
  bool has_pose;
  Rigid cam_from_world;
  Sensors sensors;
};

inline constexpr int32_t kMostPairs = 3;  // that a keyframe is checked with

// What pairs of a keyframe with earlier ones said of their relative poses (odometry/map_check.h).
struct MapVote {
  int32_t num_pairs, num_agree, num_disagree, num_planar;
};

// The check of the newest keyframe: its pairs from other_ids[next] on are still to be estimated.
struct MapCheck {
  int32_t keyframe_id;
  int32_t other_ids[kMostPairs - 1];
  int32_t num_others, next;
  int32_t num_unconfirmed;  // keyframes in a row before this one that no pair confirmed
  MapVote vote;
};

// The newest keyframe, as long as its points are not all made and its surroundings not adjusted.
struct UnfinishedKeyframe {
  int32_t id;              // -1: it is adjusted
  int32_t next_neighbour;  // the first one with which no points were made yet
  bool closed_loop;
};

// A piece of work that waits until a frame has time for it, the first ones first.
enum class Work : int32_t {
  kNone,
  kFinishKeyframe,  // the newest one's other points, and the adjustment around it
  kStepSpread,  // a part of what a loop, or a correction of the camera, left (odometry/spread.h)
};

// A frame that seems to close a loop, but with few points: its pose as tracked, and its pose as
// found at the other end of the loop.
struct WeakLoop {
  int32_t frame;  // its number; -1: there is none
  Rigid cam_from_world, end_from_world;
};

// What is left to do after a loop or a correction of the camera, a part at each frame that has no
// keyframe to adjust.
struct Spread {
  int32_t num_steps;   // how many steps of many keyframes together are left
  int32_t next_place;  // after these: the place of the first point that is not adjusted yet
  int32_t segment;     // the segment that is adjusted
  int32_t first_id;    // the id of the first keyframe that the steps adjust
  int32_t last_id;     // the id of the newest keyframe when the steps began
};

// The way since a frame in metres, in the world's axes, as the velocities say.
struct Travel {
  bool is_known;
  int32_t keyframe_id;  // the keyframe that it began at; -1: a frame that is no keyframe
  double from[3];       // the camera's centre where it began
  double way_m[3], variance;
  double bound_m;    // its standard deviation if all errors are equal
  bool is_contrary;  // the map's way to some frame since then contradicted it
};

// What the sensors say of a frame: the turn from the map's axes to those of its attitude, which
// stays the same (sigma 0: the attitude is not known), and the longest way that the camera may have
// gone until then, in metres, since the odometry began.
struct Reach {
  Rigid axes;
  double attitude_sigma_rad;
  double most_m;
};

// The evidence of pairs of keyframes about the principal point: the normal equation of its shift in
// pixels, information shift = product, and the sum of the pairs' own squared shifts in that metric.
struct CameraEvidence {
  int32_t num_pairs;
  int32_t next_num;  // how many pairs the next move needs; 0: it was not moved yet
  double information[3], product[2], square;
};

// What one kind of sensor says of the scale, metres per unit of the map: the normal equation square
// scale = product of its ways' components beside the map's, the share of `square` that the errors
// of the map's ways have, the sum of the squares of its own, all in units of its variances, and how
// many components these are.
struct ScaleEvidence {
  double product, square, noise, total, num;
};

struct MetricScale {
  int32_t source;         // tv_scale_source
  int32_t loaded_source;  // the source of the scale in a map that was loaded
  bool is_contradicted;   // heights and velocities contradict each other
  bool was_known;         // the metre is or has been the unit of the segment
  // loaded: the evidence from a loaded map. height, velocity: `loaded` and the sums over the ways
  // between keyframes, as heights and as velocities measure them. contrary: the sum over the ways
  // whose velocities contradict the map; they are left out as long as the other ways count more.
  ScaleEvidence loaded, height, velocity, contrary;
  double sigma;  // relative; 0 where the source is TV_SCALE_UNIT
};

// The offset of a gyro's rates before it was measured, in radians per second: small MEMS gyros are
// specified up to 5 degrees per second after their own calibration.
inline constexpr double kGyroBiasSigma = 0.09;

// What a gyro says beyond the last frame with a pose (odometry/gyro.h).
struct Gyro {
  bool is_held;
  Rigid cam_from_world;  // of the newest frame: turned by the gyro, moved by the velocities
  double turn_variance;  // of each component of its turn since that frame
  double seconds;        // since that frame
  // The constant offset of the rates, on the camera's axes in radians per second, and the variance
  // of each component.
  double bias[3], bias_variance;
};

// A cell of the picture: the number of the first frame in which it is looked into again, and how
// many times it was found to stand still (odometry/still_cells.h).
struct StillCell {
  int32_t until, num_times;
};

inline constexpr int32_t kCellPx = 16, kStillCellPx = 8;
// The error of a pixel of sigma 1 along one axis before one was measured, and the largest one that
// a point of the map may have, in pixels.
inline constexpr double kTypicalNoise = 0.7, kLargestError = 3.0;
// The least angle between the rays to a new point, in radians, for pixels of sigma 1.
inline constexpr double kLeastAngle = 0.006;
inline constexpr int kNumStarts = 4;  // frames that wait for a second view

}  // namespace tv

struct tv_odometry {
  tv_odometry_options options;
  tv_camera given_camera;
  tv::Camera camera;  // the same, with another principal point where it was moved
  tv::CameraEvidence camera_evidence;
  tv_context* context;  // of the stages that a frame takes through the public functions
  const tvk_set* kernels;
  int32_t max_matched;  // the most descriptors on either side of a call of the matcher
  tv_feature_options features;
  tv::Map map;
  tv::Arena scratch;
  tv::Arena whole_scratch;  // the context's and `scratch` as one, for when neither is in use
  int32_t grid_columns, grid_rows;
  tv::Frame frame, previous;
  tv::Frame starts[tv::kNumStarts];
  tv::StillCell* still_cells;
  int32_t still_columns, still_rows;
  int32_t still_until;  // the largest `until` of these cells
  int32_t num_starts;
  // The points that are looked for in the next frame: those around the reference keyframe.
  int32_t* local_points;
  int32_t num_local_points;
  int32_t reference_id;
  // The motion from the frame before last to the last: cam_from_cam, in motion_s seconds.
  bool has_motion;
  tv::Rigid motion;
  double motion_s;
  int32_t segment;
  // These follow each other in a map's bytes, too.
  int32_t num_frames, num_segments, num_relocations, num_loops;
  tv::Tracking tracking;
  tv::Gyro gyro;
  int32_t next_search;  // the number of the keyframe from which a lost frame is looked for next
  int32_t next_loop;    // one more than that of the keyframe in which a loop is looked for next
  int32_t keyframe_inliers;  // how many points the last keyframe saw when it was adjusted
  bool was_moved_far;        // its adjustment was a jump, since the last tracked frame
  bool is_found_again;       // a lost frame was, and no loop has closed since
  tv::WeakLoop weak_loop;
  tv::UnfinishedKeyframe unfinished;
  tv::Spread spread;
  tv::MapCheck check;
  tv::Work done;  // before this frame was tracked
  // The last keyframe that its own matches with earlier ones confirmed. Doubts: the tv_map_reason
  // of the frames of a segment since some saw one plane only, or contradicted the map, or since it
  // began.
  int32_t confirmed_id;
  uint32_t doubts;
  int32_t doubtful_segment;
  tv::Reach confirmed;  // what the sensors said when it was confirmed
  double most_m;        // the longest way that the camera may have gone until now, in metres
  double median_depth;
  double turn_sigma;  // the largest standard deviation of the frame's attitude, in radians
  double drift_sq;    // sum of its squares, of the keyframes since the start or the last loop
  double last_time_s;
  bool is_upright;  // the segment's z axis points along gravity
  tv::Travel travel;
  // velocity_trust: how many ways between keyframes the velocities agreed with; a quarter is taken
  // off whenever the velocities have caused a removal. num_contrary: how many frames in a row have
  // contradicted the velocities since these are trusted.
  int32_t velocity_trust, num_contrary;
  tv::MetricScale scale;
  // What is known of another segment's scale.
  tv::MetricScale other_scale;
  int32_t other_segment;
};

namespace tv {

using Odometry = tv_odometry;

// Forgets the map and every frame.
void start_anew(Odometry* odometry);

}  // namespace tv
