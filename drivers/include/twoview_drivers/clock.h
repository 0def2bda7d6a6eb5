/* twoview drivers: a device's clock, told in the host's.

   Devices stamp what they measure with counters that wrap, start at any value and drift. A mapper
   unwraps one such counter and estimates its offset to the host's clock by the least delay: of all
   packets, the quickest says best what the offset is. It is the caller's struct, no heap, and is
   driven by what the caller feeds it. */
#ifndef TWOVIEW_DRIVERS_CLOCK_H
#define TWOVIEW_DRIVERS_CLOCK_H

#include <stdint.h>

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* What is known of a device's clock beforehand. Filled by tvs_clock_options_init. */
typedef struct tvs_clock_options {
  int64_t period_ns;      /* after this long the counter starts again, at least 60 s; 0: never */
  int64_t least_delay_ns; /* how late even the quickest packet may be. It cannot be observed: half of it
                             is taken off, and the other half is uncertainty. Default 2 ms */
  int64_t jitter_ns;      /* mean extra delay of a packet: the quickest of n is late by less than
                             4 jitter / n (98 per cent, were it exponential). Default 20 ms */
  int32_t drift_ppm;      /* how fast the two clocks may part, [0, 10000], default 100 */
} tvs_clock_options;

/* Writes the defaults; period_ns is 0. Null is allowed. */
TV_API void tvs_clock_options_init(tvs_clock_options *options);

/* Private; a caller holds it and reads nothing. */
typedef struct tvs_clock {
  tvs_clock_options options;
  uint32_t clock_id;       /* 0 before the first observation */
  uint32_t id_step;        /* distance of successive ids */
  int64_t num_observed;    /* in this run of the clock */
  int64_t last_device_ns;  /* the latest so far */
  int64_t last_host_ns;    /* when that arrived */
  int64_t offset_ns;       /* host = device + offset, by the least delay */
  int64_t offset_host_ns;  /* when that offset was last confirmed */
} tvs_clock;

/* first_id: the clock_id of the first run, at least 1. Further runs get first_id + id_step, and so
   on, so that several clocks can have ids that never meet.
   Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT. options may be null. */
TV_API tvs_status tvs_clock_init(tvs_clock *clock, const tvs_clock_options *options,
                                 uint32_t first_id, uint32_t id_step);

/* One stamp of the device, as a time in [0, period_ns), received at received_ns. Writes the stamp's
   unwrapped time and clock_id, its host time and uncertainty.
   A stamp more than 1 s older than the latest, or ahead of what the host's clock allows by more than
   1 s, is no delay but a clock that jumped or a device that started again: a new clock_id. Packets
   may be up to 30 s late. Stamps out of order within 1 s keep their own time.
   Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT (a stamp outside the period). */
TV_API tvs_status tvs_clock_observe(tvs_clock *clock, int64_t stamp_ns, int64_t received_ns,
                                    tvs_time *time);

/* The device is known to have started again: the next stamp begins a new run. */
TV_API void tvs_clock_restart(tvs_clock *clock);

/* An instant of the device's clock on the host's: *host_ns, off by at most *uncertainty_ns. TVS_NONE when clock_id
   is not the current run. TVS_ERR_NULL, TVS_ERR_ARGUMENT (an instant out of range). */
TV_API tvs_status tvs_clock_to_host(const tvs_clock *clock, uint32_t clock_id, int64_t device_ns,
                                    int64_t *host_ns, int64_t *uncertainty_ns);
/* An instant of the host's clock on the device's: *device_ns of the run *clock_id, off by at most *uncertainty_ns.
   TVS_NONE before the first observation. TVS_ERR_NULL, TVS_ERR_ARGUMENT (an instant out of range). */
TV_API tvs_status tvs_clock_to_device(const tvs_clock *clock, int64_t host_ns, uint32_t *clock_id,
                                      int64_t *device_ns, int64_t *uncertainty_ns);

TV_END_DECLS

#endif
