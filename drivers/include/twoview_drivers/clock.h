/* twoview drivers: maps a device's clock to the host's.

   Devices stamp what they measure with counters that wrap, start at any value and drift. A mapper
   unwraps one such counter and estimates its offset to the host's clock by the least delay: the
   packet with the smallest delay bounds the offset best. The caller owns the struct and hands it
   each stamp; nothing else drives it. */
#ifndef TWOVIEW_DRIVERS_CLOCK_H
#define TWOVIEW_DRIVERS_CLOCK_H

#include <stdint.h>

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* What is known of a device's clock beforehand. Filled by tvs_clock_options_init. */
typedef struct tvs_clock_options {
  /* The counter wraps to 0 after this long, ns: at least 60 s, or 0 for a counter that never
     wraps. */
  int64_t period_ns;
  /* An upper bound on the delay of the quickest packet, ns. The delay itself cannot be observed, so
     half of this bound is subtracted and half of it is added to the uncertainty. Default 2 ms. */
  int64_t least_delay_ns;
  /* The mean delay of a packet beyond the least one, ns. The quickest of n packets is then taken to
     be late by less than 4 jitter_ns / n, which holds in 98 % of cases for exponential delays.
     Default 20 ms. */
  int64_t jitter_ns;
  /* The largest difference between the two clocks' rates, parts per million, [0, 10000], default
     100. */
  int32_t drift_ppm;
} tvs_clock_options;

/* Writes the defaults, with period_ns 0, to options, which may be null. */
TV_API void tvs_clock_options_init(tvs_clock_options *options);

/* Private: a caller owns it and does not read its fields. */
typedef struct tvs_clock {
  tvs_clock_options options;
  /* The id of the clock's present run; before the first observation first_id - id_step. */
  uint32_t clock_id;
  /* The difference between the ids of successive runs. */
  uint32_t id_step;
  /* How many stamps bound the offset: those of this run, or those since a silence in which the
     clocks may have drifted by more than jitter_ns. 0: the next stamp begins a run. */
  int64_t num_observed;
  /* The latest time of the device so far, unwrapped, ns. */
  int64_t last_device_ns;
  /* Host time at which the latest time of the device was received, ns. */
  int64_t last_host_ns;
  /* The offset by the least delay: host time = device time + offset_ns. */
  int64_t offset_ns;
  /* Host time at which the offset was last confirmed, ns. */
  int64_t offset_host_ns;
} tvs_clock;

/* Starts a clock. The clock_id of the first run is first_id, the next runs have first_id + id_step,
   first_id + 2 id_step and so on. The first_ids 1 to n with an id_step of n give n clocks ids that
   are never equal. first_id and id_step are at least 1. options may be null. Returns TVS_ERR_NULL,
   TVS_ERR_ARGUMENT. */
TV_API tvs_status tvs_clock_init(tvs_clock *clock, const tvs_clock_options *options,
                                 uint32_t first_id, uint32_t id_step);

/* One stamp of the device, as a time in [0, period_ns), received at received_ns. Writes the stamp's
   unwrapped time and clock_id, its host time and uncertainty.
   A stamp that is more than 1 s older than the latest, or more than 1 s ahead of what the host's
   clock allows, means that the clock jumped or the device started again: it gets a new clock_id.
   Packets may be up to 30 s late. A stamp that is at most 1 s older than the latest keeps its own
   time. Returns TVS_ERR_NULL, TVS_ERR_ARGUMENT (a stamp outside the period, a time beyond 73
   years). */
TV_API tvs_status tvs_clock_observe(tvs_clock *clock, int64_t stamp_ns, int64_t received_ns,
                                    tvs_time *time);

/* Call it when the device is known to have started again: the next stamp begins a new run. */
TV_API void tvs_clock_restart(tvs_clock *clock);

/* Converts an instant of the device's clock to the host's: *host_ns, with an error of at most
   *uncertainty_ns. TVS_NONE when clock_id is not the current run. Returns TVS_ERR_NULL,
   TVS_ERR_ARGUMENT (an instant out of range). */
TV_API tvs_status tvs_clock_to_host(const tvs_clock *clock, uint32_t clock_id, int64_t device_ns,
                                    int64_t *host_ns, int64_t *uncertainty_ns);

/* Converts an instant of the host's clock to the device's: *device_ns of the run *clock_id, with an
   error of at most *uncertainty_ns. TVS_NONE before the first observation. Returns TVS_ERR_NULL,
   TVS_ERR_ARGUMENT (an instant out of range). */
TV_API tvs_status tvs_clock_to_device(const tvs_clock *clock, int64_t host_ns, uint32_t *clock_id,
                                      int64_t *device_ns, int64_t *uncertainty_ns);

TV_END_DECLS

#endif
