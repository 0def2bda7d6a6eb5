/* Writes the seeds of the ardrone targets with the project's own encoder.
   usage: make_ardrone_seeds test/fuzz/seeds */
#include <stdio.h>
#include <string.h>

#include "encode.h"

static int write_seed(const char *folder, const char *name, const uint8_t *bytes, size_t size) {
  char path[4096];
  FILE *file;
  int ok;
  snprintf(path, sizeof path, "%s/%s", folder, name);
  file = fopen(path, "wb");
  if (!file) return 0;
  ok = fwrite(bytes, 1, size, file) == size;
  return fclose(file) == 0 && ok;
}

static size_t make_navdata(ardrone_gps_form form, uint8_t *to, size_t capacity) {
  static ardrone_navdata navdata;
  size_t size = 0;
  navdata.state = ARDRONE_STATE_FLYING;
  navdata.sequence = 1000;
  navdata.present = 0x0fffffff;
  navdata.gps_form = form;
  to[0] = 0; /* read by the fuzz target: below 240 it corrects the checksum */
  ardrone_encode_navdata(&navdata, to + 1, capacity - 1, &size);
  return size + 1;
}

static size_t make_stream(uint8_t *to, size_t capacity) {
  static const uint8_t payload[100] = {0, 0, 0, 1, 0x67, 'P', 'a', 'V', 'E'};
  size_t at = 2, size;
  uint32_t k;
  to[0] = 13;
  to[1] = 1;
  for (k = 0; k < 4; ++k) {
    ardrone_pave_header h;
    memset(&h, 0, sizeof h);
    h.version = 2;
    h.codec = ARDRONE_PAVE_H264;
    h.header_size = k % 2 ? 64 : 68;
    h.payload_size = 100;
    h.encoded_width = 640;
    h.encoded_height = 368;
    h.frame_number = 5 + k;
    h.frame_type = k == 0 ? ARDRONE_PAVE_IDR : ARDRONE_PAVE_P;
    if (ardrone_encode_pave(&h, payload, to + at, capacity - at, &size) == TVS_OK) at += size;
  }
  return at;
}

int main(int argc, char **argv) {
  static uint8_t bytes[ARDRONE_NAVDATA_MAX_BYTES];
  static const char text[] =
      "general:navdata_demo = TRUE\nvideo:codec_fps = 30\n[applis]\r"
      "0a1b2c3d,name\r";
  if (argc != 2) return 2;
  return !(write_seed(argv[1], "ardrone_navdata/full_zimmu", bytes,
                      make_navdata(ARDRONE_GPS_ZIMMU, bytes, sizeof bytes)) &&
           write_seed(argv[1], "ardrone_navdata/full_gps248", bytes,
                      make_navdata(ARDRONE_GPS_248, bytes, sizeof bytes)) &&
           write_seed(argv[1], "ardrone_navdata/full_gps247", bytes,
                      make_navdata(ARDRONE_GPS_247, bytes, sizeof bytes)) &&
           write_seed(argv[1], "ardrone_pave/four", bytes, make_stream(bytes, sizeof bytes)) &&
           write_seed(argv[1], "ardrone_config/text", (const uint8_t *)text, sizeof text - 1));
}
