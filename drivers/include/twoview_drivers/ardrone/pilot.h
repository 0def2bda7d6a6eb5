/* AR.Drone 2.0: which commands are sent when. A state machine without sockets, heap or a clock of
   its own; the caller's clock and the drone's state word drive it, and it writes AT commands. It
   keeps these safety rules:
   - until the first flight call it sends keep-alives, and requested flat trims, only;
   - it sends a take-off only after ardrone_pilot_take_off. That request ends, and the pilot sends
     "land" from then on, when the drone lands by itself, at an emergency or a request for one, when
     the link is lost, and after 20 s without leaving the ground;
   - a movement that is not renewed ends after ARDRONE_MOVE_HOLD_NS and becomes "hover";
   - the drone acts when the emergency bit rises, so the pilot sends it in pulses until the drone's
     state is the one that was requested, for at most 3 s. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_PILOT_H
#define TWOVIEW_DRIVERS_ARDRONE_PILOT_H

#include "twoview_drivers/ardrone/at.h"

TV_BEGIN_DECLS

/* The time between two datagrams, ns. After 50 ms without a command the drone sets its watchdog
   bit. */
#define ARDRONE_TICK_NS INT64_C(30000000)
/* How long a movement lasts unless it is renewed, ns. */
#define ARDRONE_MOVE_HOLD_NS INT64_C(500000000)

/* The caller owns it. Private: only tests read its fields. */
typedef struct ardrone_pilot {
  /* The datagram being written, and the link's sequence number. */
  ardrone_at at;
  /* When the next datagram is due, ns of the caller's clock; INT64_MIN: at once. */
  int64_t next_tick_ns;
  /* The latest state word of the drone. */
  uint32_t state;
  int has_state;
  /* When the latest state word came, ns of the caller's clock. */
  int64_t state_ns;
  /* 1 after the first take-off, landing, cutting or re-arming was requested. */
  int active;
  int wants_flight;
  int was_flying;
  int64_t take_off_ns;
  int moves;
  ardrone_move move;
  int64_t move_until_ns;
  /* The emergency request: 0: none; 1: cut the motors; 2: re-arm them. */
  int emergency;
  int64_t pulse_start_ns, emergency_until_ns;
  int trims_left;
} ardrone_pilot;

/* Starts without a link and without a request to fly. Null is allowed. */
TV_API void ardrone_pilot_init(ardrone_pilot *pilot);

/* Call it when a link begins or is lost: sequence numbers start again at 1, the drone's state is
   unknown, and the request to fly ends. */
TV_API void ardrone_pilot_new_link(ardrone_pilot *pilot);

/* Hand over the state word of every accepted navdata packet. */
TV_API void ardrone_pilot_state(ardrone_pilot *pilot, uint32_t state, int64_t now_ns);

/* Requests flight until one of the rules above ends the request. Returns TVS_ERR_NULL;
   TVS_ERR_STATE: the drone's state is not known, it is in an emergency, or cutting or re-arming the
   motors is under way. */
TV_API tvs_status ardrone_pilot_take_off(ardrone_pilot *pilot, int64_t now_ns);

/* Ends the request to fly: the pilot sends "land". Returns TVS_ERR_NULL. */
TV_API tvs_status ardrone_pilot_land(ardrone_pilot *pilot);

/* Ends the movement: the pilot sends "hover". Returns TVS_ERR_NULL. */
TV_API tvs_status ardrone_pilot_hover(ardrone_pilot *pilot);

/* Moves for ARDRONE_MOVE_HOLD_NS. Returns TVS_ERR_NULL; TVS_ERR_ARGUMENT: a component outside [-1,
   1]; TVS_ERR_STATE: flight was not requested. */
TV_API tvs_status ardrone_pilot_move(ardrone_pilot *pilot, const ardrone_move *move,
                                     int64_t now_ns);

/* Emergency: the motors stop and the drone falls. Does nothing where the drone's last state word
   reports an emergency already, also while it is being re-armed. Returns TVS_ERR_NULL. */
TV_API tvs_status ardrone_pilot_cut_motors(ardrone_pilot *pilot, int64_t now_ns);

/* Ends an emergency. Does nothing where there is none. Returns TVS_ERR_NULL; TVS_ERR_STATE: the
   drone's state is not known. */
TV_API tvs_status ardrone_pilot_rearm(ardrone_pilot *pilot, int64_t now_ns);

/* Flat trim: call it while the drone stands level on the ground; the drone takes its present
   attitude as level from then on. Returns TVS_ERR_NULL; TVS_ERR_STATE: the drone's state is not
   known, it flies, or flight was requested. */
TV_API tvs_status ardrone_pilot_flat_trim(ardrone_pilot *pilot);

/* Returns 1 when a datagram is due: it lies in pilot->at, the caller may append commands and then
   sends it. Returns 0 when none is due. */
TV_API int ardrone_pilot_tick(ardrone_pilot *pilot, int64_t now_ns);

TV_END_DECLS

#endif
