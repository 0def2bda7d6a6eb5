/* The bytes that a drone sends, for the simulator and the tests; private, not installed. */
#ifndef ARDRONE_ENCODE_H
#define ARDRONE_ENCODE_H

#include "twoview_drivers/ardrone/navdata.h"
#include "twoview_drivers/ardrone/pave.h"

TV_BEGIN_DECLS

/* The packet of navdata's magic (0: the usual one), state, sequence, vision_defined and those
   options that `present` and `gps_form` name, in the order of their tags, with its checksum. The
   part of a 480-byte GPS that nobody knows is zeros. Writes *size; TVS_ERR_CAPACITY when it does
   not fit. */
tvs_status ardrone_encode_navdata(const ardrone_navdata *navdata, uint8_t *bytes, size_t capacity,
                                  size_t *size);

/* An ardrone_time of a time in nanoseconds, wrapped as the drone does. */
ardrone_time ardrone_encode_time(int64_t time_ns);

/* A PaVE header of header_size 64 or 68 and the payload after it. header->payload_size counts, not
   what the caller wrote to total size. */
tvs_status ardrone_encode_pave(const ardrone_pave_header *header, const uint8_t *payload,
                               uint8_t *bytes, size_t capacity, size_t *size);

TV_END_DECLS

#endif
