/* AR.Drone 2.0: AT commands, the text that controls the drone (UDP 5556). It writes bytes from
   structs and uses no socket, heap, clock or locale.

   A command is `AT*NAME=<sequence>[,argument...]` and a carriage return. Several commands share a
   datagram; none is split. The drone obeys a command whose number is greater than the last one it
   obeyed; the number 1 starts the count again. The raw motor command is left out on purpose.
   Layouts from Parrot's SDK, open drivers and captured bytes: docs/drivers.md. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_AT_H
#define TWOVIEW_DRIVERS_ARDRONE_AT_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

/* The drone refuses a longer line, and this driver never writes a longer datagram. */
enum { ARDRONE_AT_MAX_BYTES = 1024 };

/* One datagram being written. Start with zeros; set `size` to 0 for the next datagram and
   `sequence` to 0 for another link. Every function below appends one command. On an error it
   appends nothing and uses no number. The errors are TVS_ERR_NULL; TVS_ERR_ARGUMENT: an argument
   out of range (NaN included), a key without a section, or text with a quote, a control character,
   or a comma or blank where none may be; TVS_ERR_CAPACITY: the command does not fit in the rest of
   the datagram. An empty datagram has room for any command. After the sequence number INT32_MAX - 1
   the numbers start again at 1, as the drone allows. */
typedef struct ardrone_at {
  /* The text of the commands written so far. */
  char text[ARDRONE_AT_MAX_BYTES];
  /* The number of bytes of text in use; there is no terminating zero. */
  size_t size;
  /* The sequence number of the last command. */
  int32_t sequence;
} ardrone_at;

/* The requested flight state; send it with every datagram. take_off: 1 requests flight, 0 landing.
   emergency: when it rises from 0 to 1 the drone cuts the motors, or in an emergency re-arms them;
   ardrone/pilot.h sends that edge. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_ref(ardrone_at *at, int take_off, int emergency);

/* How to move, as fractions of the configured limits. Positive are roll to the right, pitch
   backward (nose up), climb upwards and turn clockwise from above. */
typedef struct ardrone_move {
  /* Each component is in [-1, 1]. */
  float roll, pitch, climb, turn;
} ardrone_move;

/* The flags that ardrone_at_pcmd accepts. */
enum {
  /* Turn and roll together fly a curve. */
  ARDRONE_PCMD_COMBINED_YAW = 2,
  /* Roll and pitch are relative to the controller's heading, by the magnetometer. */
  ARDRONE_PCMD_ABSOLUTE = 4
};

/* Sends a movement; a null move means "hover". flags: ARDRONE_PCMD_ bits. Statuses as of every
   command (ardrone_at). */
TV_API tvs_status ardrone_at_pcmd(ardrone_at *at, const ardrone_move *move, int flags);

/* Sends a movement with the controller's heading and its accuracy, fractions of pi in [-1, 1] and
   [0, 1]. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_pcmd_mag(ardrone_at *at, const ardrone_move *move, int flags,
                                      float heading, float accuracy);

/* Flat trim: send it while the drone stands level on the ground; the drone takes its present
   attitude as level from then on. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_ftrim(ardrone_at *at);

/* Calibrates a device in flight. Device 0 is the magnetometer; the drone turns about its axis.
   Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_calib(ardrone_at *at, int device);

/* Clears the communication watchdog. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_comwdg(ardrone_at *at);

/* Sets a key, "section:name" of 1 to 64 bytes, to a value of at most 256 bytes, which may be empty.
   Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_config(ardrone_at *at, const char *key, const char *value);

/* The ids under which the next ardrone_at_config sets its key: session, user and application, 8
   hexadecimal digits each. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_config_ids(ardrone_at *at, const char *session, const char *user,
                                        const char *application);

/* The requests that ardrone_at_ctrl can make. */
typedef enum ardrone_control_mode {
  /* The drone does nothing. */
  ARDRONE_CTRL_NONE = 0,
  /* The drone sends the configuration on TCP 5559. */
  ARDRONE_CTRL_SEND_CONFIG = 4,
  /* The drone clears the acknowledge bit of its state word. */
  ARDRONE_CTRL_ACKNOWLEDGE = 5,
  /* The drone sends the lists of ids on TCP 5559. */
  ARDRONE_CTRL_SEND_IDS = 6
} ardrone_control_mode;

/* Requests the configuration or the ids, or clears the acknowledge bit. Statuses as of every
   command (ardrone_at). */
TV_API tvs_status ardrone_at_ctrl(ardrone_at *at, ardrone_control_mode mode);

enum {
  /* Flight animations, such as flips, have the numbers from 0 to one less than this. */
  ARDRONE_NUM_FLIGHT_ANIMATIONS = 20,
  /* Blinking patterns have the numbers from 0 to one less than this. */
  ARDRONE_NUM_LED_ANIMATIONS = 21
};

/* Starts a flight animation of `milliseconds` in [0, 60000]. This is the old form; the present one
   is the key control:flight_anim (ardrone/config.h). Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_anim(ardrone_at *at, int animation, int milliseconds);

/* Starts blinking with hertz in (0, 100] for seconds in [0, 3600]. This is the old form; the
   present one is the key leds:leds_anim. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_led(ardrone_at *at, int animation, float hertz, int seconds);

/* Commands of old firmware and of Parrot's own tools. The meaning of their arguments is not
   documented; this driver writes them unchanged. */
typedef enum ardrone_legacy {
  /* The command has 1 argument. */
  ARDRONE_PMODE,
  /* The command has 4 arguments. */
  ARDRONE_MISC,
  /* The command has 13 arguments: the gains of the control loops. */
  ARDRONE_GAIN,
  /* The command has 9 arguments: parameters of the on-board vision. */
  ARDRONE_VISP,
  /* The command has 1 argument: options of the on-board vision. */
  ARDRONE_VISO,
  /* The command has 2 arguments, which choose raw or compressed video. */
  ARDRONE_CAP,
  /* The command has 1 argument: which camera is sent; the present form is the key
     video:video_channel. */
  ARDRONE_ZAP,
  /* The command has 2 arguments: which printed tags are looked for. */
  ARDRONE_CAD,
  /* The command has 3 arguments: a trim by hand. */
  ARDRONE_MTRIM,
  /* The command has 5 arguments for "polaris", positions by printed tags. */
  ARDRONE_POL,
  /* The command has 1 argument for autonomous flight. */
  ARDRONE_AFLIGHT,
  /* The command has 22 arguments: a pose measured from outside. */
  ARDRONE_VICON,
  /* The number of the commands above. */
  ARDRONE_NUM_LEGACY
} ardrone_legacy;

/* Appends a command of ardrone_legacy. arguments holds num_arguments numbers, which is as many as
   the command has. Statuses as of every command (ardrone_at). */
TV_API tvs_status ardrone_at_legacy(ardrone_at *at, ardrone_legacy command,
                                    const int32_t *arguments, int num_arguments);

/* Converts a float to what a command holds: its IEEE 754 bits as a signed number. -0.0
   becomes 0. */
TV_API int32_t ardrone_float_bits(float value);

TV_END_DECLS

#endif
