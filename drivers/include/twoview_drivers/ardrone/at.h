/* AR.Drone 2.0: AT commands, the text that flies it (UDP 5556). Pure: structs in, bytes out; no
   socket, no heap, no clock, no locale.

   A command is `AT*NAME=<sequence>[,argument...]` and a carriage return. Several share a datagram, none
   is split. The drone obeys only numbers greater than the last it obeyed; 1 begins anew. The raw
   motor command is left out on purpose.
   Layouts from Parrot's SDK, open drivers and captured bytes: docs/drivers.md. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_AT_H
#define TWOVIEW_DRIVERS_ARDRONE_AT_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

/* The drone refuses a longer line; a datagram of ours is never longer either. */
enum { ARDRONE_AT_MAX_BYTES = 1024 };

/* One datagram being written. Start with zeros; `size` back to 0 begins the next datagram, `sequence`
   back to 0 another link. Every function below appends one command, or returns an error and appends
   nothing and uses no number: TVS_ERR_NULL; TVS_ERR_ARGUMENT, an argument out of range (NaN included) or
   text with a quote, a comma where none may be, or a control character; TVS_ERR_CAPACITY, it does not fit in what is
   left (never, for an empty datagram: longer than 1024 bytes). After sequence INT32_MAX - 1 the
   numbers start again at 1, as the drone allows. */
typedef struct ardrone_at {
  char text[ARDRONE_AT_MAX_BYTES]; /* the commands so far */
  size_t size;      /* bytes of text in use; no terminating zero */
  int32_t sequence; /* the last number used */
} ardrone_at;

/* Flight state wanted; level-sensitive, so repeated every tick. take_off: 1 asks to fly, 0 to land.
   emergency: the drone acts when it rises from 0 to 1: it cuts the motors, or in an emergency re-arms
   them. ardrone/pilot.h makes it an edge. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_ref(ardrone_at *at, int take_off, int emergency);

/* How to move: fractions of the configured limits, each in [-1, 1]. roll + right, pitch + backward
   (nose up), climb + up, turn + clockwise from above. */
typedef struct ardrone_move {
  float roll, pitch, climb, turn; /* [-1, 1] */
} ardrone_move;

/* Flags of ardrone_at_pcmd. */
enum {
  ARDRONE_PCMD_COMBINED_YAW = 2, /* a turn while rolling flies a curve */
  ARDRONE_PCMD_ABSOLUTE = 4      /* roll and pitch are seen from the controller, by the magnetometer */
};

/* A movement. A null move is "hover". flags: ARDRONE_PCMD_ bits. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_pcmd(ardrone_at *at, const ardrone_move *move, int flags);
/* ardrone_at_pcmd with the controller's heading and its accuracy, fractions of pi in [-1, 1] and [0, 1].
   Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_pcmd_mag(ardrone_at *at, const ardrone_move *move, int flags,
                                      float heading, float accuracy);

/* Flat trim: the drone stands level, on the ground. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_ftrim(ardrone_at *at);
/* Calibrates a device, in flight: 0, the magnetometer, for which the drone spins.
   Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_calib(ardrone_at *at, int device);
/* Clears the communication watchdog. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_comwdg(ardrone_at *at);

/* Sets a key, "section:name" of 1 to 64 bytes; value: up to 256 bytes, may be empty.
   Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_config(ardrone_at *at, const char *key, const char *value);
/* Under which ids the next ardrone_at_config counts: session, user and application, 8 hexadecimal digits
   each. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_config_ids(ardrone_at *at, const char *session, const char *user,
                                        const char *application);

/* What ardrone_at_ctrl asks for. */
typedef enum ardrone_control_mode {
  ARDRONE_CTRL_NONE = 0,        /* nothing */
  ARDRONE_CTRL_SEND_CONFIG = 4, /* the configuration, on TCP 5559 */
  ARDRONE_CTRL_ACKNOWLEDGE = 5, /* clears the state's acknowledge bit */
  ARDRONE_CTRL_SEND_IDS = 6     /* the lists of ids, on TCP 5559 */
} ardrone_control_mode;

/* Asks for the configuration, for the ids, or clears the acknowledge bit. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_ctrl(ardrone_at *at, ardrone_control_mode mode);

enum {
  ARDRONE_NUM_FLIGHT_ANIMATIONS = 20, /* flips and the like, from 0 */
  ARDRONE_NUM_LED_ANIMATIONS = 21     /* blinking patterns, from 0 */
};

/* A flight animation, milliseconds in [0, 60000], in its old form: today's is the key control:flight_anim
   (ardrone/config.h). Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_anim(ardrone_at *at, int animation, int milliseconds);
/* Blinking, hertz in (0, 100], seconds in [0, 3600], in its old form: today's is the key leds:leds_anim.
   Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_led(ardrone_at *at, int animation, float hertz, int seconds);

/* Commands of old firmware and of Parrot's own tools. What their arguments mean is Parrot's affair: this
   driver writes them as they stand. */
typedef enum ardrone_legacy {
  ARDRONE_PMODE,     /* 1 argument */
  ARDRONE_MISC,      /* 4 arguments */
  ARDRONE_GAIN,      /* 13 arguments: the control loops' gains */
  ARDRONE_VISP,      /* 9 arguments: parameters of the on-board vision */
  ARDRONE_VISO,      /* 1 argument: its options */
  ARDRONE_CAP,       /* 2 arguments: raw or compressed video */
  ARDRONE_ZAP,       /* 1 argument: which camera is sent; today's is the key video:video_channel */
  ARDRONE_CAD,       /* 2 arguments: which tags are looked for */
  ARDRONE_MTRIM,     /* 3 arguments: trim by hand */
  ARDRONE_POL,       /* 5 arguments: polaris, tags for positions */
  ARDRONE_AFLIGHT,   /* 1 argument: flight by itself */
  ARDRONE_VICON,     /* 22 arguments: a pose measured from outside */
  ARDRONE_NUM_LEGACY /* how many there are */
} ardrone_legacy;

/* Appends one of them; arguments: num_arguments numbers, as many as the command has.
   Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_legacy(ardrone_at *at, ardrone_legacy command,
                                    const int32_t *arguments, int num_arguments);

/* What a float becomes in a command: its IEEE 754 bits as a signed number. -0.0 becomes 0. */
TV_API int32_t ardrone_float_bits(float value);

TV_END_DECLS

#endif
