/* Structs of the drivers that may grow (twoview_drivers/status.h has the rule): as much of an input
   is read as the caller has, and as much of an output is written as the caller has room for.
   `first` is the size of the struct in the first release of its soname. */
#ifndef TWOVIEW_DRIVERS_SOURCE_SIZED_H
#define TWOVIEW_DRIVERS_SOURCE_SIZED_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "twoview_drivers/status.h"

/* The size of a struct whose last field is this one. */
#define TVS_SIZE_THROUGH(type, field) (offsetof(type, field) + sizeof(((type *)0)->field))

/* struct_size, the first field. */
static inline uint32_t tvs_size_of(const void *object) {
  uint32_t size;
  memcpy(&size, object, sizeof size);
  return size;
}

/* Whether struct_size can be that of a struct of any release. */
static inline int tvs_is_sized(const void *object, size_t first) {
  const uint32_t size = tvs_size_of(object);
  return size >= first && size <= 4096 && size % sizeof size == 0;
}

/* Copies an input of the caller over *own, whose struct_size stays that of this library. Bytes that
   this library does not know must be zero. On an error *own stays as it was. */
static inline tvs_status tvs_read_sized(const void *object, size_t first, void *own,
                                        size_t own_size) {
  const uint32_t known = (uint32_t)own_size, size = tvs_size_of(object);
  uint32_t k;
  if (!tvs_is_sized(object, first)) return TVS_ERR_STRUCT_SIZE;
  for (k = known; k < size; ++k) {
    if (((const uint8_t *)object)[k] != 0) return TVS_ERR_STRUCT_SIZE;
  }
  memcpy(own, object, size < known ? size : known);
  memcpy(own, &known, sizeof known);
  return TVS_OK;
}

/* Writes *own into a struct of this many bytes, zeros into what this library does not know, and its
   size into its first field. */
static inline void tvs_write_sized(const void *own, size_t own_size, void *object, size_t bytes) {
  const uint32_t size = (uint32_t)bytes;
  if (bytes > own_size) memset((uint8_t *)object + own_size, 0, bytes - own_size);
  memcpy(object, own, bytes < own_size ? bytes : own_size);
  memcpy(object, &size, bytes < sizeof size ? bytes : sizeof size);
}

#endif
