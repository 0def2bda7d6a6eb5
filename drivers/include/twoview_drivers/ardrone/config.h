/* AR.Drone 2.0: the configuration. It reads the text that the drone sends (TCP 5559), checks keys
   and values, and does the handshake that confirms that a value arrived. It uses no socket, heap or
   locale. Layouts from Parrot's SDK, open drivers and captured bytes: docs/drivers.md. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_CONFIG_H
#define TWOVIEW_DRIVERS_ARDRONE_CONFIG_H

#include "twoview_drivers/ardrone/at.h"

TV_BEGIN_DECLS

/* The lengths in bytes of the longest texts, with their terminating zeros. */
enum {
  /* The longest key, "section:name". */
  ARDRONE_KEY_BYTES = 65,
  /* The longest value of a key. */
  ARDRONE_VALUE_BYTES = 257,
  /* An id: 8 hexadecimal digits. */
  ARDRONE_ID_BYTES = 9
};

/* A piece of the caller's text without a terminating zero. */
typedef struct ardrone_span {
  /* The first character of the piece, within the caller's text. */
  const char *text;
  /* The length of the piece, bytes. */
  size_t size;
} ardrone_span;

/* Gets the next `section:key = value` line of a configuration text. Set *offset to 0 before the
   first call; each call advances it. Lines of another form are skipped. TVS_END after the last one.
   Reading stops at a zero byte, with which the drone ends its text. */
TV_API tvs_status ardrone_config_next(const char *text, size_t size, size_t *offset,
                                      ardrone_span *key, ardrone_span *value);

/* Copies the value of one key to `value` as zero-terminated text. TVS_NONE: the key is not there.
   TVS_ERR_CAPACITY: cap_value bytes are too few. */
TV_API tvs_status ardrone_config_find(const char *text, size_t size, const char *key, char *value,
                                      size_t cap_value);

/* Whether an id names a program, a user or a flight. */
typedef enum ardrone_id_kind {
  /* The id names a program. */
  ARDRONE_ID_APPLICATION,
  /* The id names a user. */
  ARDRONE_ID_PROFILE,
  /* The id names a flight. */
  ARDRONE_ID_SESSION
} ardrone_id_kind;

/* Gets the next entry of an id list, which has sections [applis], [profiles], [sessions] and lines
   `id,description`. *kind is the entry's section; hand the same variable to each call. text and
   offset as ardrone_config_next. TVS_END after the last one. */
TV_API tvs_status ardrone_ids_next(const char *text, size_t size, size_t *offset,
                                   ardrone_id_kind *kind, ardrone_span *id,
                                   ardrone_span *description);

/* Whether a value may be sent for a key. TVS_OK: the value is in the key's range. TVS_NONE: this
   driver does not know the key, as it may belong to other firmware; key and value have a valid form
   and may be sent. TVS_ERR_ARGUMENT: the value is out of range or of the wrong kind, the text
   cannot be sent, or the key can only be read. */
TV_API tvs_status ardrone_config_check(const char *key, const char *value);

/* 1 when the drone accepts this key only under ids (multi-configuration), else 0. */
TV_API int ardrone_config_needs_ids(const char *key);

/* Writes a number to `text` as the drone reads it: with a dot in every locale and `digits` digits
   after it. Use six digits, and nine for the degrees of the GPS keys. digits is in [0, 9], |value|
   < 10^9. text has cap_text bytes, the terminating zero included. Returns TVS_ERR_NULL,
   TVS_ERR_ARGUMENT, TVS_ERR_CAPACITY. */
TV_API tvs_status ardrone_format_number(double value, int digits, char *text, size_t cap_text);

/* Writes the value of leds:leds_anim: animation, hertz as float bits, seconds. text, cap_text and
   statuses as ardrone_format_number. */
TV_API tvs_status ardrone_format_led(int animation, float hertz, int seconds, char *text,
                                     size_t cap_text);

/* Makes an id from a name: its CRC-32 in 8 hexadecimal digits, never 00000000. */
TV_API void ardrone_make_id(const char *name, char id[ARDRONE_ID_BYTES]);

/* The values that the key video:video_codec may have. */
typedef enum ardrone_video_codec {
  /* 640x360 on the live stream. */
  ARDRONE_VIDEO_H264_360P = 129,
  /* 640x360 on the live stream and 1280x720 on the recording stream. */
  ARDRONE_VIDEO_H264_360P_RECORD_720P = 130,
  /* 1280x720 on the live stream; the key is accepted only under ids. */
  ARDRONE_VIDEO_H264_720P = 131,
  /* 640x360 on the live stream and on the recording stream. */
  ARDRONE_VIDEO_H264_360P_RECORD_360P = 136
} ardrone_video_codec;

/* ---- The handshake: one exchange at a time, over a lossy link ----------------------------------
   clear the acknowledge bit -> send -> wait for the bit, or for the whole text that was requested
   -> CTRL 5 until the bit is clear -> done. */

/* The purpose of an exchange. */
typedef enum ardrone_exchange_kind {
  /* The exchange sets one key. */
  ARDRONE_EXCHANGE_SET,
  /* The exchange requests the configuration with CTRL 4; its text comes on TCP 5559. */
  ARDRONE_EXCHANGE_READ_CONFIG,
  /* The exchange requests the lists of ids with CTRL 6; their text comes on TCP 5559. */
  ARDRONE_EXCHANGE_READ_IDS
} ardrone_exchange_kind;

/* The step that an exchange has reached. */
typedef enum ardrone_exchange_state {
  /* No exchange was begun. */
  ARDRONE_EXCHANGE_IDLE,
  /* Waits until navdata shows that no old acknowledge bit is set; clears one that is. */
  ARDRONE_EXCHANGE_CLEARING,
  /* The command is to be sent at the next tick. */
  ARDRONE_EXCHANGE_SENDING,
  /* The command was sent; the bit, or the text, has not come yet. */
  ARDRONE_EXCHANGE_WAITING,
  /* The bit, or the text, came; CTRL 5 is sent while the bit is set. */
  ARDRONE_EXCHANGE_RELEASING,
  /* The drone acknowledged the command, or the whole text has come. */
  ARDRONE_EXCHANGE_DONE,
  /* The exchange was not done within ARDRONE_EXCHANGE_TIMEOUT_NS. */
  ARDRONE_EXCHANGE_FAILED
} ardrone_exchange_state;

/* An exchange in the caller's memory. Its fields are private except for `state`. */
typedef struct ardrone_exchange {
  ardrone_exchange_state state;
  ardrone_exchange_kind kind;
  int num_sent, has_ids, saw_bit;
  int64_t step_ns, next_send_ns, deadline_ns;
  char key[ARDRONE_KEY_BYTES], value[ARDRONE_VALUE_BYTES];
  char session[ARDRONE_ID_BYTES], user[ARDRONE_ID_BYTES], application[ARDRONE_ID_BYTES];
} ardrone_exchange;

/* How long a step waits before its command is sent again with a new sequence number, ns. */
#define ARDRONE_EXCHANGE_STEP_NS INT64_C(500000000)
/* The longest time that a whole exchange may take, ns. */
#define ARDRONE_EXCHANGE_TIMEOUT_NS INT64_C(5000000000)

/* Begins an exchange. key and value are read for ARDRONE_EXCHANGE_SET only. ids is null, or
   {session, user, application}, which are sent before the command. now_ns, here and below, is the
   time of one clock of the caller. TVS_ERR_NULL: the exchange, an id, or key or value of a SET is
   null; TVS_ERR_STATE: an exchange is under way; TVS_ERR_ARGUMENT: ardrone_config_check refuses the
   value, an id is not 8 hexadecimal digits, or kind is none of the above. */
TV_API tvs_status ardrone_exchange_begin(ardrone_exchange *exchange, ardrone_exchange_kind kind,
                                         const char *key, const char *value,
                                         const char *const ids[3], int64_t now_ns);

/* Hand over the state word of every accepted navdata packet. */
TV_API void ardrone_exchange_navdata(ardrone_exchange *exchange, uint32_t state, int64_t now_ns);

/* Call it when the whole text of a READ has come. */
TV_API void ardrone_exchange_text(ardrone_exchange *exchange, int64_t now_ns);

/* Call it at each tick: it appends the command that is due, if there is one, and checks the
   time-outs. Returns TVS_OK; TVS_ERR_NULL; TVS_ERR_CAPACITY: this datagram has no room, and the
   command goes into the next. */
TV_API tvs_status ardrone_exchange_tick(ardrone_exchange *exchange, ardrone_at *at, int64_t now_ns);

TV_END_DECLS

#endif
