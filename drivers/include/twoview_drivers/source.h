/* twoview drivers: where frames and attitudes come from.

   A camera or a drone is one or two small structs of function pointers: a frame source and an IMU
   source. ardrone/session.h fills them for the AR.Drone 2.0, file_source.h for image files; a
   driver of your own fills them in the same way. All units are SI.

   Body frame:  x forward, y right, z down, with its origin at the vehicle.
   World frame: z down; x is the body's x at the start, projected on the level; right-handed. With
                each new clock_id the world frame and the device's time start again.
   Quaternions: w x y z, unit, world_from_body: v_world = q v_body q*. */
#ifndef TWOVIEW_DRIVERS_SOURCE_H
#define TWOVIEW_DRIVERS_SOURCE_H

#include <stdint.h>

#include "twoview/image.h"
#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

/* When something was measured. Host times are nanoseconds of one monotonic clock of this computer;
   file_source.h and ardrone/session.h say which clock that is. */
typedef struct tvs_time {
  /* Host time at which the measurement's bytes arrived, ns. */
  int64_t received_ns;
  /* Host time of the measurement, as well as it is known, ns; received_ns where nothing
     better is. */
  int64_t host_ns;
  /* The largest error that host_ns may have, ns; INT64_MAX when it is not known. */
  int64_t uncertainty_ns;
  /* The device's own time, unwrapped, ns; 0 where the device has no clock. */
  int64_t device_ns;
  /* Names the device's clock and one run of it. It changes when the device starts again or
     its clock jumps. Compare device times and attitudes of equal ids only. 0: there is no
     device time. */
  uint32_t clock_id;
  /* A reserved field that is 0. */
  uint32_t reserved;
} tvs_time;

/* An attitude and its uncertainty. */
typedef struct tvs_attitude {
  /* The attitude as a unit quaternion, w x y z. */
  double world_from_body[4];
  /* Standard deviation of the rotation about any axis, radians; above 0. */
  double sigma_rad;
  /* The run of the world frame that this attitude belongs to (tvs_time.clock_id). */
  uint32_t clock_id;
  /* A reserved field that is 0. */
  uint32_t reserved;
} tvs_attitude;

/* The bits of tvs_frame.flags. */
enum {
  /* The frame can be decoded without any frame before it. */
  TVS_FRAME_KEY = 1,
  /* At least one frame between the last one delivered and this one was lost or left out. */
  TVS_FRAME_GAP = 2,
  /* The frame's attitude was measured; without this bit the field attitude holds nothing. */
  TVS_FRAME_HAS_ATTITUDE = 4,
  /* This is the first frame of a connection; do not relate it to the frames before it. */
  TVS_FRAME_NEW_STREAM = 8
};

/* One picture. Its pixels belong to the source and are valid until release is called. */
typedef struct tvs_frame {
  /* sizeof(tvs_frame), which the caller sets before the call. */
  uint32_t struct_size;
  /* The TVS_FRAME_ bits of this frame. */
  uint32_t flags;
  /* 8-bit luma: pointer, width, height, stride. It can be handed to tv_extract as it is. */
  tv_image image;
  /* The device's own frame number where it has one, else a count from 0. */
  uint64_t number;
  /* The time at which the frame was exposed. */
  tvs_time time;
  /* The attitude at the exposure; valid where flags has TVS_FRAME_HAS_ATTITUDE. */
  tvs_attitude attitude;
  /* For the source's own use; leave it as it is. */
  void *handle;
} tvs_frame;

/* Where frames come from. A driver fills it; its pointers are valid as long as that driver's
   session or memory. */
typedef struct tvs_frame_source {
  /* sizeof(tvs_frame_source), which the driver sets. */
  uint32_t struct_size;
  /* The first argument of `next` and `release`. */
  void *user;
  /* Gets the next frame and never waits. TVS_OK: *frame is filled, and the caller calls release
     when it no longer needs the pixels. TVS_NONE: no frame has come yet. TVS_END: no further frame
     will come. An error leaves *frame as it was. A source states how many frames the caller may
     hold at once; it is at least 1. */
  tvs_status (*next)(void *user, tvs_frame *frame);
  /* Gives the frame's pixels back to the source. */
  void (*release)(void *user, tvs_frame *frame);
} tvs_frame_source;

/* Bits of a sample's `valid`: which fields were measured. A field without its bit is 0. */
enum {
  /* The sample has an attitude. */
  TVS_IMU_ATTITUDE = 1,
  /* The sample has an angular rate, rate_rad_s. */
  TVS_IMU_RATE = 2,
  /* The sample has a specific force, acceleration_m_s2. */
  TVS_IMU_ACCELERATION = 4,
  /* The sample has the velocity along the body's x and y axes, velocity_m_s[0] and
     velocity_m_s[1]. */
  TVS_IMU_VELOCITY_XY = 8,
  /* The sample has the velocity along the body's z axis, velocity_m_s[2]. */
  TVS_IMU_VELOCITY_Z = 16,
  /* The sample has a height, altitude_m. */
  TVS_IMU_ALTITUDE = 32,
  /* The sample has a pressure of the air, pressure_pa. */
  TVS_IMU_PRESSURE = 64
};

/* One sample. A sigma is one standard deviation of each component, as the source states it. */
typedef struct tvs_imu {
  /* sizeof(tvs_imu), which the caller sets before the call. */
  uint32_t struct_size;
  /* The TVS_IMU_ bits of the fields that were measured. */
  uint32_t valid;
  /* The time at which the sample was measured. */
  tvs_time time;
  /* The attitude with its standard deviation. */
  tvs_attitude attitude;
  /* Angular rate about the body's axes, radians per second, and its sigma. */
  double rate_rad_s[3], rate_sigma;
  /* Specific force along the body's axes, m/s^2, and its sigma: (0, 0, -9.8) at rest and level. */
  double acceleration_m_s2[3], acceleration_sigma;
  /* Velocity over ground along the body's axes, m/s, and its sigma. */
  double velocity_m_s[3], velocity_sigma;
  /* Height above the ground below, metres, positive upwards, and its sigma. */
  double altitude_m, altitude_sigma;
  /* Pressure of the air at the vehicle, pascals, not reduced to sea level, and its sigma. */
  double pressure_pa, pressure_sigma;
} tvs_imu;

/* Where IMU samples come from. A driver fills it, as it fills a tvs_frame_source. */
typedef struct tvs_imu_source {
  /* sizeof(tvs_imu_source), which the driver sets. */
  uint32_t struct_size;
  /* The first argument of `next`. */
  void *user;
  /* Gets the next sample, with the statuses of tvs_frame_source.next. There is nothing to
     release. */
  tvs_status (*next)(void *user, tvs_imu *sample);
} tvs_imu_source;

/* A picture that a tvs_decoder has decoded. */
typedef struct tvs_picture {
  /* Lies in the decoder's memory and is valid until release is called. */
  tv_image image;
  /* For the decoder's own use; leave it as it is. */
  void *handle;
} tvs_picture;

/* Turns one compressed picture into luma. h264.h makes one from libavcodec. */
typedef struct tvs_decoder {
  /* sizeof(tvs_decoder), which the decoder's driver sets. */
  uint32_t struct_size;
  /* The first argument of `decode`, `release` and `reset`. */
  void *user;
  /* Decodes `size` bytes. TVS_OK: *picture is filled; release it later. TVS_NONE: these bytes
     give no picture. TVS_ERR_DATA: they do not decode. Pictures that were not released stay
     valid. */
  tvs_status (*decode)(void *user, const uint8_t *bytes, size_t size, tvs_picture *picture);
  /* Gives the picture's pixels back to the decoder. */
  void (*release)(void *user, tvs_picture *picture);
  /* Call it where another stream begins: the decoder forgets all earlier bytes. */
  void (*reset)(void *user);
} tvs_decoder;

TV_END_DECLS

#endif
