/* A real pair of images for tests: Middlebury's Motorcycle from the cache of scripts/bootstrap,
   else a pair of TWOVIEW_DATA. */
#ifndef TEST_SUPPORT_REAL_PAIR_H
#define TEST_SUPPORT_REAL_PAIR_H

#include <stdio.h>
#include <stdlib.h>

#include "support/png.h"

typedef struct real_pair {
  uint8_t *luma[2]; /* the two images, rows without padding; allocated by malloc */
  int32_t width, height;
} real_pair;

static inline int real_pair_read(real_pair *pair, const char *folder, const char *name0,
                                 const char *name1) {
  const char *names[2] = {name0, name1};
  int32_t widths[2] = {0, 0}, heights[2] = {0, 0};
  int v;
  for (v = 0; v < 2; ++v) {
    char path[4400];
    snprintf(path, sizeof path, "%s/%s", folder, names[v]);
    pair->luma[v] = png_load_luma(path, &widths[v], &heights[v]);
  }
  pair->width = widths[0];
  pair->height = heights[0];
  return pair->luma[0] != NULL && pair->luma[1] != NULL && widths[0] == widths[1] &&
         heights[0] == heights[1];
}

/* Loads the pair; prints why and returns 0 when there is none. */
static inline int real_pair_load(real_pair *pair) {
  const char *data = getenv("TWOVIEW_DATA");
  char folder[4096];
  if (real_pair_read(pair, TWOVIEW_CACHE_DIR "/motorcycle", "motorcycle_left.png",
                     "motorcycle_right.png")) {
    return 1;
  }
  if (data != NULL) {
    const int length = snprintf(folder, sizeof folder, "%s/middlebury_templeSR/images", data);
    if (length > 0 && length < (int)sizeof folder &&
        real_pair_read(pair, folder, "templeSR0001.png", "templeSR0002.png")) {
      return 1;
    }
  }
  printf("no real images: neither " TWOVIEW_CACHE_DIR
         "/motorcycle (scripts/bootstrap test) nor "
         "TWOVIEW_DATA\n");
  return 0;
}

#endif
