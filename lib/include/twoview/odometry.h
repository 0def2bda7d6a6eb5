/* twoview: visual odometry, from the frames of one camera to its path and a map of points.

   This header includes those of its pieces, which are useful alone: tv_estimate_absolute_pose and
   tv_adjust_window. A library that was built with TWOVIEW_ODOMETRY=OFF has none of these functions:
   a program that calls one does not link. How it works and what it cannot do: docs/odometry.md. */
#ifndef TWOVIEW_ODOMETRY_H
#define TWOVIEW_ODOMETRY_H

#include <stddef.h>
#include <stdint.h>

#include "twoview/absolute_pose.h"
#include "twoview/camera.h"
#include "twoview/context.h"
#include "twoview/image.h"
#include "twoview/two_view.h"
#include "twoview/window.h"

TV_BEGIN_DECLS

/* The odometry of one camera: its map, and the memory that it works in. One thread uses it at a
   time. */
typedef struct tv_odometry tv_odometry;

/* What is known of a frame's pose. */
typedef enum tv_odometry_status {
  /* There is no map yet: the frames so far do not determine one. The pose is not known. */
  TV_ODOMETRY_STARTING = 0,
  /* The pose was estimated from points of the map, and nothing is evidence against it. */
  TV_ODOMETRY_TRACKING = 1,
  /* The pose was estimated, and `reasons` says why it may be wrong. */
  TV_ODOMETRY_WEAK = 2,
  /* The camera turned to where the map has too few points: the attitude was estimated from the
     frame before, and the position is that of the last frame in which it was known. */
  TV_ODOMETRY_ROTATION = 3,
  /* The frame fits neither the map nor the frame before it. The pose is not known. */
  TV_ODOMETRY_LOST = 4
} tv_odometry_status;

/* How many values tv_odometry_status has. */
#define TV_ODOMETRY_NUM_STATUSES 5

/* Returns "starting", "tracking", "weak", "rotation" or "lost", or "unknown" for any other number.
   The string is constant and never freed. Thread-safe. */
TV_API const char *tv_odometry_status_string(tv_odometry_status status);

/* What the odometry has against its own map, and so against the pose of a frame, and what a program
   that flies by the poses does about it. With each of them but for UNSURE_ATTITUDE the position is
   not to be flown by as long as it lasts: hold the height and the attitude by the vehicle's own
   sensors. The values are bits of tv_odometry_state.map_reasons. */
typedef enum tv_map_reason {
  /* Nothing has confirmed the two keyframes yet that the segment began with, or the last four
     keyframes. What to do: move on slowly and sideways, with texture in view, until the next
     keyframes agree with earlier ones. */
  TV_MAP_REASON_UNCONFIRMED = 1 << 0,
  /* Pairs of keyframes, or the velocities, contradicted the map. In that frame the pose was lost
     and what was made since the last confirmed keyframe was removed; the frames that follow have
     this reason until a keyframe is confirmed. What to do: discard the poses of the frames since
     that keyframe, stop, and turn back to what was in view before. */
  TV_MAP_REASON_CONTRADICTED = 1 << 1,
  /* Pairs of keyframes see one plane, which two motions explain. What to do: bring into view what
     lies off that plane, or move along it until a pair tells the two motions apart. */
  TV_MAP_REASON_ONE_PLANE = 1 << 2,
  /* A loop at this frame, or the map's adjustment since the frame before, moved the camera by 3 per
     cent of the path or by 0.05 radians: the path jumps here, in this frame alone. What to do: take
     no velocity from the two frames; begin a filter's position anew at this one, and read earlier
     positions that are still in use again (tv_odometry_pose_of). */
  TV_MAP_REASON_JUMPED = 1 << 3,
  /* The attitudes of the keyframes since the segment began, or its last loop closed, are uncertain
     by 1.5 degrees together. What to do: take the heading from elsewhere, and return to a place
     that was seen before, so that a loop closes; short ways from frame to frame remain right. */
  TV_MAP_REASON_UNSURE_ATTITUDE = 1 << 4,
  /* The camera moved otherwise in the map than the velocities say: the map may follow something
     that moves. Where it goes on, the pose is lost and what was made since the last confirmed
     keyframe is removed. What to do: fly by the velocities, and turn the camera to what stands
     still. */
  TV_MAP_REASON_VELOCITIES_DISAGREE = 1 << 5
} tv_map_reason;

/* Where the unit of a map's lengths comes from. */
typedef enum tv_scale_source {
  /* Nothing metric is known: the first two keyframes are at the distance 1. */
  TV_SCALE_UNIT = 0,
  /* The heights above the ground. */
  TV_SCALE_HEIGHT = 1,
  /* The velocities. */
  TV_SCALE_VELOCITY = 2,
  /* Heights and velocities. */
  TV_SCALE_HEIGHT_AND_VELOCITY = 3
} tv_scale_source;

/* What the odometry is made for: the memory that it takes, and how it works. Filled by
   tv_odometry_options_init; change fields before tv_odometry_size. */
typedef struct tv_odometry_options {
  /* The caller's sizeof, set by tv_odometry_options_init. */
  uint32_t struct_size;
  /* The most keypoints of a frame, [100, 4096], default 1000. More keypoints are tracked more
     reliably, and take more time. */
  int32_t max_keypoints;
  /* The most keyframes of the map, [8, 2000], default 200. When the map is full, the keyframe that
     its neighbours make most nearly redundant is removed. */
  int32_t max_keyframes;
  /* The most points of the map, [500, 200000], default 20000. */
  int32_t max_points;
  /* How many keyframes are adjusted together, [3, 20], default 10. */
  int32_t window;
  /* A tv_kernels, default TV_KERNELS_AUTO. */
  int32_t kernels;
  /* The seed of every sampler. Its default is constant and never the time of day: equal frames give
     equal bytes. */
  uint64_t seed;
  /* What of the camera may be refined, TV_REFINE_ bits. TV_REFINE_PRINCIPAL_POINT (default): the
     principal point is moved where many pairs of keyframes agree that it lies elsewhere, by at most
     5 per cent of the focal length; that needs no standard deviation. TV_REFINE_NOTHING: the camera
     is kept as it was given. Any other bit is TV_ERR_ARGUMENT. */
  uint32_t refine;
  /* Must be 0. */
  int32_t reserved;
} tv_odometry_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_odometry_options_init. */
TV_API void tv_odometry_options_init_sized(tv_odometry_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_odometry_options_init(options) \
  tv_odometry_options_init_sized((options), sizeof *(options))

/* A frame, and what other sensors say of the camera at its time. Filled by tv_odometry_frame_init
   with zeros: nothing else is known. */
typedef struct tv_odometry_frame {
  /* The caller's sizeof, set by tv_odometry_frame_init. */
  uint32_t struct_size;
  /* 1: frames are missing between the one before and this one, or the stream began anew, perhaps
     with its clock; else 0. The motion from frame to frame is then not predicted. */
  int32_t gap;
  /* The picture, of the camera's size. Its pixels are read during the call only. */
  tv_image image;
  /* The time of the exposure in seconds, from any moment. Later than that of the frame before where
     gap is 0; with gap 1 any time: one that is not later says that the clock began anew. */
  double time_s;
  /* The camera's attitude as the vehicle measures it, the row-major rotation world_from_cam, in a
     world whose z axis points down. Read only where attitude_sigma_rad is above 0. */
  double world_from_cam[9];
  /* The standard deviation in radians of the direction of gravity that this attitude gives; 0
     (default): there is no attitude. */
  double attitude_sigma_rad;
  /* The height of the camera above the ground in metres, and its standard deviation, 0 (default):
     there is no height. The ground is taken as level from frame to frame of a window. */
  double height_m, height_sigma_m;
  /* The camera's velocity over ground in metres per second, along the axes of the camera, and the
     standard deviation of each component; 0 (default): there is no velocity. Once velocities have
     agreed with the map, they also check it. */
  double velocity_m_s[3], velocity_sigma_m_s;
  /* Which pixels show the scene: an image of the size of `image`, whose bytes are 0 where the
     picture is left out (drone's legs, text, a border) and anything else where it is used; only
     corners on a used pixel are kept. Null data (default): all of the picture is used. Its pixels
     are read during the call only. */
  tv_image mask;
  /* How the camera turned since the frame before, as a gyro measured it (tv_integrate_gyro): the
     row-major rotation previous_from_cam, and the standard deviation of each component of its error
     in radians, without that of a constant offset of the rates, which the odometry estimates; 0
     (default): there is no turn. With a turn at each frame, also of those whose picture shows
     nothing, fast turns are followed, and frames without usable picture have the attitude that the
     gyro gives (TV_ODOMETRY_ROTATION). */
  double previous_from_cam[9], turn_sigma_rad;
} tv_odometry_frame;

/* Writes zeros, and the size, into a struct of struct_size bytes; null is allowed. Programs call
   tv_odometry_frame_init. */
TV_API void tv_odometry_frame_init_sized(tv_odometry_frame *frame, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_odometry_frame_init(frame) tv_odometry_frame_init_sized((frame), sizeof *(frame))

/* What a gyro measured at one time. The layout never changes. */
typedef struct tv_gyro_sample {
  /* The time in seconds, by the clock of the frames. */
  double time_s;
  /* The rates of turn about the camera's axes (x right, y down, z ahead), in radians per second. */
  double rate_rad_s[3];
} tv_gyro_sample;

/* Integrates a gyro's rates over the time from begin_s to end_s, that of a frame and of the next
   one: the turn that tv_odometry_frame takes.
   samples: num of rising times, at least two; the first at begin_s or earlier, the last at end_s or
   later. Between two samples the rate is linear. sigma_rad_s: the standard deviation of the white
   noise of each component of a sample.
   previous_from_cam, turn_sigma_rad: the rotation from the camera at end_s to that at begin_s,
   row-major, and the standard deviation of each component of its error, equal on all axes.
   Returns TV_ERR_NULL, TV_ERR_NOT_FINITE, TV_ERR_ARGUMENT (num, sigma_rad_s below 0, a rate above
   1000 rad/s), TV_ERR_TIME (times that do not rise, or samples that do not reach from begin_s to
   end_s); nothing is written then. Time: the samples within, and a pass over all. Thread-safe.
   S. Blanes, F. Casas, J. A. Oteo and J. Ros, "The Magnus expansion and some of its applications",
   2009 (fourth order). */
TV_API tv_status tv_integrate_gyro(const tv_gyro_sample *samples, int32_t num, double sigma_rad_s,
                                   double begin_s, double end_s, double previous_from_cam[9],
                                   double *turn_sigma_rad);

/* What is known after a frame. */
typedef struct tv_odometry_state {
  /* The caller's sizeof, set by tv_odometry_state_init. */
  uint32_t struct_size;
  /* A tv_odometry_status. */
  int32_t status;
  /* The bits of tv_reason that make the frame weak, or that keep the map from starting. Those of
     the frame's own matches are as in tv_absolute_pose.reasons and tv_two_view.reasons, and a frame
     whose attitude alone is known has TV_REASON_PURE_ROTATION. map_reasons adds
     TV_REASON_LOW_PARALLAX (unconfirmed, jumped, unsure attitude), TV_REASON_TWO_PLANAR_SOLUTIONS
     (contradicted, one plane) and TV_REASON_SECOND_MOTION (velocities disagree). */
  uint32_t reasons;
  /* Which segment the pose belongs to, from 0; -1 where no pose is known. A segment is a stretch
     within one frame of coordinates: poses of different segments do not compare. */
  int32_t segment;
  /* 1 where the frame became a keyframe, else 0. */
  uint8_t is_keyframe;
  /* 1 where the pose was found again after frames without one, by matching with the whole map. */
  uint8_t relocated;
  /* 1 where a loop was closed at this frame: the keyframes moved. */
  uint8_t loop_closed;
  /* 1 where world_from_cam and the fields up to cam_from_world_covariance hold a pose; else they
     are 0. */
  uint8_t has_pose;
  /* 1 where cam_from_world_covariance was estimated. */
  uint8_t has_covariance;
  /* 1 where the frame's attitude contradicts the map's vertical and was left out of account. */
  uint8_t attitude_ignored;
  /* Always 0. */
  uint8_t reserved[2];
  /* How many frames were given so far, this one included. */
  int32_t num_frames;
  /* How many keypoints the frame has. */
  int32_t num_keypoints;
  /* How many of them were matched with points of the map, and how many are inliers of the pose. */
  int32_t num_matches, num_inliers;
  /* How many keyframes and points the map has, over all segments. */
  int32_t num_keyframes, num_points;
  /* How many segments were begun, how many poses were found again, and how many loops were closed,
     since the start. */
  int32_t num_segments, num_relocations, num_loops;
  /* The id of the keyframe that the pose is relative to, -1 without a pose; see
     tv_odometry_pose_of. */
  int32_t reference_id;
  /* The pose relative to that keyframe: a point X of the frame's camera is R X + t in the
     keyframe's camera; row-major. */
  double reference_from_cam_R[9], reference_from_cam_t[3];
  /* The pose world_from_cam: a point X of the camera's frame is R X + t in the world, in the unit
     of the map; row-major. The world is the camera's frame at the segment's first keyframe, or,
     where attitudes were given, upright: with its z axis along gravity. */
  double world_from_cam_R[9], world_from_cam_t[3];
  /* The covariance of cam_from_world, the inverse of the pose above, as this frame alone determines
     it from the points of the map, in the parameters of tv_absolute_pose.covariance: x_true =
     exp([w]x) x + d for a point x in the frame of the camera; row-major 6x6. */
  double cam_from_world_covariance[36];
  /* The standard deviation of a pixel of sigma 1 along one axis, in pixels. */
  double noise_px;
  /* A tv_scale_source. */
  int32_t scale_source;
  /* 1 where heights and velocities contradict each other: the lengths that they give the map differ
     by more than chance allows in 99 of 100 cases, by their standard deviations and how well each
     fits the map. Nobody knows then which of them is wrong: scale_source is TV_SCALE_UNIT, also in
     a map that was in metres, until they agree again. */
  int32_t scale_contradicted;
  /* The standard deviation of the scale, relative to it; 0 where scale_source is TV_SCALE_UNIT. */
  double scale_sigma;
  /* By how far the principal point was moved from where it was given, in pixels (x, y): zeros where
     the camera was not corrected. When it moves, all keyframes turn by about the shift over the
     focal length, and the path and the map are adjusted in the frames that follow. */
  double principal_point_shift_px[2];
  /* The metres of one unit of the segment as heights alone and velocities alone say, each with its
     standard deviation: about 1 in a map in metres; zeros where nothing is known, or where it was
     saved with the map, which does not keep the two sensors apart. */
  double height_scale, height_scale_sigma, velocity_scale, velocity_scale_sigma;
  /* The share of the picture, [0, 1], that was found to stand still while the scene moves
     (on-screen text, a frame, a watermark, the vehicle's own legs), and of which the next frame
     takes no keypoints: tv_odometry_still_mask. */
  double still_share;
  /* The tv_map_reason bits of a frame that is weak or lost: what the odometry has against its map.
     0 where all reasons are of the frame's own matches, and of tv_odometry_locate. */
  uint32_t map_reasons;
  /* Always 0. */
  uint32_t reserved_end;
} tv_odometry_state;

/* Writes zeros, and the size, into a struct of struct_size bytes; null is allowed. Programs call
   tv_odometry_state_init. */
TV_API void tv_odometry_state_init_sized(tv_odometry_state *state, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_odometry_state_init(state) tv_odometry_state_init_sized((state), sizeof *(state))

/* Writes to *size_bytes how much memory the odometry of this camera with these options needs. The
   number depends on the image's size, the options and the library's version, and not on the CPU.
   options: null means the defaults.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_CAMERA, TV_ERR_ARGUMENT (an option, or an image
   that is smaller than 32 or larger than 16384 pixels). */
TV_API tv_status tv_odometry_size(const tv_camera *camera, const tv_odometry_options *options,
                                  size_t *size_bytes);

/* Makes an odometry without a map in `memory` of size_bytes bytes and writes a pointer to it to
   *odometry.
   memory: starts at a multiple of TV_CONTEXT_ALIGNMENT and is at least as large as tv_odometry_size
   reports. The caller owns it, does not move it, and frees it after the last call.
   Returns the statuses as tv_odometry_size does, and TV_ERR_ALIGNMENT, TV_ERR_MEMORY,
   TV_ERR_KERNELS. */
TV_API tv_status tv_odometry_init(tv_odometry **odometry, const tv_camera *camera,
                                  const tv_odometry_options *options, void *memory,
                                  size_t size_bytes);

/* Forgets the map and every frame: afterwards the odometry is as tv_odometry_init made it. Returns
   TV_ERR_NULL. */
TV_API tv_status tv_odometry_reset(tv_odometry *odometry);

/* Tracks a frame, and extends the map. A frame that becomes a keyframe (is_keyframe) is adjusted
   with its surroundings at the beginning of the next call, so that no call takes the time of both;
   until then the map holds it as it was tracked.
   frame: initialised by tv_odometry_frame_init. An attitude, a height or a velocity that is not
   finite, and an attitude that is not a rotation, are left out of account; the call succeeds.
   state: initialised by tv_odometry_state_init. That the pose is not known is TV_OK, and reported
   in status.
   Each status names one argument: TV_ERR_NULL (a pointer, or that of the image's pixels),
   TV_ERR_STRUCT_SIZE, TV_ERR_CAMERA (the image is not of the camera's size), TV_ERR_STRIDE (the
   image's), TV_ERR_MASK (the mask is not of the image's size), TV_ERR_NOT_FINITE (the time),
   TV_ERR_ARGUMENT (gap is neither 0 nor 1), TV_ERR_TIME (gap is 0, and the time is not later than
   that of the frame before), TV_ERR_OVERLAP (the state is written over the frame or its pixels).
   With each of these the odometry is as before.
   Time: bounded by the options. Memory: the odometry's own. Equal frames give equal bytes on every
   CPU. */
TV_API tv_status tv_odometry_track(tv_odometry *odometry, const tv_odometry_frame *frame,
                                   tv_odometry_state *state);

/* Writes the camera as the odometry uses it now: the one that was given, with another principal
   point where it was corrected. Keyframes, points and the map's bytes are consistent with it.
   Returns TV_ERR_NULL. */
TV_API tv_status tv_odometry_camera(const tv_odometry *odometry, tv_camera *camera);

/* Writes which pixels the next frame takes keypoints from as far as the odometry itself has found
   out: 255, or 0 in cells of 8 x 8 pixels in which matches kept their pixel where no point of the
   scene could (tv_two_view.num_still). After at least 300 frames such a cell is looked into again.
   mask: room for width x height bytes, row by row. Returns TV_ERR_NULL, TV_ERR_CAPACITY (cap_bytes
   is less). */
TV_API tv_status tv_odometry_still_mask(const tv_odometry *odometry, uint8_t *mask,
                                        size_t cap_bytes);

/* Does what tracking left for the frames to come: the adjustment of the newest keyframe, and, after
   a closed loop, that of the rest of the map. To be called after the last frame, before poses,
   keyframes, points or the map's bytes are read. Frames may follow all the same; without such work
   the map stays as it is.
   Returns TV_ERR_NULL. Time: bounded by the options; after a loop some tenths of a second. */
TV_API tv_status tv_odometry_finish(tv_odometry *odometry);

/* Estimates the pose of a frame from the map as it is, without changing it: for a frame from before
   the map began, or of another flight.
   image, mask: as of tv_odometry_frame; a null mask leaves nothing out. near_id: the id of a
   keyframe whose surroundings are searched first; -1: no such hint. state: as for
   tv_odometry_track; its status is TV_ODOMETRY_TRACKING, TV_ODOMETRY_WEAK or TV_ODOMETRY_LOST, and
   its scale that of the segment which is tracked. The frames that follow are tracked as if this one
   had not been looked for. Places may look alike, as on a wall with a pattern: where the frame has
   neighbours, the caller compares their poses with this one.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_CAMERA, TV_ERR_STRIDE, TV_ERR_MASK,
   TV_ERR_OVERLAP. */
TV_API tv_status tv_odometry_locate(tv_odometry *odometry, const tv_image *image,
                                    const tv_image *mask, int32_t near_id,
                                    tv_odometry_state *state);

/* Writes the pose world_from_cam of a frame in the last state of the map, from what
   tv_odometry_state said of the frame when it was tracked: reference_id, reference_from_cam_R and
   reference_from_cam_t. The keyframe may have been removed from the map since.
   R: room for 9 numbers, row-major; t: room for 3. segment: null, or receives the segment.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (no keyframe has had this id, or no keyframe is left of its
   segment, or it was removed, and more than 16 times the option max_keyframes since then),
   TV_ERR_OVERLAP. */
TV_API tv_status tv_odometry_pose_of(const tv_odometry *odometry, int32_t reference_id,
                                     const double reference_from_cam_R[9],
                                     const double reference_from_cam_t[3], double R[9], double t[3],
                                     int32_t *segment);

/* A keyframe of the map. */
typedef struct tv_keyframe {
  /* The caller's sizeof, set by tv_keyframe_init. */
  uint32_t struct_size;
  /* The number of the keyframe: keyframes are numbered from 0 in the order in which they were made,
     those included that were removed since. */
  int32_t id;
  /* Its segment. */
  int32_t segment;
  /* The number of its frame, from 0: how many frames were given before it. */
  int32_t frame;
  /* The time of its frame, in seconds. */
  double time_s;
  /* The pose world_from_cam in the unit of the map, as in tv_odometry_state. */
  double world_from_cam_R[9], world_from_cam_t[3];
  /* How many keypoints the keyframe has, and how many of them see points of the map. */
  int32_t num_keypoints, num_observations;
} tv_keyframe;

/* Writes zeros, and the size, into a struct of struct_size bytes; null is allowed. Programs call
   tv_keyframe_init. */
TV_API void tv_keyframe_init_sized(tv_keyframe *keyframe, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_keyframe_init(keyframe) tv_keyframe_init_sized((keyframe), sizeof *(keyframe))

/* Writes the keyframe number idx of the map, [0, num_keyframes), in the order of their ids. Returns
   TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (idx). */
TV_API tv_status tv_odometry_keyframe(const tv_odometry *odometry, int32_t idx,
                                      tv_keyframe *keyframe);

/* Estimates the covariance of the pose of the keyframe number idx relative to the keyframe before
   it, from the keyframes around both and the points that they see: marginal over these
   (tv_adjust_window), four times as large as for independent errors of the keypoints, and with a
   drift of the map's scale of 1.5 % (docs/odometry.md has the measurements). covariance: room for a
   row-major 6x6, in the parameters (w, v) with x_true = exp([w]x) x + v for a point x in the frame
   of the camera, in radians and units of the map; zeros where it is not known. is_known: 1, or 0
   where the keyframe is the first of its segment, shares too few points with the one before, or
   where these do not determine the pose. Returns TV_ERR_NULL, TV_ERR_ARGUMENT (idx),
   TV_ERR_OVERLAP. Time: about that of an adjustment. The map does not change. */
TV_API tv_status tv_odometry_covariance(tv_odometry *odometry, int32_t idx, double covariance[36],
                                        int32_t *is_known);

/* A point of the map. */
typedef struct tv_map_point {
  /* The number of the point, in the order in which they were made. */
  int32_t id;
  /* Its segment. */
  int32_t segment;
  /* How many keyframes see it. */
  int32_t num_observations;
  /* Its brightness in grey levels, [0, 255], where it was last seen. */
  int32_t grey;
  /* The position in the world, in the unit of the map. */
  double position[3];
  /* The covariance of the position, row-major symmetric 3x3, for exact poses of the keyframes:
     along the ray from where it was first seen the uncertainty of its distance, from the largest
     angle between two rays to it; across the ray that of one pixel; for a pixel's error of 0.7 px.
   */
  double covariance[9];
} tv_map_point;

/* Writes the points of the map, in the order of their ids.
   points: room for cap_points; the options' max_points is always enough. *num_points: how many were
   written; on TV_ERR_CAPACITY how many there are.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_CAPACITY, TV_ERR_OVERLAP. */
TV_API tv_status tv_odometry_points(const tv_odometry *odometry, tv_map_point *points,
                                    int32_t cap_points, int32_t *num_points);

/* A pixel at which a keyframe sees a point. */
typedef struct tv_map_observation {
  /* The index of the point in the array of tv_odometry_points, and of the keypoint among those of
     the keyframe. */
  int32_t idx_point, idx_keypoint;
  /* The pixel, distorted as in the image, and its standard deviation relative to that of a keypoint
     of the finest level. */
  float x, y, sigma;
  /* Always 0. */
  int32_t reserved;
} tv_map_observation;

/* Writes what the keyframe number idx sees, in ascending order of idx_keypoint.
   observations: room for cap_observations; max_keypoints is always enough. *num_observations: how
   many were written; on TV_ERR_CAPACITY how many there are.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_CAPACITY, TV_ERR_OVERLAP. */
TV_API tv_status tv_odometry_observations(const tv_odometry *odometry, int32_t idx,
                                          tv_map_observation *observations,
                                          int32_t cap_observations, int32_t *num_observations);

/* The frame's observations of the last call of tv_odometry_track: which points of the map the frame
   sees. observations and statuses as for tv_odometry_observations; idx_point is -1 for a keypoint
   that sees no point, and every keypoint of the frame is written. */
TV_API tv_status tv_odometry_last_frame(const tv_odometry *odometry,
                                        tv_map_observation *observations, int32_t cap_observations,
                                        int32_t *num_observations);

/* Writes to *size_bytes how many bytes tv_odometry_save writes now. Returns TV_ERR_NULL. */
TV_API tv_status tv_odometry_save_size(const tv_odometry *odometry, size_t *size_bytes);

/* Writes the map as bytes: little-endian, with a version and a checksum, equal on every CPU
   (docs/formats.md). bytes: room for cap_bytes. *num_bytes: how many were written; on
   TV_ERR_CAPACITY how many there are. Returns TV_ERR_NULL, TV_ERR_CAPACITY, TV_ERR_OVERLAP. */
TV_API tv_status tv_odometry_save(const tv_odometry *odometry, uint8_t *bytes, size_t cap_bytes,
                                  size_t *num_bytes);

/* Replaces the map by one that tv_odometry_save wrote. The frames that follow are looked for in the
   whole map, as after a loss; their times may begin anew, and num_frames and the other counts of
   tv_odometry_state go on from those of the map.
   bytes: num_bytes bytes, read during the call only.
   Returns TV_ERR_NULL, TV_ERR_MAP (the bytes are no map, are cut or altered, or are of a version
   that this library does not know), TV_ERR_CAMERA (the map is of another camera), TV_ERR_LIMITS
   (the map is larger than the options allow). With each of these the odometry is as before. */
TV_API tv_status tv_odometry_load(tv_odometry *odometry, const uint8_t *bytes, size_t num_bytes);

/* Adds a map of the same camera to the one that is there: its keyframes and points follow, as
   segments of their own with numbers and ids after those that exist. Then each of its segments is
   looked for in the former keyframes, and becomes part of the segment that it meets, in its unit
   and frame of coordinates. The time grows with the product of both numbers of keyframes, about a
   quarter of a millisecond for each pair. The frames that follow are looked for in all of it, as
   after tv_odometry_load.
   bytes: num_bytes bytes, read during the call only. *num_joined: how many segments have met a
   former one.
   Returns TV_ERR_NULL, TV_ERR_MAP, TV_ERR_CAMERA and TV_ERR_LIMITS as tv_odometry_load does, and
   TV_ERR_OVERLAP. With each of these the odometry is as before. */
TV_API tv_status tv_odometry_add(tv_odometry *odometry, const uint8_t *bytes, size_t num_bytes,
                                 int32_t *num_joined);

/* Gives the odometry a clock, so that it measures the time of each stage. The clock is called with
   the pointer `user` from within tv_odometry_track, tv_odometry_locate, tv_odometry_finish and
   tv_odometry_add; both stay valid as long as the odometry is used. A null now_ns removes the
   clock. Returns TV_ERR_NULL. */
TV_API tv_status tv_odometry_set_clock(tv_odometry *odometry, tv_clock now_ns, void *user);

/* Writes the nanoseconds spent in each tv_stage since the previous call of this function, as
   tv_context_take_times does. stage_ns: room for cap_stages numbers. Returns TV_ERR_NULL,
   TV_ERR_ARGUMENT (cap_stages below 0). */
TV_API tv_status tv_odometry_take_times(tv_odometry *odometry, uint64_t *stage_ns,
                                        int32_t cap_stages);

TV_END_DECLS

#endif
