/* AR.Drone 2.0: PaVE, the packets of its video streams (TCP 5555 live, 5553 recording). Pure: bytes in,
   frames out, no socket, no heap.

   A packet is a header of 64 or 68 bytes and one H.264 picture. A connection may begin in the midst of one.
   Layouts from Parrot's SDK, open drivers and captured bytes: docs/drivers.md. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_PAVE_H
#define TWOVIEW_DRIVERS_ARDRONE_PAVE_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

/* Bytes of a packet's parts. */
enum {
  ARDRONE_PAVE_MIN_HEADER = 64,       /* a shorter header is none */
  ARDRONE_PAVE_MAX_HEADER = 256,      /* nor is a longer one */
  ARDRONE_PAVE_MAX_PAYLOAD = 1 << 20, /* a larger picture is none */
  ARDRONE_PAVE_SKIP_PAYLOAD = 7 /* a payload this short means "the last picture again" */
};

/* How the payload is compressed. */
typedef enum ardrone_pave_codec {
  ARDRONE_PAVE_UNKNOWN, /* not said */
  ARDRONE_PAVE_VLIB,    /* the first drone's */
  ARDRONE_PAVE_P264,    /* the first drone's */
  ARDRONE_PAVE_MPEG4,   /* MPEG-4 part 2 */
  ARDRONE_PAVE_H264     /* H.264 baseline, Annex B: what this drone sends */
} ardrone_pave_codec;

/* What kind of picture. */
typedef enum ardrone_pave_type {
  ARDRONE_PAVE_TYPE_UNKNOWN, /* not said */
  ARDRONE_PAVE_IDR,    /* with its parameter sets: decoding can begin here */
  ARDRONE_PAVE_I,      /* whole, but later pictures may reach behind it */
  ARDRONE_PAVE_P,      /* predicted from earlier ones */
  ARDRONE_PAVE_HEADERS /* parameter sets alone, no picture */
} ardrone_pave_type;

/* Bits of ardrone_pave_header.control. */
enum {
  ARDRONE_PAVE_ADVERTISEMENT = 1, /* announces a picture of advertised_size bytes, and has no payload */
  ARDRONE_PAVE_LAST_FRAME = 2     /* the stream ends */
};

/* A packet's header, little-endian on the wire. */
typedef struct ardrone_pave_header {
  uint8_t version, codec; /* 2; an ardrone_pave_codec */
  uint16_t header_size;   /* bytes */
  uint32_t payload_size;  /* bytes */
  uint16_t encoded_width, encoded_height, display_width, display_height; /* pixels; 368 and 360 rows, say */
  uint32_t frame_number, timestamp_ms; /* counts up; milliseconds, wraps at 2^32 */
  uint8_t total_chunks, chunk_index, frame_type, control; /* frame_type: an ardrone_pave_type */
  uint32_t position_low, position_high; /* in the stream, bytes */
  uint16_t stream_id; /* another one: another stream, nothing before it is related */
  uint8_t total_slices, slice_index, sps_size, pps_size; /* bytes of the parameter sets, where they come first */
  uint32_t advertised_size; /* bytes of the picture that an advertisement announces */
  uint32_t extra; /* of the 68-byte form only; nobody has documented it */
  /* Of the 68-byte form only. Nobody has documented them; in two captures they look like theta, phi and
     psi in radians at this frame. Experimental: hold them against navdata before use. */
  float angles[3];
} ardrone_pave_header;

/* Decodes the header at the start of bytes. TVS_NONE: more bytes are needed to tell. TVS_ERR_DATA: no
   header (signature, sizes or kinds out of range). */
TV_API tvs_status ardrone_pave_decode(const uint8_t *bytes, size_t size,
                                      ardrone_pave_header *header);

/* A packet in the parser's buffer: `bytes` is the header, the payload follows it. Valid until the next
   call of ardrone_pave_space, _feed or _clear. */
typedef struct ardrone_pave_packet {
  ardrone_pave_header header;     /* decoded */
  const uint8_t *bytes, *payload; /* in the parser's buffer: the header, and what follows it */
  size_t size; /* header and payload */
} ardrone_pave_packet;

/* Cuts a stream into packets, in the caller's buffer. Private but for the counters. */
typedef struct ardrone_pave_parser {
  uint8_t *buffer;
  size_t capacity, begin, end;
  uint64_t bytes_skipped; /* that belonged to no packet */
  uint64_t num_packets;
} ardrone_pave_parser;

/* A buffer of ARDRONE_PAVE_BUFFER_BYTES holds any packet; a smaller one (at least 4096 bytes) refuses what
   does not fit, as if it were no packet. */
#define ARDRONE_PAVE_BUFFER_BYTES ((size_t)ARDRONE_PAVE_MAX_HEADER + ARDRONE_PAVE_MAX_PAYLOAD)
/* Starts a parser in `buffer`, the caller's, of `capacity` bytes, which stays in place while it is used.
   TVS_ERR_NULL; TVS_ERR_CAPACITY: below 4096 bytes. */
TV_API tvs_status ardrone_pave_init(ardrone_pave_parser *parser, uint8_t *buffer, size_t capacity);

/* A new connection: what was begun is forgotten. */
TV_API void ardrone_pave_clear(ardrone_pave_parser *parser);

/* Where to receive to; *room: how many bytes fit, at least 1 once ardrone_pave_next has said TVS_NONE. */
TV_API uint8_t *ardrone_pave_space(ardrone_pave_parser *parser, size_t *room);
/* How many bytes were received there. */
TV_API void ardrone_pave_filled(ardrone_pave_parser *parser, size_t size);

/* The next whole packet, or TVS_NONE. However the stream was split on its way, the packets are the
   same. Bytes that are no packet are passed over, one at a time, to the next signature. */
TV_API tvs_status ardrone_pave_next(ardrone_pave_parser *parser, ardrone_pave_packet *packet);

/* The rule against latency, for the live stream only: of the whole packets in the buffer, forgets those
   before the last one that decoding can begin with. Returns how many were dropped. */
TV_API int ardrone_pave_skip_to_latest(ardrone_pave_parser *parser);

/* What to do with each packet, so that only pictures without errors are shown. Start with zeros; zeros
   again after each connection and decoder error. Private. */
typedef struct ardrone_pave_gate {
  int is_open, has_last;
  uint32_t last_number;
  uint16_t stream_id, encoded_width, encoded_height;
} ardrone_pave_gate;

enum {
  ARDRONE_PAVE_DECODE = 1,  /* give the payload to the decoder */
  ARDRONE_PAVE_REPEAT = 2,  /* the last picture again: nothing to decode */
  ARDRONE_PAVE_GAP = 4,     /* packets before this one are missing */
  ARDRONE_PAVE_RESET = 8    /* another stream begins: reset the decoder first */
};
/* ARDRONE_PAVE_ bits; without DECODE and REPEAT the packet is left out, until one comes that can be
   decoded by itself. */
TV_API int ardrone_pave_gate_check(ardrone_pave_gate *gate, const ardrone_pave_header *header);

TV_END_DECLS

#endif
