/* twoview drivers: frames from files, through a callback that opens or decodes them. */
#ifndef TWOVIEW_DRIVERS_FILE_SOURCE_H
#define TWOVIEW_DRIVERS_FILE_SOURCE_H

#include "twoview_drivers/source.h"

TV_BEGIN_DECLS

/* How the pictures are read and timed. Frames' times are times of the files, not of this computer's
   clock. */
typedef struct tvs_file_options {
  /* The size of this struct, which tvs_file_options_init sets. */
  uint32_t struct_size;
  /* The first argument of `read` and `release`. */
  void *user;
  /* Opens or decodes picture `index` (0, 1, ...), fills *picture and, where the file has a time,
     writes *device_ns, which holds index / frames_per_second before the call. TVS_END after the
     last picture. TVS_ERR_DATA for a picture that cannot be read: it is left out and the next frame
     gets TVS_FRAME_GAP. */
  tvs_status (*read)(void *user, uint64_t index, tvs_picture *picture, int64_t *device_ns);
  /* Gives a picture back. Null when there is nothing to release. */
  void (*release)(void *user, tvs_picture *picture);
  /* Frames per second, (0, 10000], default 30; used where `read` writes no time. */
  double frames_per_second;
  /* The clock_id of the frames' times, at least 1, default 1. */
  uint32_t clock_id;
  /* A reserved field that is 0. */
  uint32_t reserved;
  /* A source of attitudes in the clock `clock_id`; each frame then carries the attitude at its
     time. Samples of another clock_id are left out. Samples are read ahead as far as a frame needs.
     Null: frames carry no attitude. */
  const tvs_imu_source *imu;
  /* The largest time between the two neighbours that an attitude is interpolated from (attitude.h),
     ns, default 100 ms. */
  int64_t max_gap_ns;
} tvs_file_options;

/* Writes the defaults into a struct of struct_size bytes; null is allowed. */
TV_API void tvs_file_options_init_sized(tvs_file_options *options, size_t struct_size);
/* Writes the defaults; null is allowed. */
#define tvs_file_options_init(options) tvs_file_options_init_sized((options), sizeof *(options))

/* A file source in the caller's memory, about 57 kB, nearly all of it attitudes. Private. */
typedef struct tvs_file_source tvs_file_source;

/* The bytes of a tvs_file_source, whose memory is to be aligned as malloc aligns it. */
TV_API size_t tvs_file_source_size(void);

/* Makes a source in `memory`, which the caller owns, and fills *source. The caller may hold any
   number of its frames at once. Returns TVS_ERR_NULL, TVS_ERR_STRUCT_SIZE, TVS_ERR_ARGUMENT,
   TVS_ERR_CAPACITY (too few bytes). */
TV_API tvs_status tvs_file_source_init_sized(void *memory, size_t size_bytes,
                                             const tvs_file_options *options,
                                             tvs_frame_source *source, size_t source_size);
/* tvs_file_source_init_sized with the size of the caller's struct. */
#define tvs_file_source_init(memory, size_bytes, options, source) \
  tvs_file_source_init_sized((memory), (size_bytes), (options), (source), sizeof *(source))

TV_END_DECLS

#endif
