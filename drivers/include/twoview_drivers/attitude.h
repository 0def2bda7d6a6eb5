/* twoview drivers: "what was the attitude when this frame was taken", or "unknown". */
#ifndef TWOVIEW_DRIVERS_ATTITUDE_H
#define TWOVIEW_DRIVERS_ATTITUDE_H

#include <stdint.h>

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

enum { TVS_ATTITUDES_CAPACITY = 1024 }; /* 5 s at 200 Hz */

/* The latest attitudes of one device, by its own time. The caller's struct, no heap. Private. */
typedef struct tvs_attitudes {
  int32_t first, count;
  struct {
    int64_t device_ns;
    tvs_attitude attitude;
  } entries[TVS_ATTITUDES_CAPACITY];
} tvs_attitudes;

/* None known; null is allowed. */
TV_API void tvs_attitudes_init(tvs_attitudes *attitudes);

/* Adds an attitude measured at device_ns of the clock that attitude->clock_id names; the oldest goes
   when there is no room. A new clock_id forgets all that came before. One that is not newer than the
   newest is left out (TVS_NONE).
   Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT (clock_id 0, not a unit quaternion to 1e-6, sigma not above 0). */
TV_API tvs_status tvs_attitudes_add(tvs_attitudes *attitudes, int64_t device_ns,
                                    const tvs_attitude *attitude);

/* The attitude at device_ns: on the shorter great circle between the two measured neighbours (slerp),
   if they are at most max_gap_ns apart. Never extrapolated: TVS_NONE before the oldest, after the
   newest (it may be known a moment later), within a larger gap, or for another clock_id.
   sigma_rad is the neighbours' larger one. */
TV_API tvs_status tvs_attitudes_at(const tvs_attitudes *attitudes, uint32_t clock_id,
                                   int64_t device_ns, int64_t max_gap_ns, tvs_attitude *attitude);

/* q: the unit quaternion world_from_body (w x y z) of yaw, pitch, roll (radians), applied in this order about z, y,
   x: pitch up, roll to the right and yaw clockwise from above are positive. */
TV_API void tvs_quaternion_from_euler(double yaw, double pitch, double roll, double q[4]);

/* q: on the shorter great circle between the unit quaternions a (s = 0) and b (s = 1), s in [0, 1]. It may be
   a or b. */
TV_API void tvs_slerp(const double a[4], const double b[4], double s, double q[4]);

TV_END_DECLS

#endif
