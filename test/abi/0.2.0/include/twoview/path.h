/* twoview: the path of a flight, frame by frame, in the last state of the map.

   What is known of a frame's place changes after it was tracked: the map is adjusted, loops move
   it, and a frame from before the start is found once there is a map. A program that keeps a
   tv_path_frame of each frame reads the path as it is now whenever it wants to. A library that was
   built with TWOVIEW_ODOMETRY=OFF has none of these functions. */
#ifndef TWOVIEW_PATH_H
#define TWOVIEW_PATH_H

#include <stdint.h>

#include "twoview/image.h"
#include "twoview/odometry.h"
#include "twoview/status.h"

TV_BEGIN_DECLS

/* How a frame's place is known. */
typedef enum tv_path_origin {
  /* It is not. */
  TV_PATH_UNKNOWN = 0,
  /* The frame was tracked: its pose is from points of the map. */
  TV_PATH_TRACKED = 1,
  /* The frame was followed by its turn (TV_ODOMETRY_ROTATION): its position is that of the last
     frame before it that was tracked. */
  TV_PATH_TURNED = 2,
  /* It was found afterwards (tv_path_locate). */
  TV_PATH_LOCATED = 3
} tv_path_origin;

/* What is kept of a frame. The array of these, one for each frame that was tracked, in their order,
   belongs to the caller, who may also keep the last ones only, or write them to a file: they hold
   no pointer. Filled by tv_path_record. */
typedef struct tv_path_frame {
  /* The time of the exposure, in seconds. */
  double time_s;
  /* The number of the frame, from 0: how many frames were given to the odometry before it. */
  int32_t frame;
  /* A tv_path_origin. */
  int32_t origin;
  /* The id of the keyframe that the pose is relative to; -1 without a pose. */
  int32_t reference_id;
  /* Always 0. */
  int32_t reserved;
  /* The pose relative to that keyframe, as in tv_odometry_state: its length is in the unit that the
     map had when that keyframe was made. */
  double reference_from_cam_R[9], reference_from_cam_t[3];
} tv_path_frame;

/* The pose of a frame in the last state of the map. */
typedef struct tv_path_pose {
  /* A tv_path_origin; TV_PATH_UNKNOWN also where the segment of the frame was removed. */
  int32_t origin;
  /* The segment that the pose belongs to; -1 where it is not known. */
  int32_t segment;
  /* The pose world_from_cam, in the unit of the map, as in tv_odometry_state; zeros where it is not
     known. */
  double world_from_cam_R[9], world_from_cam_t[3];
} tv_path_pose;

/* Writes to *frame what is kept of a frame.
   state: what tv_odometry_track said of it. time_s: the time that was given with it.
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE (the state's), TV_ERR_NOT_FINITE (the time),
   TV_ERR_OVERLAP. Thread-safe. */
TV_API tv_status tv_path_record(const tv_odometry_state *state, double time_s,
                                tv_path_frame *frame);

/* Writes the poses of frames in the last state of the map, those as well of frames that became
   keyframes only when a later one completed a start. After a loop was closed, and after
   tv_odometry_finish, they differ from what was written before.
   frames: num_frames of them, in ascending order of their numbers. poses: room for as many.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (num_frames below 0, or the order), TV_ERR_OVERLAP. Time:
   some tenths of a microsecond a frame. */
TV_API tv_status tv_path_poses(const tv_odometry *odometry, const tv_path_frame *frames,
                               int32_t num_frames, tv_path_pose *poses);

/* Looks for a frame without a pose, or of which only the turn is known, in the finished map, by its
   picture. Where it is found beyond doubt (TV_ODOMETRY_TRACKING), in the segment that it was in if
   that is known, and not farther from the tracked frames of that segment before and after it than a
   camera at twice the segment's largest speed between two frames can have flown, frames[idx] keeps
   the pose. Else places that look alike are probable, and it stays as it is.
   frames: num_frames of them, in ascending order of their numbers. image, mask: as for
   tv_odometry_locate. *is_found: 1, or 0.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (num_frames, idx, or the order), TV_ERR_CAMERA,
   TV_ERR_STRIDE, TV_ERR_MASK, TV_ERR_OVERLAP. Time: that of tv_odometry_locate, and a pass over the
   frames. The map does not change. */
TV_API tv_status tv_path_locate(tv_odometry *odometry, tv_path_frame *frames, int32_t num_frames,
                                int32_t idx, const tv_image *image, const tv_image *mask,
                                int32_t *is_found);

TV_END_DECLS

#endif
