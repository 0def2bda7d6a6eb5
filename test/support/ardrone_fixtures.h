/* Captures of real drones, read from the folder that TWOVIEW_ARDRONE_FIXTURES names. */
#ifndef TEST_SUPPORT_ARDRONE_FIXTURES_H
#define TEST_SUPPORT_ARDRONE_FIXTURES_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unity.h>

static inline const char *fixtures_folder(void) { return getenv("TWOVIEW_ARDRONE_FIXTURES"); }

/* Ends the program as skipped when TWOVIEW_ARDRONE_FIXTURES is not set. */
static inline void fixtures_need(void) {
  if (fixtures_folder() && *fixtures_folder()) return;
  printf("skipped: no AR.Drone captures (TWOVIEW_ARDRONE_FIXTURES)\n");
  exit(TWOVIEW_SKIP_CODE);
}

/* Reads all bytes of a captured file; the caller frees them. */
static inline uint8_t *fixture_read(const char *name, size_t *size) {
  char path[4096];
  FILE *file;
  uint8_t *bytes;
  long length;
  snprintf(path, sizeof path, "%s/%s", fixtures_folder(), name);
  file = fopen(path, "rb");
  TEST_ASSERT_NOT_NULL_MESSAGE(file, path);
  TEST_ASSERT_EQUAL_INT(0, fseek(file, 0, SEEK_END));
  length = ftell(file);
  rewind(file);
  bytes = malloc((size_t)length);
  TEST_ASSERT_NOT_NULL(bytes);
  TEST_ASSERT_EQUAL_UINT64((size_t)length, fread(bytes, 1, (size_t)length, file));
  fclose(file);
  *size = (size_t)length;
  return bytes;
}

#endif
