#include "twoview_drivers/ardrone/pave.h"

#include <string.h>

#include "bytes.h"

static const uint8_t SIGNATURE[4] = {'P', 'a', 'V', 'E'};
enum { MIN_BUFFER_BYTES = 4096, SIGNATURE_BYTES = 4, EXTRA_BYTES = 68 };

static void read_header(const uint8_t *p, ardrone_pave_header *header) {
  memset(header, 0, sizeof *header);
  header->version = p[4];
  header->codec = p[5];
  header->header_size = ardrone_get16(p + 6);
  header->payload_size = ardrone_get32(p + 8);
  header->encoded_width = ardrone_get16(p + 12);
  header->encoded_height = ardrone_get16(p + 14);
  header->display_width = ardrone_get16(p + 16);
  header->display_height = ardrone_get16(p + 18);
  header->frame_number = ardrone_get32(p + 20);
  header->timestamp_ms = ardrone_get32(p + 24);
  header->total_chunks = p[28];
  header->chunk_index = p[29];
  header->frame_type = p[30];
  header->control = p[31];
  header->position_low = ardrone_get32(p + 32);
  header->position_high = ardrone_get32(p + 36);
  header->stream_id = ardrone_get16(p + 40);
  header->total_slices = p[42];
  header->slice_index = p[43];
  header->sps_size = p[44];
  header->pps_size = p[45];
  header->advertised_size = ardrone_get32(p + 48);
  if (header->control & ARDRONE_PAVE_ADVERTISEMENT) header->payload_size = 0;
}

static void read_extra(const uint8_t *p, ardrone_pave_header *header) {
  int k;
  header->extra = ardrone_get32(p + 52);
  for (k = 0; k < 3; ++k) {
    const uint32_t bits = ardrone_get32(p + 56 + 4 * k);
    memcpy(&header->angles[k], &bits, sizeof bits);
  }
}

/* The check is strict, so that the bytes of a signature inside a picture do not pass for a
   packet. */
static int is_plausible(const ardrone_pave_header *header) {
  return header->version >= 1 && header->version <= 3 && header->codec <= ARDRONE_PAVE_H264 &&
         header->header_size >= ARDRONE_PAVE_MIN_HEADER &&
         header->header_size <= ARDRONE_PAVE_MAX_HEADER &&
         header->payload_size <= ARDRONE_PAVE_MAX_PAYLOAD &&
         header->frame_type <= ARDRONE_PAVE_HEADERS && header->encoded_width >= 16 &&
         header->encoded_width <= 4096 && header->encoded_height >= 16 &&
         header->encoded_height <= 4096;
}

tvs_status ardrone_pave_decode(const uint8_t *bytes, size_t size, ardrone_pave_header *header) {
  ardrone_pave_header read;
  const size_t known = size < SIGNATURE_BYTES ? size : SIGNATURE_BYTES;
  if (!bytes || !header) return TVS_ERR_NULL;
  if (memcmp(bytes, SIGNATURE, known) != 0) return TVS_ERR_DATA;
  if (size < ARDRONE_PAVE_MIN_HEADER) return TVS_NONE;
  read_header(bytes, &read);
  if (!is_plausible(&read)) return TVS_ERR_DATA;
  if (size < read.header_size) return TVS_NONE;
  if (read.header_size >= EXTRA_BYTES) read_extra(bytes, &read);
  *header = read;
  return TVS_OK;
}

tvs_status ardrone_pave_init(ardrone_pave_parser *parser, uint8_t *buffer, size_t capacity) {
  if (!parser || !buffer) return TVS_ERR_NULL;
  if (capacity < MIN_BUFFER_BYTES) return TVS_ERR_CAPACITY;
  memset(parser, 0, sizeof *parser);
  parser->buffer = buffer;
  parser->capacity = capacity;
  return TVS_OK;
}

void ardrone_pave_clear(ardrone_pave_parser *parser) {
  if (!parser) return;
  parser->bytes_skipped += parser->end - parser->begin;
  parser->begin = parser->end = 0;
}

uint8_t *ardrone_pave_space(ardrone_pave_parser *parser, size_t *room) {
  if (parser->begin == parser->end) {
    parser->begin = parser->end = 0;
  } else if (parser->begin >= parser->capacity / 2 || parser->end == parser->capacity) {
    memmove(parser->buffer, parser->buffer + parser->begin, parser->end - parser->begin);
    parser->end -= parser->begin;
    parser->begin = 0;
  }
  *room = parser->capacity - parser->end;
  return parser->buffer + parser->end;
}

void ardrone_pave_filled(ardrone_pave_parser *parser, size_t size) { parser->end += size; }

/* The packet that starts at an offset of the buffer: TVS_OK, TVS_NONE (not all of it is there), or
   TVS_ERR_DATA. */
static tvs_status packet_at(const ardrone_pave_parser *parser, size_t offset,
                            ardrone_pave_packet *packet) {
  const uint8_t *bytes = parser->buffer + offset;
  const size_t size = parser->end - offset;
  const tvs_status status = ardrone_pave_decode(bytes, size, &packet->header);
  if (status != TVS_OK) return status;
  packet->size = (size_t)packet->header.header_size + packet->header.payload_size;
  if (packet->size > parser->capacity) return TVS_ERR_DATA;
  if (packet->size > size) return TVS_NONE;
  packet->bytes = bytes;
  packet->payload = bytes + packet->header.header_size;
  return TVS_OK;
}

static void skip_to_signature(ardrone_pave_parser *parser) {
  const size_t from = parser->begin + 1;
  const uint8_t *found = memchr(parser->buffer + from, SIGNATURE[0], parser->end - from);
  const size_t to = found ? (size_t)(found - parser->buffer) : parser->end;
  parser->bytes_skipped += to - parser->begin;
  parser->begin = to;
}

tvs_status ardrone_pave_next(ardrone_pave_parser *parser, ardrone_pave_packet *packet) {
  if (!parser || !packet) return TVS_ERR_NULL;
  while (parser->begin < parser->end) {
    ardrone_pave_packet found;
    const tvs_status status = packet_at(parser, parser->begin, &found);
    if (status == TVS_NONE) return TVS_NONE;
    if (status == TVS_OK) {
      parser->begin += found.size;
      ++parser->num_packets;
      *packet = found;
      return TVS_OK;
    }
    skip_to_signature(parser);
  }
  return TVS_NONE;
}

static int begins_decoding(const ardrone_pave_header *header) {
  return header->frame_type == ARDRONE_PAVE_IDR && header->slice_index == 0 &&
         (header->control & ARDRONE_PAVE_ADVERTISEMENT) == 0;
}

int ardrone_pave_skip_to_latest(ardrone_pave_parser *parser) {
  ardrone_pave_packet packet;
  size_t offset, latest;
  int num = 0, num_before = 0;
  if (!parser) return 0;
  offset = latest = parser->begin;
  while (offset < parser->end && packet_at(parser, offset, &packet) == TVS_OK) {
    if (begins_decoding(&packet.header)) {
      latest = offset;
      num_before = num;
    }
    offset += packet.size;
    ++num;
  }
  parser->begin = latest;
  parser->num_packets += (uint64_t)num_before;
  return num_before;
}

static int is_other_stream(const ardrone_pave_gate *gate, const ardrone_pave_header *header) {
  return gate->stream_id != header->stream_id || gate->encoded_width != header->encoded_width ||
         gate->encoded_height != header->encoded_height;
}

/* The next packet has the next number, or the same one where it is another slice of the picture. */
static int is_gap(const ardrone_pave_gate *gate, const ardrone_pave_header *header) {
  const uint32_t ahead = header->frame_number - gate->last_number;
  return gate->has_last && ahead != 1 && !(ahead == 0 && header->slice_index > 0);
}

int ardrone_pave_gate_check(ardrone_pave_gate *gate, const ardrone_pave_header *header) {
  int answer = 0;
  if (header->control & ARDRONE_PAVE_ADVERTISEMENT) return 0;
  if (is_gap(gate, header)) {
    answer |= ARDRONE_PAVE_GAP;
    gate->is_open = 0;
  }
  if (gate->has_last && is_other_stream(gate, header)) gate->is_open = 0;
  gate->has_last = 1;
  gate->last_number = header->frame_number;
  gate->stream_id = header->stream_id;
  gate->encoded_width = header->encoded_width;
  gate->encoded_height = header->encoded_height;
  if (!gate->is_open) {
    if (!begins_decoding(header)) return answer;
    gate->is_open = 1;
    answer |= ARDRONE_PAVE_RESET;
  }
  return answer | (header->payload_size == ARDRONE_PAVE_SKIP_PAYLOAD ? ARDRONE_PAVE_REPEAT
                                                                     : ARDRONE_PAVE_DECODE);
}
