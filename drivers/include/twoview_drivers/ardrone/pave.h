/* AR.Drone 2.0: PaVE, the packets of its video streams (TCP 5555 live, 5553 recording). It reads
   bytes and writes structs; it uses no socket and no heap.

   A packet is a header of 64 or 68 bytes and one H.264 picture. A connection may begin in the
   middle of a packet. The layouts come from Parrot's SDK, open drivers and captured bytes:
   docs/drivers.md. */
#ifndef TWOVIEW_DRIVERS_ARDRONE_PAVE_H
#define TWOVIEW_DRIVERS_ARDRONE_PAVE_H

#include <stddef.h>
#include <stdint.h>

#include "twoview_drivers/status.h"

TV_BEGIN_DECLS

/* The limits of the parts of a packet, bytes. */
enum {
  /* The shortest header of a packet; bytes with a shorter one are no packet. */
  ARDRONE_PAVE_MIN_HEADER = 64,
  /* The longest header of a packet; bytes with a longer one are no packet. */
  ARDRONE_PAVE_MAX_HEADER = 256,
  /* The largest payload of a packet; bytes with a larger one are no packet. */
  ARDRONE_PAVE_MAX_PAYLOAD = 1 << 20,
  /* A payload of exactly this many bytes repeats the last picture. */
  ARDRONE_PAVE_SKIP_PAYLOAD = 7
};

/* The compression of the payload. */
typedef enum ardrone_pave_codec {
  /* The header does not name the codec. */
  ARDRONE_PAVE_UNKNOWN,
  /* A codec of the first AR.Drone. */
  ARDRONE_PAVE_VLIB,
  /* A codec of the first AR.Drone. */
  ARDRONE_PAVE_P264,
  /* The codec is MPEG-4 part 2. */
  ARDRONE_PAVE_MPEG4,
  /* The codec is H.264 baseline, Annex B, which the AR.Drone 2.0 sends. */
  ARDRONE_PAVE_H264
} ardrone_pave_codec;

/* The kind of picture that the payload holds. */
typedef enum ardrone_pave_type {
  /* The header does not name the picture's type. */
  ARDRONE_PAVE_TYPE_UNKNOWN,
  /* An IDR picture with its parameter sets: decoding can begin here. */
  ARDRONE_PAVE_IDR,
  /* An intra picture; later pictures may refer to pictures before it. */
  ARDRONE_PAVE_I,
  /* A picture that is predicted from earlier ones. */
  ARDRONE_PAVE_P,
  /* Parameter sets without a picture. */
  ARDRONE_PAVE_HEADERS
} ardrone_pave_type;

/* Bits of ardrone_pave_header.control. */
enum {
  /* Announces a picture of advertised_size bytes, and has no payload. */
  ARDRONE_PAVE_ADVERTISEMENT = 1,
  /* The packet is the last one of the stream. */
  ARDRONE_PAVE_LAST_FRAME = 2
};

/* The header of a packet, which is little-endian on the wire. */
typedef struct ardrone_pave_header {
  /* version is 2 (1 to 3 are accepted); codec is an ardrone_pave_codec. */
  uint8_t version, codec;
  /* The length of this header, bytes. */
  uint16_t header_size;
  /* The length of the payload, bytes. */
  uint32_t payload_size;
  /* Pixels as encoded and as shown: 368 and 360 rows, for example. */
  uint16_t encoded_width, encoded_height, display_width, display_height;
  /* The picture's number, which counts up, and its time in milliseconds, which wraps at 2^32. */
  uint32_t frame_number, timestamp_ms;
  /* frame_type is an ardrone_pave_type; control has the bits ARDRONE_PAVE_ADVERTISEMENT and
     ARDRONE_PAVE_LAST_FRAME. */
  uint8_t total_chunks, chunk_index, frame_type, control;
  /* Place in the stream, bytes: lower and upper 32 bits. */
  uint32_t position_low, position_high;
  /* When it changes, another stream begins that refers to nothing before it. */
  uint16_t stream_id;
  /* The number of slices of the picture and this one's index; bytes of the parameter sets (sps,
     pps) where the payload begins with them. */
  uint8_t total_slices, slice_index, sps_size, pps_size;
  /* The length of the picture that an advertisement announces, bytes. */
  uint32_t advertised_size;
  /* In headers of at least 68 bytes, else 0; its meaning is not documented. */
  uint32_t extra;
  /* In headers of at least 68 bytes, else 0; their meaning is not documented. In two captures they
     agree with theta, phi and psi in radians at this frame. Compare them with navdata before you
     use them. */
  float angles[3];
} ardrone_pave_header;

/* Decodes the header at the start of `bytes`. TVS_NONE: more bytes are needed. TVS_ERR_DATA: these
   bytes are no header (signature, version, a size or a kind out of range). */
TV_API tvs_status ardrone_pave_decode(const uint8_t *bytes, size_t size,
                                      ardrone_pave_header *header);

/* A packet in the parser's buffer. Valid until the next call of ardrone_pave_next,
   ardrone_pave_space or ardrone_pave_clear. */
typedef struct ardrone_pave_packet {
  /* The packet's decoded header. */
  ardrone_pave_header header;
  /* Where the header and the payload begin in the parser's buffer. */
  const uint8_t *bytes, *payload;
  /* The length of header and payload together, bytes. */
  size_t size;
} ardrone_pave_packet;

/* Cuts a stream into packets in the caller's buffer. Private except for bytes_skipped and
   num_packets. */
typedef struct ardrone_pave_parser {
  uint8_t *buffer;
  size_t capacity, begin, end;
  /* How many bytes of the stream belonged to no whole packet. */
  uint64_t bytes_skipped;
  uint64_t num_packets;
} ardrone_pave_parser;

/* A buffer of ARDRONE_PAVE_BUFFER_BYTES holds any packet; a smaller one (at least 4096 bytes)
   skips a packet that does not fit, as it skips bytes that are no packet. */
#define ARDRONE_PAVE_BUFFER_BYTES ((size_t)ARDRONE_PAVE_MAX_HEADER + ARDRONE_PAVE_MAX_PAYLOAD)

/* Starts a parser with the caller's buffer of `capacity` bytes, which stays in place while the
   parser is used. Returns TVS_ERR_NULL; TVS_ERR_CAPACITY: below 4096 bytes. */
TV_API tvs_status ardrone_pave_init(ardrone_pave_parser *parser, uint8_t *buffer, size_t capacity);

/* Call it at a new connection: the bytes in the buffer are dropped. */
TV_API void ardrone_pave_clear(ardrone_pave_parser *parser);

/* Where to write received bytes. *room is how many fit: at least 1 after ardrone_pave_next has
   returned TVS_NONE. */
TV_API uint8_t *ardrone_pave_space(ardrone_pave_parser *parser, size_t *room);

/* Call it with the number of bytes that were written where ardrone_pave_space pointed. */
TV_API void ardrone_pave_filled(ardrone_pave_parser *parser, size_t size);

/* Gets the next whole packet, or TVS_NONE. The packets do not depend on how the stream was split on
   its way. Bytes that are no packet are skipped up to the next signature. */
TV_API tvs_status ardrone_pave_next(ardrone_pave_parser *parser, ardrone_pave_packet *packet);

/* Keeps the latency of the live stream low; call it after ardrone_pave_filled. Of the whole packets
   at the front of the buffer it drops those before the last one that can be decoded by itself (the
   first slice of an IDR picture). Returns how many it dropped: 0 if there is no such packet. */
TV_API int ardrone_pave_skip_to_latest(ardrone_pave_parser *parser);

/* Decides what to do with each packet, so that only pictures without errors are shown. Start with
   zeros; set it to zeros again at each new connection and after each decoder error. Private. */
typedef struct ardrone_pave_gate {
  int is_open, has_last;
  uint32_t last_number;
  uint16_t stream_id, encoded_width, encoded_height;
} ardrone_pave_gate;

/* The bits that ardrone_pave_gate_check returns. */
enum {
  /* The caller gives this packet's payload to the decoder. */
  ARDRONE_PAVE_DECODE = 1,
  /* The packet repeats the last picture: there is nothing to decode. */
  ARDRONE_PAVE_REPEAT = 2,
  /* Packets between the last one and this one are missing. */
  ARDRONE_PAVE_GAP = 4,
  /* Decoding begins, or begins again after a gap or with another stream, with this packet: reset
     the decoder before it decodes the payload. */
  ARDRONE_PAVE_RESET = 8
};

/* Returns the ARDRONE_PAVE_ bits above for the next packet. Without ARDRONE_PAVE_DECODE and
   ARDRONE_PAVE_REPEAT leave the packet out: it only announces a picture
   (ARDRONE_PAVE_ADVERTISEMENT), or a packet before it is missing or belongs to another stream. The
   bits come again with the next picture that can be decoded by itself. */
TV_API int ardrone_pave_gate_check(ardrone_pave_gate *gate, const ardrone_pave_header *header);

TV_END_DECLS

#endif
