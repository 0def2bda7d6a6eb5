/* twoview drivers: where frames and attitudes come from.

   A camera or a drone is one or two small structs of function pointers: a frame source and an IMU
   source. ardrone/session.h fills them for the AR.Drone 2.0, file_source.h for recordings; a driver
   of your own fills them the same way. All units are SI.

   Body frame:  x forward, y right, z down, at the vehicle.
   World frame: z down; x along the body's x at start, projected on the level; right-handed.
                It starts anew, like device time, with each clock_id.
   Quaternions: w x y z, unit, world_from_body: v_world = q v_body q*. */
#ifndef TWOVIEW_DRIVERS_SOURCE_H
#define TWOVIEW_DRIVERS_SOURCE_H

#include <stdint.h>

#include "twoview/image.h"
#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

/* When something was measured. Host times are nanoseconds of one monotonic clock of this computer,
   the caller's own (file_source.h, ardrone/session.h say which). */
typedef struct tvs_time {
  int64_t received_ns;    /* host clock: when the bytes arrived */
  int64_t host_ns;        /* host clock: when it was measured, as well as is known; else received_ns */
  int64_t uncertainty_ns; /* host_ns is this far off or less; INT64_MAX when nobody knows */
  int64_t device_ns;      /* the device's clock, unwrapped; 0 without one */
  uint32_t clock_id;      /* names the clock of device_ns and the run of it: it changes when the device
                             or its clock starts anew. Device times (and attitudes) of different ids
                             do not compare. 0: no device time */
  uint32_t reserved;      /* 0 */
} tvs_time;

/* An attitude, and how far it may be off: one standard deviation, radians, about any axis. */
typedef struct tvs_attitude {
  double world_from_body[4]; /* unit quaternion, w x y z */
  double sigma_rad;          /* above 0 */
  uint32_t clock_id; /* the run of the world frame that it belongs to */
  uint32_t reserved; /* 0 */
} tvs_attitude;

enum {
  TVS_FRAME_KEY = 1,          /* decodable without any frame before it */
  TVS_FRAME_GAP = 2,          /* frames between this one and the one before were lost or left out */
  TVS_FRAME_HAS_ATTITUDE = 4, /* the attitude below was measured, not guessed */
  TVS_FRAME_NEW_STREAM = 8    /* the first frame of a connection: nothing before it is related */
};

/* One picture. Its pixels belong to the source and live until `release`. */
typedef struct tvs_frame {
  uint32_t struct_size; /* set by the caller: sizeof(tvs_frame) */
  uint32_t flags;       /* TVS_FRAME_ bits */
  tv_image image;       /* 8-bit luma: pointer, width, height, stride; ready for tv_extract */
  uint64_t number;      /* the device's own count where it has one, else from 0 */
  tvs_time time;        /* of the exposure */
  tvs_attitude attitude; /* at the exposure; valid with TVS_FRAME_HAS_ATTITUDE */
  void *handle;         /* the source's own */
} tvs_frame;

/* Where frames come from. Filled by a driver; the pointers live as long as its session. */
typedef struct tvs_frame_source {
  uint32_t struct_size; /* sizeof(tvs_frame_source) */
  void *user;           /* first argument of the functions */
  /* The next frame. TVS_OK: *frame is filled, and the caller calls release when done with it.
     TVS_NONE: none yet (a live source does not wait). TVS_END: no more will come. Errors: frame as
     it was. Sources state how many frames may be held at once; at least 1. */
  tvs_status (*next)(void *user, tvs_frame *frame);
  void (*release)(void *user, tvs_frame *frame); /* the caller is done with the frame's pixels */
} tvs_frame_source;

/* Which fields of a sample were measured. A field without its bit is 0. */
enum {
  TVS_IMU_ATTITUDE = 1,     /* attitude */
  TVS_IMU_RATE = 2,         /* rate_rad_s */
  TVS_IMU_ACCELERATION = 4, /* acceleration_m_s2 */
  TVS_IMU_VELOCITY_XY = 8,  /* velocity_m_s[0], [1] */
  TVS_IMU_VELOCITY_Z = 16,  /* velocity_m_s[2] */
  TVS_IMU_ALTITUDE = 32,    /* altitude_m */
  TVS_IMU_PRESSURE = 64     /* pressure_pa */
};

/* One sample. Sigmas are one standard deviation of each component, as the source states them. */
typedef struct tvs_imu {
  uint32_t struct_size; /* set by the caller: sizeof(tvs_imu) */
  uint32_t valid;       /* TVS_IMU_ bits */
  tvs_time time;         /* of the measurement */
  tvs_attitude attitude; /* with its own sigma */
  double rate_rad_s[3], rate_sigma;             /* body axes */
  double acceleration_m_s2[3], acceleration_sigma; /* body axes, specific force: (0, 0, -9.8) at rest */
  double velocity_m_s[3], velocity_sigma;       /* body axes */
  double altitude_m, altitude_sigma;            /* height above the ground below, up is positive */
  double pressure_pa, pressure_sigma;           /* of the air, not reduced to sea level */
} tvs_imu;

/* Where IMU samples come from. Filled as a tvs_frame_source. */
typedef struct tvs_imu_source {
  uint32_t struct_size; /* sizeof(tvs_imu_source) */
  void *user;           /* first argument of the function */
  tvs_status (*next)(void *user, tvs_imu *sample); /* as tvs_frame_source's, with nothing to release */
} tvs_imu_source;

/* A decoded picture. */
typedef struct tvs_picture {
  tv_image image; /* the decoder's memory, until release */
  void *handle;   /* the decoder's own */
} tvs_picture;

/* Turns one compressed picture into luma. h264.h makes one from libavcodec. */
typedef struct tvs_decoder {
  uint32_t struct_size; /* sizeof(tvs_decoder) */
  void *user;           /* first argument of the functions */
  /* TVS_OK: *picture is filled, release it later. TVS_NONE: no picture from these bytes.
     TVS_ERR_DATA: they do not decode. Pictures that were not released stay valid. */
  tvs_status (*decode)(void *user, const uint8_t *bytes, size_t size, tvs_picture *picture);
  void (*release)(void *user, tvs_picture *picture); /* its pixels are no longer needed */
  void (*reset)(void *user); /* forget all earlier bytes: another stream begins */
} tvs_decoder;

TV_END_DECLS

#endif
