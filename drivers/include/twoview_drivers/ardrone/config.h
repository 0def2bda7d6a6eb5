/* AR.Drone 2.0: its configuration: the text it sends (TCP 5559), the keys one can set, and the
   handshake that makes sure that a value arrived. Pure: no socket, no heap, no locale.
   Layouts from Parrot's SDK, open drivers and captured bytes: docs/drivers.md. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_CONFIG_H
#define TWOVIEW_DRIVERS_ARDRONE_CONFIG_H

#include "twoview_drivers/ardrone/at.h"

TV_BEGIN_DECLS

/* The longest texts, with their zeros. */
enum {
  ARDRONE_KEY_BYTES = 65,    /* "section:name" */
  ARDRONE_VALUE_BYTES = 257, /* a value */
  ARDRONE_ID_BYTES = 9       /* 8 hexadecimal digits */
};

/* A piece of the caller's text; not zero-terminated. */
typedef struct ardrone_span {
  const char *text; /* its first character, within the caller's text */
  size_t size;      /* bytes */
} ardrone_span;

/* The next `section:key = value` line of a configuration text. *offset starts at 0 and moves on. Lines of
   another form are passed over. TVS_END after the last one. The drone ends its text with a zero byte:
   reading stops there. */
TV_API tvs_status ardrone_config_next(const char *text, size_t size, size_t *offset,
                                      ardrone_span *key, ardrone_span *value);
/* The value of one key, as zero-terminated text. TVS_NONE: not there. TVS_ERR_CAPACITY. */
TV_API tvs_status ardrone_config_find(const char *text, size_t size, const char *key, char *value,
                                      size_t cap_value);

/* Whose settings an id names. */
typedef enum ardrone_id_kind {
  ARDRONE_ID_APPLICATION, /* a program */
  ARDRONE_ID_PROFILE,     /* a user */
  ARDRONE_ID_SESSION      /* a flight */
} ardrone_id_kind;

/* The next entry of an id list: sections [applis], [profiles], [sessions], lines `id,description`.
   *kind carries the section from call to call; it is read only after the first heading. text and
   *offset as ardrone_config_next; TVS_END after the last one. */
TV_API tvs_status ardrone_ids_next(const char *text, size_t size, size_t *offset,
                                   ardrone_id_kind *kind, ardrone_span *id,
                                   ardrone_span *description);

/* Whether a value may be sent for a key. TVS_OK: it is in the key's range. TVS_NONE: a key that this driver does
   not know (another firmware's), of valid form: it may be sent as it is. TVS_ERR_ARGUMENT: out of
   range, of the wrong kind, not sendable, or a key that can only be read. */
TV_API tvs_status ardrone_config_check(const char *key, const char *value);
/* Whether the drone takes this key only under ids of one's own (multi-configuration). */
TV_API int ardrone_config_needs_ids(const char *key);

/* A number as the drone reads it, with a dot whatever the locale and `digits` digits after it: six, or nine
   for degrees of the GPS keys. |value| < 10^9. text: cap_text bytes, the zero included.
   TVS_ERR_NULL, TVS_ERR_ARGUMENT, TVS_ERR_CAPACITY. */
TV_API tvs_status ardrone_format_number(double value, int digits, char *text, size_t cap_text);
/* The value of leds:leds_anim: animation, hertz as float bits, seconds. text, cap_text and statuses as
   ardrone_format_number. */
TV_API tvs_status ardrone_format_led(int animation, float hertz, int seconds, char *text,
                                     size_t cap_text);
/* An id from any name: CRC-32, 8 hexadecimal digits, never 00000000. */
TV_API void ardrone_make_id(const char *name, char id[ARDRONE_ID_BYTES]);

/* Values of video:video_codec. */
typedef enum ardrone_video_codec {
  ARDRONE_VIDEO_H264_360P = 129,             /* 640x360 live */
  ARDRONE_VIDEO_H264_360P_RECORD_720P = 130, /* and 1280x720 on the recording stream */
  ARDRONE_VIDEO_H264_720P = 131,             /* 1280x720 live; needs ids */
  ARDRONE_VIDEO_H264_360P_RECORD_360P = 136  /* 640x360 on both */
} ardrone_video_codec;

/* ---- The handshake: one exchange at a time, over a lossy link ----------------------------------
   clear the acknowledge bit -> send -> wait for the bit -> CTRL 5 until it is clear -> done. */

/* What an exchange is for. */
typedef enum ardrone_exchange_kind {
  ARDRONE_EXCHANGE_SET,         /* one key */
  ARDRONE_EXCHANGE_READ_CONFIG, /* CTRL 4: the text comes on TCP 5559 */
  ARDRONE_EXCHANGE_READ_IDS     /* CTRL 6 */
} ardrone_exchange_kind;

/* Where an exchange stands. */
typedef enum ardrone_exchange_state {
  ARDRONE_EXCHANGE_IDLE,      /* none was begun */
  ARDRONE_EXCHANGE_CLEARING,  /* an old acknowledge bit is still set */
  ARDRONE_EXCHANGE_SENDING,   /* the command is due */
  ARDRONE_EXCHANGE_WAITING,   /* for the bit, or for the text */
  ARDRONE_EXCHANGE_RELEASING, /* CTRL 5 until the bit is clear */
  ARDRONE_EXCHANGE_DONE,      /* acknowledged, or the text has come */
  ARDRONE_EXCHANGE_FAILED     /* not within ARDRONE_EXCHANGE_TIMEOUT_NS */
} ardrone_exchange_state;

/* The caller's struct; private but for `state`. */
typedef struct ardrone_exchange {
  ardrone_exchange_state state;
  ardrone_exchange_kind kind;
  int num_sent, has_ids, saw_bit;
  int64_t step_ns, next_send_ns, deadline_ns;
  char key[ARDRONE_KEY_BYTES], value[ARDRONE_VALUE_BYTES];
  char session[ARDRONE_ID_BYTES], user[ARDRONE_ID_BYTES], application[ARDRONE_ID_BYTES];
} ardrone_exchange;

/* How long one step waits before its command is sent again, with a new sequence number. */
#define ARDRONE_EXCHANGE_STEP_NS INT64_C(500000000)
/* How long an exchange may take in all. */
#define ARDRONE_EXCHANGE_TIMEOUT_NS INT64_C(5000000000)

/* Begins. key and value for SET only. ids: null, or {session, user, application}, put before the command.
   TVS_ERR_STATE: one is under way; TVS_ERR_ARGUMENT: ardrone_config_check says no. */
TV_API tvs_status ardrone_exchange_begin(ardrone_exchange *exchange, ardrone_exchange_kind kind,
                                         const char *key, const char *value,
                                         const char *const ids[3], int64_t now_ns);
/* Every accepted navdata packet's state word. */
TV_API void ardrone_exchange_navdata(ardrone_exchange *exchange, uint32_t state, int64_t now_ns);
/* The whole text of a READ has come. */
TV_API void ardrone_exchange_text(ardrone_exchange *exchange, int64_t now_ns);
/* Appends what is due to the datagram, if anything; also sees to the time-outs. Call at each tick.
   TVS_OK; TVS_ERR_NULL; TVS_ERR_CAPACITY: no room in this datagram, so it goes into the next. */
TV_API tvs_status ardrone_exchange_tick(ardrone_exchange *exchange, ardrone_at *at, int64_t now_ns);

TV_END_DECLS

#endif
