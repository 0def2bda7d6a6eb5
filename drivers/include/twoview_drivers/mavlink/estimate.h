/* twoview drivers: what visual odometry knows, as the messages that an autopilot's filter fuses:
   ODOMETRY and VISION_POSITION_ESTIMATE.

   tvm_estimator_update turns what tv_odometry_track says of a frame into an estimate, or into the
   reason why there is none: only a pose in metres, in a world whose z axis points down, is sent. A
   lost frame, one whose position was held ("rotation") and a path without a metre give nothing, and
   tvm_session_send_track tells the ground station so by a STATUSTEXT. None of these messages
   steers. docs/mavlink.md has the frames, the covariances and the set-up of PX4 and ArduPilot. */
#ifndef TWOVIEW_DRIVERS_MAVLINK_ESTIMATE_H
#define TWOVIEW_DRIVERS_MAVLINK_ESTIMATE_H

#include "twoview/odometry.h"
#include "twoview_drivers/mavlink/session.h"

TV_BEGIN_DECLS

/* The component id of visual-inertial odometry (MAV_COMP_ID_VISUAL_INERTIAL_ODOMETRY):
   tvm_session_options.own_component for a session that sends estimates. */
#define TVM_COMPONENT_ODOMETRY 197

/* The bytes that hold any packet of this header. */
#define TVM_MAX_PACKET_BYTES 280

/* The bits of tvm_estimator_options.messages. */
enum {
  /* ODOMETRY (331): position, attitude, velocity and angular rate, and both covariances. */
  TVM_SEND_ODOMETRY = 1,
  /* VISION_POSITION_ESTIMATE (102): position and attitude, and their covariance. */
  TVM_SEND_VISION_POSITION = 2
};

/* What is sent of a frame whose status is TV_ODOMETRY_WEAK. */
typedef enum tvm_weak {
  /* Nothing: the filter goes on with its other sensors. */
  TVM_WEAK_SILENT = 0,
  /* The estimate, with the standard deviations times weak_factor and a quality of at most 20. */
  TVM_WEAK_GROWN = 1
} tvm_weak;

/* The axes of the world that positions are sent in. */
typedef enum tvm_world {
  /* MAV_FRAME_LOCAL_FRD: z down, x along the vehicle's nose when its clock's run began. ArduPilot
     takes no other frame. */
  TVM_WORLD_FRD = 0,
  /* MAV_FRAME_LOCAL_NED: north, east, down, by the vehicle's own heading when the segment began. A
     segment from before the vehicle started again has no heading, and gives nothing. */
  TVM_WORLD_NED = 1
} tvm_world;

/* Why a frame gives no estimate. */
typedef enum tvm_silence {
  /* It gives one. */
  TVM_SILENCE_NONE = 0,
  /* The map has not begun. */
  TVM_SILENCE_STARTING = 1,
  /* No pose is known, or none whose numbers are finite. */
  TVM_SILENCE_LOST = 2,
  /* The attitude is known, and the position is that of the frame before. */
  TVM_SILENCE_ROTATION = 3,
  /* The frame is weak, and weak frames are not sent. */
  TVM_SILENCE_WEAK = 4,
  /* The map is not in metres. */
  TVM_SILENCE_SCALE = 5,
  /* The vehicle's attitude is not known at the exposure, or is not that of the map's vertical. */
  TVM_SILENCE_ATTITUDE = 6,
  /* The first frame of a segment, after a pause or a jump: nothing says yet how fast the vehicle
     is. */
  TVM_SILENCE_VELOCITY = 7,
  /* The way that the pictures show contradicts the vehicle's own velocities, as in a picture of
     another place or of something that moves; for at most 2 s. Or the segment is new, or was found
     again, and has not been compared with them for 0.2 s yet. */
  TVM_SILENCE_MOTION = 8
} tvm_silence;

/* Filled by tvm_estimator_options_init. */
typedef struct tvm_estimator_options {
  /* sizeof(tvm_estimator_options), set by tvm_estimator_options_init. */
  uint32_t struct_size;
  /* TVM_SEND_ bits, at least one. Default TVM_SEND_ODOMETRY. */
  int32_t messages;
  /* A tvm_weak. Default TVM_WEAK_SILENT. */
  int32_t weak;
  /* A tvm_world. Default TVM_WORLD_FRD. */
  int32_t world;
  /* By how much the standard deviations of a weak frame grow, [1, 100]. Default 3. */
  double weak_factor;
  /* How the camera is mounted: a direction v of the camera (x right, y down, z ahead) is
     body_from_camera v along the body's axes (forward, right, down); row-major. Default: the camera
     looks ahead, upright. */
  double body_from_camera[9];
  /* The camera's place in the body, metres. Default 0. What is sent is the pose of the body. */
  double camera_in_body[3];
  /* What the map itself drifts, [0, 1], which the covariance of one frame does not know: the
     standard deviation of each coordinate as a share of the way since the segment began, and that
     of the attitude about each axis, radians. Defaults 0.005 and 0.008: twice the root mean square
     of three rendered flights of 12 to 15 m (0.0026 and 0.0042). */
  double drift_share, drift_turn_rad;
  /* Over how many seconds the filter averages what it gets, [0, 100]. It counts the error of each
     message as new, and what drifts, and the metre's error, stay the same from one to the next: so
     their variances are sent times the messages in this time. 0: they are not. Default 1: some
     0.3 s by the noises of PX4 and ArduPilot, and more after a pause. */
  double filter_memory_s;
} tvm_estimator_options;

/* Writes the defaults into a struct of struct_size bytes; null is allowed. */
TV_API void tvm_estimator_options_init_sized(tvm_estimator_options *options, size_t struct_size);
/* Writes the defaults; null is allowed. */
#define tvm_estimator_options_init(options) \
  tvm_estimator_options_init_sized((options), sizeof *(options))

/* A frame that was tracked. Fill all of it with zeros first. */
typedef struct tvm_track {
  /* sizeof(tvm_track), which the caller sets. */
  uint32_t struct_size;
  /* 1: previous_R and previous_t hold the pose world_from_cam of the last frame that was given, in
     the map as it is now (tv_odometry_pose_of): how far the map's adjustment has moved it is then
     known. 0: they are not read. */
  int32_t has_previous;
  /* What tv_odometry_track says of the frame. The attitudes that were given to it must be those of
     this session, so that the map's axes are the session's. Read during the call only. */
  const tv_odometry_state *state;
  /* The exposure, ns of the session's clock; later than that of the frame before. */
  int64_t host_ns;
  /* The pose world_from_cam of the last frame that was given, as above: a row-major rotation, and a
     place in the unit of the map. */
  double previous_R[9], previous_t[3];
  /* The next three are filled by tvm_session_send_track; a caller of tvm_estimator_update fills
     them. The time that the estimate states, us of the vehicle's clock. */
  uint64_t time_us;
  /* 1: the map's z axis points along gravity. 0: not known. -1: it does not; the segment then gives
     nothing until it has been 1 for a second. */
  int32_t is_upright;
  /* A reserved field that is 0. */
  int32_t reserved;
  /* The heading of the map's x axis, radians east of north; read for TVM_WORLD_NED only. */
  double heading_rad;
  /* The vehicle's own velocity at the exposure, along the body's axes, m/s, and the standard
     deviation of each component. A sigma of 0: not known, and nothing is compared with it. */
  double velocity_m_s[3], velocity_sigma_m_s;
} tvm_track;

/* What is sent to an autopilot: the body (forward, right, down) in the local world. */
typedef struct tvm_estimate {
  /* sizeof(tvm_estimate), which the caller sets. */
  uint32_t struct_size;
  /* A tvm_silence; without TVM_SILENCE_NONE the fields below, but for reset_counter, are 0. */
  int32_t silence;
  /* The exposure, us of the vehicle's clock. */
  uint64_t time_us;
  /* A tvm_world. */
  int32_t world;
  /* Raised by 1 (and from 255 to 0) at a frame that was found again or closed a loop, at a new
     segment, where the metre came or went, and where the map's adjustment moved the frame before by
     more than its own standard deviation. */
  int32_t reset_counter;
  /* 1..100 by the standard deviation of the position, 50 at 0.1 m; 0 where it is not known. */
  int32_t quality;
  /* 1 where the covariances are known. */
  int32_t has_covariance;
  /* Metres, and a unit quaternion w x y z, world from body, w >= 0. */
  double position_m[3], world_from_body[4];
  /* Along and about the body's axes: m/s, rad/s. */
  double velocity_m_s[3], rate_rad_s[3];
  /* Row-major 6x6: x y z roll pitch yaw, metres and radians; vx vy vz and the three rates. */
  double pose_covariance[36], velocity_covariance[36];
} tvm_estimate;

/* The estimator in the caller's memory. Private. */
typedef struct tvm_estimator {
  tvm_estimator_options options;
  int32_t has_last, has_velocity, was_metric, last_segment, reset_counter, has_last_covariance;
  int64_t last_ns;
  /* Of the last pose in metres: world_from_cam, and the covariance of tv_odometry_state. */
  double last_R[9], last_t[3], last_covariance[36];
  /* The way since the segment began and that of all segments, in metres, and the variances of the
     last pose, of all axes together. */
  double path_m, way_m, last_place_sq, last_turn_sq;
  /* The last velocity and angular rate, along the axes of the world. */
  double last_velocity[3], last_rate[3];
  /* What tvm_session_send_track sent last, and when. */
  int32_t has_told, told_silence;
  /* The run of the vehicle's clock, the newest segment, and the first one that began in this run.
   */
  uint32_t run_id;
  int32_t max_segment, first_segment;
  /* For how long the map must agree with the vehicle's vertical before it is believed again. */
  int32_t doubt_ms;
  /* Of the comparison with the vehicle's velocities: whether the map is on trial; over how long,
     the way by the pictures, by how much more that is than the vehicle's; for how long they differ.
   */
  int32_t is_on_trial, reserved;
  double compared_s, compared_way[3], compared_gap[3], refused_s;
  int64_t told_ns;
} tvm_estimator;

/* Makes an estimator. options are copied. Returns TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE,
   TVS_ERR_ARGUMENT (a value out of its range, a mount that is no rotation). */
TV_API tvs_status tvm_estimator_init(tvm_estimator *estimator,
                                     const tvm_estimator_options *options);

/* Turns a frame into *estimate. To be called with every frame, in order, since velocities and the
   reset counter come from the frames before. Returns TVS_OK, also where there is no estimate
   (estimate->silence); TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE, and TVS_ERR_ARGUMENT (host_ns is not
   later than that of the frame before), with which all stays as it was. */
TV_API tvs_status tvm_estimator_update(tvm_estimator *estimator, const tvm_track *track,
                                       tvm_estimate *estimate);

/* Packs one of the messages of an estimate as MAVLink 2.
   message: TVM_SEND_ODOMETRY or TVM_SEND_VISION_POSITION. system, component: the sender's ids.
   sequence: the packet's number; the caller counts. bytes: room for TVM_MAX_PACKET_BYTES. Without a
   covariance the first element of each is NaN, which says so.
   Returns how many bytes the packet has; 0 where the estimate is silent or an argument is wrong. */
TV_API size_t tvm_estimate_pack(const tvm_estimate *estimate, int message, uint8_t system,
                                uint8_t component, uint8_t sequence, uint8_t *bytes);

/* Sends what a frame tells, through a session: the time of the exposure in the vehicle's clock, the
   vertical and the heading come from the session. Where there is no estimate, and when there is one
   again, a STATUSTEXT says so, at most once a second. From the first call on the session answers
   the autopilot's own TIMESYNC in the vehicle's clock, so that its offset to the times that are
   sent becomes 0. estimate: null, or receives what was sent. Returns TVS_OK: sent; TVS_NONE:
   silent, or it cannot be sent now; otherwise as tvm_estimator_update. */
TV_API tvs_status tvm_session_send_track(tvm_session *session, tvm_estimator *estimator,
                                         const tvm_track *track, tvm_estimate *estimate);

TV_END_DECLS

#endif
