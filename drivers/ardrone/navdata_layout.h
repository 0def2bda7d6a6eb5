/* The wire layout of every navdata option, once, for the decoder and the encoder. An option's
   fields lie on the wire without gaps, in the order of its struct; so a layout is a list of runs of
   equal width. */
#ifndef ARDRONE_NAVDATA_LAYOUT_H
#define ARDRONE_NAVDATA_LAYOUT_H

#include <stddef.h>
#include <stdint.h>

enum { NAVDATA_HEADER_BYTES = 16, NAVDATA_OPTION_BYTES = 4, NAVDATA_CHECKSUM_BYTES = 8 };
static const uint32_t NAVDATA_MAGIC = 0x55667788u, NAVDATA_MAGIC_EXTRA = 0x55667789u;

typedef struct navdata_run {
  uint16_t offset; /* where the values begin in ardrone_navdata, bytes */
  uint8_t width;   /* bytes of one value: 1, 2, 4 or 8 */
  uint8_t count;
} navdata_run;

typedef struct navdata_layout {
  const navdata_run *runs;
  int num_runs;
  uint16_t bytes; /* size of the option on the wire, tag and size fields included */
} navdata_layout;

/* The layout of an option with this tag, or null when there is none. `bytes`, the option's size on
   the wire, is used for tag 27 only, which has three layouts. */
const navdata_layout *ardrone_navdata_layout(uint32_t tag, size_t bytes);

#endif
