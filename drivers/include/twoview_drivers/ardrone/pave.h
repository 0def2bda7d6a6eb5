/* AR.Drone 2.0: PaVE, the packets of its video streams (TCP 5555 live, 5553 recording). Pure: bytes in,
   frames out, no socket, no heap.

   A packet is a header of 64 or 68 bytes and one H.264 picture. A connection may begin in the midst of one. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_PAVE_H
#define TWOVIEW_DRIVERS_ARDRONE_PAVE_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

enum {
  ARDRONE_PAVE_MIN_HEADER = 64,
  ARDRONE_PAVE_MAX_HEADER = 256,
  ARDRONE_PAVE_MAX_PAYLOAD = 1 << 20,
  ARDRONE_PAVE_SKIP_PAYLOAD = 7 /* a payload this short means "the last picture again" */
};

typedef enum ardrone_pave_codec {
  ARDRONE_PAVE_UNKNOWN, ARDRONE_PAVE_VLIB, ARDRONE_PAVE_P264, ARDRONE_PAVE_MPEG4, ARDRONE_PAVE_H264
} ardrone_pave_codec;

typedef enum ardrone_pave_type {
  ARDRONE_PAVE_TYPE_UNKNOWN,
  ARDRONE_PAVE_IDR,    /* with its parameter sets: decoding can begin here */
  ARDRONE_PAVE_I,
  ARDRONE_PAVE_P,
  ARDRONE_PAVE_HEADERS
} ardrone_pave_type;

enum { ARDRONE_PAVE_ADVERTISEMENT = 1, ARDRONE_PAVE_LAST_FRAME = 2 }; /* bits of control */

typedef struct ardrone_pave_header {
  uint8_t version, codec; /* 2; an ardrone_pave_codec */
  uint16_t header_size;
  uint32_t payload_size;
  uint16_t encoded_width, encoded_height, display_width, display_height;
  uint32_t frame_number, timestamp_ms;
  uint8_t total_chunks, chunk_index, frame_type, control; /* frame_type: an ardrone_pave_type */
  uint32_t position_low, position_high; /* in the stream, bytes */
  uint16_t stream_id;
  uint8_t total_slices, slice_index, sps_size, pps_size;
  uint32_t advertised_size;
  /* Of the 68-byte form only. Nobody has documented them; in two captures they look like theta, phi and
     psi in radians at this frame. Experimental: hold them against navdata before use. */
  uint32_t extra;
  float angles[3];
} ardrone_pave_header;

/* Decodes the header at the start of bytes. TVS_NONE: more bytes are needed to tell. TVS_ERR_DATA: no
   header (signature, sizes or kinds out of range). */
TV_API tvs_status ardrone_pave_decode(const uint8_t *bytes, size_t size,
                                      ardrone_pave_header *header);

/* A packet in the parser's buffer: `bytes` is the header, the payload follows it. Valid until the next
   call of ardrone_pave_space, _feed or _clear. */
typedef struct ardrone_pave_packet {
  ardrone_pave_header header;
  const uint8_t *bytes, *payload;
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
TV_API tvs_status ardrone_pave_init(ardrone_pave_parser *parser, uint8_t *buffer, size_t capacity);

/* A new connection: what was begun is forgotten. */
TV_API void ardrone_pave_clear(ardrone_pave_parser *parser);

/* Where to receive to, and how much fits, at least 1 once ardrone_pave_next has said TVS_NONE; then
   how much was received. */
TV_API uint8_t *ardrone_pave_space(ardrone_pave_parser *parser, size_t *room);
TV_API void ardrone_pave_filled(ardrone_pave_parser *parser, size_t size);

/* The next whole packet, or TVS_NONE. However the stream was split on its way, the packets are the
   same. Bytes that are no packet are passed over, one at a time, to the next signature. */
TV_API tvs_status ardrone_pave_next(ardrone_pave_parser *parser, ardrone_pave_packet *packet);

/* The rule against latency, for the live stream only: of the whole packets in the buffer, forgets those
   before the last one that decoding can begin with. Returns how many were dropped. */
TV_API int ardrone_pave_skip_to_latest(ardrone_pave_parser *parser);

/* What to do with each packet, so that only pictures without errors are shown. Start with zeros; zeros
   again after each connection and decoder error. */
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
