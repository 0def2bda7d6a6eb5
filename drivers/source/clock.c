/* The least delay: received_ns - device_ns is the clocks' offset plus a delay that is never
   negative, so its minimum over many packets is the offset plus the least delay. The clocks drift,
   so the minimum of old packets may have become too small or too large: a new packet replaces it if
   its own difference is smaller than the minimum plus the largest drift since then. */
#include "twoview_drivers/clock.h"

#include <stddef.h>

enum { SECOND = 1000000000 };
/* A stamp that lies further than this behind its expected time begins a new run of the clock, ns.
   TCP does not deliver bytes that are delayed for longer. */
static const int64_t LATEST_DELAY_NS = 30LL * SECOND;
static const int64_t JUMP_NS = SECOND;
/* About 73 years: sums and differences of such times do not overflow. */
static const int64_t FARTHEST_NS = (int64_t)1 << 61;

void tvs_clock_options_init(tvs_clock_options *options) {
  if (!options) return;
  options->period_ns = 0;
  options->least_delay_ns = 2000000;
  options->jitter_ns = 20000000;
  options->drift_ppm = 100;
}

tvs_status tvs_clock_init(tvs_clock *clock, const tvs_clock_options *options, uint32_t first_id,
                          uint32_t id_step) {
  tvs_clock_options used;
  if (!clock) return TVS_ERR_NULL;
  tvs_clock_options_init(&used);
  if (options) used = *options;
  if ((used.period_ns != 0 && (used.period_ns < 60LL * SECOND || used.period_ns > FARTHEST_NS)) ||
      used.least_delay_ns < 0 || used.least_delay_ns > FARTHEST_NS || used.jitter_ns < 0 ||
      used.jitter_ns > FARTHEST_NS / 4 || used.drift_ppm < 0 || used.drift_ppm > 10000 ||
      first_id == 0 || id_step == 0) {
    return TVS_ERR_ARGUMENT;
  }
  clock->options = used;
  clock->clock_id = first_id - id_step;
  clock->id_step = id_step;
  clock->num_observed = 0;
  clock->last_device_ns = clock->last_host_ns = 0;
  clock->offset_ns = clock->offset_host_ns = 0;
  return TVS_OK;
}

void tvs_clock_restart(tvs_clock *clock) {
  if (clock) clock->num_observed = 0;
}

static int64_t drift_over(const tvs_clock *clock, int64_t elapsed_ns) {
  const int64_t age = elapsed_ns < 0 ? -elapsed_ns : elapsed_ns;
  return age / 1000000 * clock->options.drift_ppm;
}

static int64_t uncertainty_at(const tvs_clock *clock, int64_t host_ns) {
  return clock->options.least_delay_ns / 2 + 4 * clock->options.jitter_ns / clock->num_observed +
         drift_over(clock, host_ns - clock->offset_host_ns);
}

/* Host time minus device time. The least delay is between 0 and options.least_delay_ns, so half
   of that is subtracted. */
static int64_t shift_of(const tvs_clock *clock) {
  return clock->offset_ns - clock->options.least_delay_ns / 2;
}

/* The unwrapped time of a stamp: of stamp_ns plus whole periods, the value nearest to
   expected_ns. */
static int64_t unwrap(int64_t stamp_ns, int64_t period_ns, int64_t expected_ns) {
  int64_t turns, device_ns;
  if (period_ns == 0) return stamp_ns;
  turns = (expected_ns - stamp_ns) / period_ns;
  device_ns = stamp_ns + turns * period_ns;
  if (expected_ns - device_ns > period_ns / 2) return device_ns + period_ns;
  if (device_ns - expected_ns > period_ns / 2) return device_ns - period_ns;
  return device_ns;
}

static void begin_run(tvs_clock *clock, int64_t stamp_ns, int64_t received_ns) {
  clock->clock_id += clock->id_step;
  if (clock->clock_id == 0) clock->clock_id += clock->id_step; /* the id 0 means "no clock" */
  clock->num_observed = 1;
  clock->last_device_ns = stamp_ns;
  clock->last_host_ns = clock->offset_host_ns = received_ns;
  clock->offset_ns = received_ns - stamp_ns;
}

/* Whether the stamp belongs to this run of the clock; if so, its unwrapped time. */
static int continues_run(const tvs_clock *clock, int64_t stamp_ns, int64_t received_ns,
                         int64_t *device_ns) {
  const int64_t elapsed = received_ns - clock->last_host_ns;
  const int64_t expected = clock->last_device_ns + elapsed;
  int64_t ahead;
  *device_ns = unwrap(stamp_ns, clock->options.period_ns, expected);
  if (*device_ns < clock->last_device_ns - JUMP_NS) return 0;
  if (*device_ns - expected < -LATEST_DELAY_NS) return 0;
  /* By so many ns the delay of this stamp is smaller than the least one so far. */
  ahead = *device_ns + clock->offset_ns - received_ns;
  return ahead <= JUMP_NS + drift_over(clock, received_ns - clock->offset_host_ns);
}

static void improve_offset(tvs_clock *clock, int64_t device_ns, int64_t received_ns) {
  const int64_t sample = received_ns - device_ns;
  const int64_t allowed = clock->offset_ns + drift_over(clock, received_ns - clock->offset_host_ns);
  if (sample <= allowed) {
    clock->offset_ns = sample;
    clock->offset_host_ns = received_ns;
  }
}

tvs_status tvs_clock_observe(tvs_clock *clock, int64_t stamp_ns, int64_t received_ns,
                             tvs_time *time) {
  int64_t device_ns = stamp_ns;
  if (!clock || !time) return TVS_ERR_NULL;
  if (stamp_ns < 0 || stamp_ns > FARTHEST_NS || received_ns < -FARTHEST_NS ||
      received_ns > FARTHEST_NS ||
      (clock->options.period_ns != 0 && stamp_ns >= clock->options.period_ns)) {
    return TVS_ERR_ARGUMENT;
  }
  if (clock->num_observed == 0 || !continues_run(clock, stamp_ns, received_ns, &device_ns)) {
    device_ns = stamp_ns;
    begin_run(clock, stamp_ns, received_ns);
  } else {
    /* After a silence in which the clocks may have drifted by more than a packet's jitter, the old
       packets bound the offset no better than a new one does. */
    ++clock->num_observed;
    if (drift_over(clock, received_ns - clock->last_host_ns) > clock->options.jitter_ns) {
      clock->num_observed = 1;
    }
    improve_offset(clock, device_ns, received_ns);
    if (device_ns > clock->last_device_ns) {
      clock->last_device_ns = device_ns;
      clock->last_host_ns = received_ns;
    }
  }
  time->received_ns = received_ns;
  time->host_ns = device_ns + shift_of(clock);
  time->uncertainty_ns = uncertainty_at(clock, received_ns);
  time->device_ns = device_ns;
  time->clock_id = clock->clock_id;
  time->reserved = 0;
  return TVS_OK;
}

tvs_status tvs_clock_to_host(const tvs_clock *clock, uint32_t clock_id, int64_t device_ns,
                             int64_t *host_ns, int64_t *uncertainty_ns) {
  if (!clock || !host_ns || !uncertainty_ns) return TVS_ERR_NULL;
  if (device_ns < -FARTHEST_NS || device_ns > FARTHEST_NS) return TVS_ERR_ARGUMENT;
  if (clock->num_observed == 0 || clock_id != clock->clock_id) return TVS_NONE;
  *host_ns = device_ns + shift_of(clock);
  *uncertainty_ns = uncertainty_at(clock, *host_ns);
  return TVS_OK;
}

tvs_status tvs_clock_to_device(const tvs_clock *clock, int64_t host_ns, uint32_t *clock_id,
                               int64_t *device_ns, int64_t *uncertainty_ns) {
  if (!clock || !clock_id || !device_ns || !uncertainty_ns) return TVS_ERR_NULL;
  if (host_ns < -FARTHEST_NS || host_ns > FARTHEST_NS) return TVS_ERR_ARGUMENT;
  if (clock->num_observed == 0) return TVS_NONE;
  *clock_id = clock->clock_id;
  *device_ns = host_ns - shift_of(clock);
  *uncertainty_ns = uncertainty_at(clock, host_ns);
  return TVS_OK;
}
