/* The bytes that a drone sends, for the simulator and the tests; private, not installed. */
#ifndef ARDRONE_ENCODE_H
#define ARDRONE_ENCODE_H

#include "twoview_drivers/ardrone/navdata.h"
#include "twoview_drivers/ardrone/pave.h"

TV_BEGIN_DECLS

/* Writes the packet of navdata's magic (0: the usual one), state, sequence, vision_defined and
   those options that `present` and `gps_form` name, in the order of their tags, with its checksum.
   The unknown part of a 480-byte GPS option is zeros. Writes *size; TVS_ERR_CAPACITY when it does
   not fit. */
tvs_status ardrone_encode_navdata(const ardrone_navdata *navdata, uint8_t *bytes, size_t capacity,
                                  size_t *size);

/* Converts nanoseconds to an ardrone_time, wrapped as the drone wraps it. */
ardrone_time ardrone_encode_time(int64_t time_ns);

/* Writes a PaVE header of header_size 64 or 68 and the payload after it. The payload has
   header->payload_size bytes. */
tvs_status ardrone_encode_pave(const ardrone_pave_header *header, const uint8_t *payload,
                               uint8_t *bytes, size_t capacity, size_t *size);

TV_END_DECLS

#endif
