/* twoview drivers: frames from files, through a callback that opens or decodes them. */
#ifndef TWOVIEW_DRIVERS_FILE_SOURCE_H
#define TWOVIEW_DRIVERS_FILE_SOURCE_H

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* Reads pictures in order; the caller knows the format. Times are those of the files. */
typedef struct tvs_file_options {
  uint32_t struct_size; /* set by tvs_file_options_init */
  void *user;           /* first argument of the functions */
  /* Opens or decodes picture `index` (0, 1, ...): fills *picture and, where the file knows it,
     *device_ns (as it stands: index / frames_per_second). TVS_END after the last one; TVS_ERR_DATA for
     a picture that cannot be read, which is left out and makes the next one's gap flag. */
  tvs_status (*read)(void *user, uint64_t index, tvs_picture *picture, int64_t *device_ns);
  void (*release)(void *user, tvs_picture *picture); /* null when there is nothing to release */
  double frames_per_second;                          /* (0, 10000], default 30 */
  uint32_t clock_id;                                 /* of the frames' times, at least 1, default 1 */
  uint32_t reserved;                                 /* 0 */
  /* Attitudes measured in the same clock, or null: frames then carry theirs. Read ahead as needed. */
  const tvs_imu_source *imu;
  int64_t max_gap_ns; /* between an attitude's neighbours (attitude.h), default 100 ms */
} tvs_file_options;

/* Writes the defaults, and struct_size; null is allowed. */
TV_API void tvs_file_options_init(tvs_file_options *options);

/* About 75 kB: the attitudes. The caller's struct. Private. */
typedef struct tvs_file_source tvs_file_source;

/* Bytes of a tvs_file_source, aligned as malloc does. */
TV_API size_t tvs_file_source_size(void);

/* Makes a source in the caller's memory. Any number of its frames may be held at once.
   Returns TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE, TVS_ERR_ARGUMENT, TVS_ERR_CAPACITY (too few bytes). */
TV_API tvs_status tvs_file_source_init(void *memory, size_t size_bytes,
                                       const tvs_file_options *options, tvs_frame_source *source);

TV_END_DECLS

#endif
