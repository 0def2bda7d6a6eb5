/* AR.Drone 2.0: AT commands, the text that flies it (UDP 5556). Pure: structs in, bytes out; no
   socket, no heap, no clock, no locale.

   A command is `AT*NAME=<sequence>[,argument...]` and a carriage return. Several share a datagram, none
   is split. The drone obeys only numbers greater than the last it obeyed; 1 begins anew. The raw
   motor command is left out on purpose. */
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
  char text[ARDRONE_AT_MAX_BYTES];
  size_t size;      /* bytes of text in use; no terminating zero */
  int32_t sequence; /* the last number used */
} ardrone_at;

/* Flight state wanted; level-sensitive, so repeated every tick. take_off: 1 asks to fly, 0 to land.
   emergency: the drone acts when it rises from 0 to 1: it cuts the motors, or in an emergency re-arms
   them. ardrone/pilot.h makes it an edge. */
TV_API tvs_status ardrone_at_ref(ardrone_at *at, int take_off, int emergency);

/* How to move: fractions of the configured limits, each in [-1, 1]. roll + right, pitch + backward
   (nose up), climb + up, turn + clockwise from above. */
typedef struct ardrone_move {
  float roll, pitch, climb, turn;
} ardrone_move;

enum { ARDRONE_PCMD_COMBINED_YAW = 2, ARDRONE_PCMD_ABSOLUTE = 4 };

/* A null move is "hover". flags: ARDRONE_PCMD_ bits. */
TV_API tvs_status ardrone_at_pcmd(ardrone_at *at, const ardrone_move *move, int flags);
/* With the controller's heading and its accuracy, fractions of pi in [-1, 1] and [0, 1]. */
TV_API tvs_status ardrone_at_pcmd_mag(ardrone_at *at, const ardrone_move *move, int flags,
                                      float heading, float accuracy);

TV_API tvs_status ardrone_at_ftrim(ardrone_at *at);          /* the drone stands level, on the ground */
TV_API tvs_status ardrone_at_calib(ardrone_at *at, int device); /* 0: magnetometer; spins in flight */
TV_API tvs_status ardrone_at_comwdg(ardrone_at *at);         /* clears the communication watchdog */

/* key "section:name", 1 to 64 bytes; value up to 256 bytes, may be empty. */
TV_API tvs_status ardrone_at_config(ardrone_at *at, const char *key, const char *value);
/* Each id is 8 hexadecimal digits. */
TV_API tvs_status ardrone_at_config_ids(ardrone_at *at, const char *session, const char *user,
                                        const char *application);

typedef enum ardrone_control_mode {
  ARDRONE_CTRL_NONE = 0,
  ARDRONE_CTRL_SEND_CONFIG = 4, /* on TCP 5559 */
  ARDRONE_CTRL_ACKNOWLEDGE = 5, /* clears the state's acknowledge bit */
  ARDRONE_CTRL_SEND_IDS = 6     /* on TCP 5559 */
} ardrone_control_mode;
TV_API tvs_status ardrone_at_ctrl(ardrone_at *at, ardrone_control_mode mode);

enum { ARDRONE_NUM_FLIGHT_ANIMATIONS = 20, ARDRONE_NUM_LED_ANIMATIONS = 21 };
/* The old forms; today's are the keys control:flight_anim and leds:leds_anim (ardrone/config.h).
   milliseconds in [0, 60000], hertz in (0, 100], seconds in [0, 3600]. */
TV_API tvs_status ardrone_at_anim(ardrone_at *at, int animation, int milliseconds);
TV_API tvs_status ardrone_at_led(ardrone_at *at, int animation, float hertz, int seconds);

/* Commands of old firmware and of Parrot's own tools, arguments as they stand: PMODE 1, MISC 4, GAIN 13,
   VISP 9, VISO 1, CAP 2, ZAP 1, CAD 2, MTRIM 3, POL 5, AFLIGHT 1, VICON 22 arguments. */
typedef enum ardrone_legacy {
  ARDRONE_PMODE, ARDRONE_MISC, ARDRONE_GAIN, ARDRONE_VISP, ARDRONE_VISO, ARDRONE_CAP, ARDRONE_ZAP,
  ARDRONE_CAD, ARDRONE_MTRIM, ARDRONE_POL, ARDRONE_AFLIGHT, ARDRONE_VICON, ARDRONE_NUM_LEGACY
} ardrone_legacy;
TV_API tvs_status ardrone_at_legacy(ardrone_at *at, ardrone_legacy command,
                                    const int32_t *arguments, int num_arguments);

/* What a float becomes in a command: its IEEE 754 bits as a signed number. -0.0 becomes 0. */
TV_API int32_t ardrone_float_bits(float value);

TV_END_DECLS

#endif
