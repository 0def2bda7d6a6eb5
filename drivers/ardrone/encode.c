#include "encode.h"

#include <string.h>

#include "bytes.h"
#include "navdata_layout.h"

static uint8_t *write_run(const uint8_t *from, const navdata_run *run, uint8_t *to) {
  int k;
  from += run->offset;
  for (k = 0; k < run->count; ++k, from += run->width, to += run->width) {
    uint16_t half;
    uint32_t word;
    uint64_t two_words;
    switch (run->width) {
      case 1: *to = *from; break;
      case 2:
        memcpy(&half, from, 2);
        ardrone_put16(to, half);
        break;
      case 4:
        memcpy(&word, from, 4);
        ardrone_put32(to, word);
        break;
      default: memcpy(&two_words, from, 8); ardrone_put64(to, two_words);
    }
  }
  return to;
}

static size_t option_bytes(uint32_t tag, ardrone_gps_form form) {
  static const size_t gps_bytes[] = {12, 12, 480, 216};
  if (tag == ARDRONE_TAG_GPS) return gps_bytes[form];
  return ardrone_navdata_layout(tag, 0)->bytes;
}

static void write_option(const ardrone_navdata *navdata, uint32_t tag, size_t size, uint8_t *to) {
  const navdata_layout *layout = ardrone_navdata_layout(tag, size);
  int k;
  memset(to, 0, size);
  ardrone_put16(to, (uint16_t)tag);
  ardrone_put16(to + 2, (uint16_t)size);
  to += NAVDATA_OPTION_BYTES;
  for (k = 0; k < layout->num_runs; ++k) {
    to = write_run((const uint8_t *)navdata, &layout->runs[k], to);
  }
}

tvs_status ardrone_encode_navdata(const ardrone_navdata *navdata, uint8_t *bytes, size_t capacity,
                                  size_t *size) {
  size_t at = NAVDATA_HEADER_BYTES, k;
  uint32_t tag, sum = 0;
  if (!navdata || !bytes || !size) return TVS_ERR_NULL;
  if (capacity < NAVDATA_HEADER_BYTES + NAVDATA_CHECKSUM_BYTES) return TVS_ERR_CAPACITY;
  ardrone_put32(bytes, navdata->magic ? navdata->magic : NAVDATA_MAGIC);
  ardrone_put32(bytes + 4, navdata->state);
  ardrone_put32(bytes + 8, navdata->sequence);
  ardrone_put32(bytes + 12, navdata->vision_defined);
  for (tag = 0; tag < ARDRONE_NUM_TAGS; ++tag) {
    size_t option;
    if (!ARDRONE_HAS(navdata, tag)) continue;
    option = option_bytes(tag, navdata->gps_form);
    if (option + NAVDATA_CHECKSUM_BYTES > capacity - at) return TVS_ERR_CAPACITY;
    write_option(navdata, tag, option, bytes + at);
    at += option;
  }
  for (k = 0; k < at; ++k) sum += bytes[k];
  ardrone_put16(bytes + at, (uint16_t)ARDRONE_TAG_CHECKSUM);
  ardrone_put16(bytes + at + 2, NAVDATA_CHECKSUM_BYTES);
  ardrone_put32(bytes + at + 4, sum);
  *size = at + NAVDATA_CHECKSUM_BYTES;
  return TVS_OK;
}

ardrone_time ardrone_encode_time(int64_t time_ns) {
  const int64_t wrapped = time_ns % ARDRONE_TIME_PERIOD_NS;
  const int64_t us = (wrapped < 0 ? wrapped + ARDRONE_TIME_PERIOD_NS : wrapped) / 1000;
  ardrone_time time;
  time.stamp = (uint32_t)(us / 1000000) << 21 | (uint32_t)(us % 1000000);
  return time;
}

tvs_status ardrone_encode_pave(const ardrone_pave_header *header, const uint8_t *payload,
                               uint8_t *bytes, size_t capacity, size_t *size) {
  size_t total;
  int k;
  if (!header || !bytes || !size || (!payload && header->payload_size > 0)) return TVS_ERR_NULL;
  if (header->header_size != 64 && header->header_size != 68) return TVS_ERR_ARGUMENT;
  total = (size_t)header->header_size + header->payload_size;
  if (total > capacity) return TVS_ERR_CAPACITY;
  memset(bytes, 0, header->header_size);
  memcpy(bytes, "PaVE", 4);
  bytes[4] = header->version;
  bytes[5] = header->codec;
  ardrone_put16(bytes + 6, header->header_size);
  ardrone_put32(bytes + 8, header->payload_size);
  ardrone_put16(bytes + 12, header->encoded_width);
  ardrone_put16(bytes + 14, header->encoded_height);
  ardrone_put16(bytes + 16, header->display_width);
  ardrone_put16(bytes + 18, header->display_height);
  ardrone_put32(bytes + 20, header->frame_number);
  ardrone_put32(bytes + 24, header->timestamp_ms);
  bytes[28] = header->total_chunks;
  bytes[29] = header->chunk_index;
  bytes[30] = header->frame_type;
  bytes[31] = header->control;
  ardrone_put32(bytes + 32, header->position_low);
  ardrone_put32(bytes + 36, header->position_high);
  ardrone_put16(bytes + 40, header->stream_id);
  bytes[42] = header->total_slices;
  bytes[43] = header->slice_index;
  bytes[44] = header->sps_size;
  bytes[45] = header->pps_size;
  ardrone_put32(bytes + 48, header->advertised_size);
  if (header->header_size == 68) {
    ardrone_put32(bytes + 52, header->extra);
    for (k = 0; k < 3; ++k) {
      uint32_t bits;
      memcpy(&bits, &header->angles[k], 4);
      ardrone_put32(bytes + 56 + 4 * k, bits);
    }
  }
  if (header->payload_size > 0) memcpy(bytes + header->header_size, payload, header->payload_size);
  *size = total;
  return TVS_OK;
}
