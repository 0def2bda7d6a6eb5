#include "twoview_drivers/ardrone/pilot.h"

#include <string.h>

#include "twoview_drivers/ardrone/navdata.h"

#define MS INT64_C(1000000)
static const int64_t TAKE_OFF_TIMEOUT_NS = 20000 * MS;
/* A pulse holds the bit so long that some of its datagrams arrive although others are lost. The
   pause after it is longer than the drone needs to report the new state. */
static const int64_t PULSE_NS = 150 * MS, PULSE_PERIOD_NS = 600 * MS, EMERGENCY_NS = 3000 * MS;
static const int64_t FRESH_NS = 200 * MS;
/* The flat trim is sent several times, because the drone does not acknowledge it. */
enum { NUM_TRIMS = 10 };
enum { CUT = 1, REARM = 2 };

void ardrone_pilot_init(ardrone_pilot *pilot) {
  if (!pilot) return;
  memset(pilot, 0, sizeof *pilot);
  pilot->next_tick_ns = INT64_MIN;
}

void ardrone_pilot_new_link(ardrone_pilot *pilot) {
  if (!pilot) return;
  pilot->at.sequence = 0;
  pilot->at.size = 0;
  pilot->has_state = 0;
  pilot->wants_flight = pilot->was_flying = 0;
  pilot->moves = 0;
  pilot->emergency = 0;
  pilot->trims_left = 0;
}

static int is_in_emergency(const ardrone_pilot *pilot) {
  return (pilot->state & ARDRONE_STATE_EMERGENCY) != 0;
}

static int is_flying(const ardrone_pilot *pilot) {
  return (pilot->state & ARDRONE_STATE_FLYING) != 0;
}

static void end_flight(ardrone_pilot *pilot) {
  pilot->wants_flight = 0;
  pilot->was_flying = 0;
  pilot->moves = 0;
}

void ardrone_pilot_state(ardrone_pilot *pilot, uint32_t state, int64_t now_ns) {
  if (!pilot) return;
  pilot->state = state;
  pilot->has_state = 1;
  pilot->state_ns = now_ns;
  if ((pilot->emergency == CUT && is_in_emergency(pilot)) ||
      (pilot->emergency == REARM && !is_in_emergency(pilot))) {
    pilot->emergency = 0;
  }
  if (!pilot->wants_flight) return;
  if (is_in_emergency(pilot)) {
    end_flight(pilot);
  } else if (is_flying(pilot)) {
    pilot->was_flying = 1;
  } else if (pilot->was_flying || now_ns - pilot->take_off_ns > TAKE_OFF_TIMEOUT_NS) {
    end_flight(pilot); /* the drone landed by itself; if bit 9 of REF stayed set, the drone would
                          take off again */
  }
}

tvs_status ardrone_pilot_take_off(ardrone_pilot *pilot, int64_t now_ns) {
  if (!pilot) return TVS_ERR_NULL;
  if (!pilot->has_state || is_in_emergency(pilot) || pilot->emergency) return TVS_ERR_STATE;
  if (!pilot->wants_flight) pilot->take_off_ns = now_ns;
  pilot->active = pilot->wants_flight = 1;
  return TVS_OK;
}

tvs_status ardrone_pilot_land(ardrone_pilot *pilot) {
  if (!pilot) return TVS_ERR_NULL;
  pilot->active = 1;
  end_flight(pilot);
  return TVS_OK;
}

tvs_status ardrone_pilot_hover(ardrone_pilot *pilot) {
  if (!pilot) return TVS_ERR_NULL;
  pilot->moves = 0;
  return TVS_OK;
}

tvs_status ardrone_pilot_move(ardrone_pilot *pilot, const ardrone_move *move, int64_t now_ns) {
  ardrone_at scratch;
  if (!pilot || !move) return TVS_ERR_NULL;
  scratch.size = 0;
  scratch.sequence = 0;
  if (ardrone_at_pcmd(&scratch, move, 0) != TVS_OK) return TVS_ERR_ARGUMENT;
  if (!pilot->wants_flight) return TVS_ERR_STATE;
  pilot->moves = 1;
  pilot->move = *move;
  pilot->move_until_ns = now_ns + ARDRONE_MOVE_HOLD_NS;
  return TVS_OK;
}

static tvs_status begin_emergency(ardrone_pilot *pilot, int kind, int64_t now_ns) {
  pilot->active = 1;
  if (pilot->emergency == kind) return TVS_OK;
  pilot->emergency = kind;
  pilot->pulse_start_ns = now_ns;
  pilot->emergency_until_ns = now_ns + EMERGENCY_NS;
  end_flight(pilot);
  return TVS_OK;
}

/* Without the drone's state it is not known whether the bit cuts the motors or re-arms them. A
   request to cut them is carried out all the same. */
tvs_status ardrone_pilot_cut_motors(ardrone_pilot *pilot, int64_t now_ns) {
  if (!pilot) return TVS_ERR_NULL;
  if (pilot->has_state && is_in_emergency(pilot)) return TVS_OK;
  return begin_emergency(pilot, CUT, now_ns);
}

tvs_status ardrone_pilot_rearm(ardrone_pilot *pilot, int64_t now_ns) {
  if (!pilot) return TVS_ERR_NULL;
  if (!pilot->has_state) return TVS_ERR_STATE;
  if (!is_in_emergency(pilot)) return TVS_OK;
  return begin_emergency(pilot, REARM, now_ns);
}

tvs_status ardrone_pilot_flat_trim(ardrone_pilot *pilot) {
  if (!pilot) return TVS_ERR_NULL;
  if (!pilot->has_state || is_flying(pilot) || pilot->wants_flight) return TVS_ERR_STATE;
  pilot->trims_left = NUM_TRIMS;
  return TVS_OK;
}

static int emergency_bit(ardrone_pilot *pilot, int64_t now_ns) {
  int64_t since_ns;
  if (!pilot->emergency) return 0;
  if (now_ns >= pilot->emergency_until_ns) {
    pilot->emergency = 0;
    return 0;
  }
  since_ns = now_ns - pilot->pulse_start_ns;
  /* The bit toggles the state: send another pulse only if a state word after the last pulse shows
     that it had no effect. */
  if (since_ns >= PULSE_PERIOD_NS && (!pilot->has_state || now_ns - pilot->state_ns > FRESH_NS)) {
    return 0;
  }
  return since_ns % PULSE_PERIOD_NS < PULSE_NS;
}

static void write_flight(ardrone_pilot *pilot, int64_t now_ns) {
  if (pilot->moves && now_ns >= pilot->move_until_ns) pilot->moves = 0;
  ardrone_at_ref(&pilot->at, pilot->wants_flight, emergency_bit(pilot, now_ns));
  if (is_flying(pilot) || pilot->wants_flight) {
    ardrone_at_pcmd(&pilot->at, pilot->moves ? &pilot->move : NULL, 0);
  }
}

int ardrone_pilot_tick(ardrone_pilot *pilot, int64_t now_ns) {
  int watchdog;
  if (!pilot || now_ns < pilot->next_tick_ns) return 0;
  pilot->next_tick_ns = now_ns + ARDRONE_TICK_NS;
  pilot->at.size = 0;
  watchdog = pilot->has_state && (pilot->state & ARDRONE_STATE_COM_WATCHDOG) != 0 &&
             (pilot->state & ARDRONE_STATE_BOOTSTRAP) == 0;
  if (watchdog || !pilot->active) ardrone_at_comwdg(&pilot->at);
  if (pilot->active) write_flight(pilot, now_ns);
  if (pilot->trims_left > 0) {
    --pilot->trims_left;
    ardrone_at_ftrim(&pilot->at);
  }
  return 1;
}
