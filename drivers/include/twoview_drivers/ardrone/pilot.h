/* AR.Drone 2.0: what is sent when. A pure state machine, driven by the caller's clock and the drone's
   state word; it writes AT commands and knows the safety rules:
   - nothing is sent that was not asked for: until the first flight call only keep-alives go out;
   - a take-off is sent after ardrone_pilot_take_off alone. Landing by itself, an emergency, a lost link, 20 s
     without leaving the ground: each ends the wish, and the drone is told to land;
   - a movement ends by itself and becomes "hover";
   - the emergency bit is an edge: pulses, until the drone's state says what was wanted. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_PILOT_H
#define TWOVIEW_DRIVERS_ARDRONE_PILOT_H

#include "twoview_drivers/ardrone/at.h"

TV_BEGIN_DECLS

/* How often commands go out; after 50 ms without one the drone raises its watchdog bit. */
#define ARDRONE_TICK_NS INT64_C(30000000)
/* How long a movement holds unless it is renewed. */
#define ARDRONE_MOVE_HOLD_NS INT64_C(500000000)

/* The caller's struct; private but for the tests. */
typedef struct ardrone_pilot {
  ardrone_at at;        /* the datagram under way, and the link's sequence number */
  int64_t next_tick_ns; /* INT64_MIN: at once */
  uint32_t state;       /* the drone's latest state word */
  int has_state;
  int64_t state_ns;     /* when it came */
  int active;           /* a flight call was made */
  int wants_flight;
  int was_flying;
  int64_t take_off_ns;
  int moves;
  ardrone_move move;
  int64_t move_until_ns;
  int emergency;        /* 0 no, 1 cut the motors, 2 re-arm them */
  int64_t pulse_start_ns, emergency_until_ns;
  int trims_left;
} ardrone_pilot;

/* No link, no wish; null is allowed. */
TV_API void ardrone_pilot_init(ardrone_pilot *pilot);

/* The link is new, or was lost: sequence numbers start again at 1, the drone's state is unknown, the
   wish to fly ends. */
TV_API void ardrone_pilot_new_link(ardrone_pilot *pilot);

/* The state word of every accepted navdata packet. */
TV_API void ardrone_pilot_state(ardrone_pilot *pilot, uint32_t state, int64_t now_ns);

/* The wish to fly, until something ends it (above). Returns TVS_ERR_NULL; TVS_ERR_STATE: the drone's state is
   not known, or it is in an emergency. */
TV_API tvs_status ardrone_pilot_take_off(ardrone_pilot *pilot, int64_t now_ns);
/* Ends the wish to fly: the drone is told to land. Returns TVS_ERR_NULL. */
TV_API tvs_status ardrone_pilot_land(ardrone_pilot *pilot);
/* Ends a movement. Returns TVS_ERR_NULL. */
TV_API tvs_status ardrone_pilot_hover(ardrone_pilot *pilot);
/* A movement, for ARDRONE_MOVE_HOLD_NS. Returns TVS_ERR_NULL; TVS_ERR_ARGUMENT: a component outside [-1, 1];
   TVS_ERR_STATE: there is no wish to fly. */
TV_API tvs_status ardrone_pilot_move(ardrone_pilot *pilot, const ardrone_move *move, int64_t now_ns);
/* Emergency: the motors stop and the drone falls. Nothing to do where it is in an emergency already.
   Returns TVS_ERR_NULL, TVS_ERR_STATE (re-arming is under way). */
TV_API tvs_status ardrone_pilot_cut_motors(ardrone_pilot *pilot, int64_t now_ns);
/* Out of an emergency. Nothing to do where there is none. Returns TVS_ERR_NULL; TVS_ERR_STATE: the drone's state
   is not known. */
TV_API tvs_status ardrone_pilot_rearm(ardrone_pilot *pilot, int64_t now_ns);
/* The drone stands level, on the ground. Returns TVS_ERR_NULL; TVS_ERR_STATE: its state is not known, it flies,
   or is to fly. */
TV_API tvs_status ardrone_pilot_flat_trim(ardrone_pilot *pilot);

/* When a tick is due, begins a datagram in pilot->at, writes what it is to hold, and returns 1: the
   caller may append to it and sends it. 0: not yet. */
TV_API int ardrone_pilot_tick(ardrone_pilot *pilot, int64_t now_ns);

TV_END_DECLS

#endif
