/* twoview drivers: the attitude at the time of a frame, from the measured ones around it. */
#ifndef TWOVIEW_DRIVERS_ATTITUDE_H
#define TWOVIEW_DRIVERS_ATTITUDE_H

#include <stdint.h>

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* How many attitudes are kept: 5 s of them at 200 Hz. */
enum { TVS_ATTITUDES_CAPACITY = 1024 };

/* The latest attitudes of one device, in the order of its own time. The caller owns the struct; its
   fields are private. */
typedef struct tvs_attitudes {
  int32_t first, count;
  struct {
    int64_t device_ns;
    tvs_attitude attitude;
  } entries[TVS_ATTITUDES_CAPACITY];
} tvs_attitudes;

/* Empties the list of attitudes, which may be null. */
TV_API void tvs_attitudes_init(tvs_attitudes *attitudes);

/* Adds an attitude that was measured at device_ns of the clock that attitude->clock_id names. Where
   there is no room the oldest is dropped. A new clock_id drops all earlier ones. An attitude that
   is not newer than the newest is not added (TVS_NONE). Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT
   (clock_id 0, not a unit quaternion to 1e-6, sigma not in (0, 1000)). */
TV_API tvs_status tvs_attitudes_add(tvs_attitudes *attitudes, int64_t device_ns,
                                    const tvs_attitude *attitude);

/* The attitude at device_ns: on the shorter great circle between the two measured neighbours
   (slerp), if they are at most max_gap_ns apart. It is never extrapolated: TVS_NONE before the
   oldest, after the newest (ask again after the next tvs_attitudes_add), within a larger gap, and
   for another clock_id. attitude->sigma_rad is the larger one of the two neighbours'. */
TV_API tvs_status tvs_attitudes_at(const tvs_attitudes *attitudes, uint32_t clock_id,
                                   int64_t device_ns, int64_t max_gap_ns, tvs_attitude *attitude);

/* Writes to q the unit quaternion world_from_body (w x y z) of yaw, pitch and roll (radians),
   applied in this order about z, y and x. Yaw clockwise from above, pitch up and roll to the right
   are positive. */
TV_API void tvs_quaternion_from_euler(double yaw, double pitch, double roll, double q[4]);

/* Returns the angle in radians, [0, pi], of the turn between the unit quaternions a and b. */
TV_API double tvs_angle_between(const double a[4], const double b[4]);

/* Writes to q the unit quaternion at the share s in [0, 1] of the shorter great circle from a (s =
   0) to b (s = 1). q may be a or b. */
TV_API void tvs_slerp(const double a[4], const double b[4], double s, double q[4]);

TV_END_DECLS

#endif
