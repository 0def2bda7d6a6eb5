#include "twoview_drivers/file_source.h"

#include <string.h>

#include "sized.h"
#include "twoview_drivers/attitude.h"

struct tvs_file_source {
  tvs_file_options options;
  tvs_imu_source imu; /* a copy of *options.imu, to which options.imu points */
  uint64_t index;     /* number of the next picture to read */
  int gap;            /* whether a picture was left out since the last frame */
  int imu_ended;
  int64_t imu_device_ns; /* time of the newest attitude that was read from options.imu, ns */
  tvs_attitudes attitudes;
};

void tvs_file_options_init_sized(tvs_file_options *options, size_t struct_size) {
  tvs_file_options own;
  if (!options) return;
  memset(&own, 0, sizeof own);
  own.frames_per_second = 30;
  own.clock_id = 1;
  own.max_gap_ns = 100000000;
  tvs_write_sized(&own, sizeof own, options, struct_size);
}

size_t tvs_file_source_size(void) { return sizeof(tvs_file_source); }

/* Reads samples until one is not older than device_ns. A log may hold many samples without an
   attitude, while a drone starts. All of them are read; the number is bounded by the file's
   length. */
static void read_attitudes_until(tvs_file_source *source, int64_t device_ns) {
  const tvs_imu_source *imu = source->options.imu;
  while (!source->imu_ended && source->imu_device_ns < device_ns) {
    tvs_imu sample;
    memset(&sample, 0, sizeof sample);
    sample.struct_size = sizeof sample;
    if (imu->next(imu->user, &sample) != TVS_OK) {
      source->imu_ended = 1;
      return;
    }
    if ((sample.valid & TVS_IMU_ATTITUDE) == 0 ||
        sample.time.clock_id != source->options.clock_id) {
      continue;
    }
    source->imu_device_ns = sample.time.device_ns;
    tvs_attitudes_add(&source->attitudes, sample.time.device_ns, &sample.attitude);
  }
}

static tvs_status next_frame(void *user, tvs_frame *given) {
  tvs_file_source *source = user;
  tvs_frame own, *frame = &own;
  tvs_picture picture;
  int64_t device_ns;
  uint64_t index;
  tvs_status status;
  if (!given) return TVS_ERR_NULL;
  if (!tvs_is_sized(given, TVS_SIZE_THROUGH(tvs_frame, handle))) return TVS_ERR_STRUCT_SIZE;
  memset(frame, 0, sizeof *frame);
  do {
    index = source->index;
    memset(&picture, 0, sizeof picture);
    device_ns = (int64_t)((double)index / source->options.frames_per_second * 1e9);
    status = source->options.read(source->options.user, index, &picture, &device_ns);
    if (status != TVS_OK && status != TVS_ERR_DATA) return status;
    ++source->index;
    if (status == TVS_ERR_DATA) source->gap = 1;
  } while (status != TVS_OK);
  frame->flags =
      TVS_FRAME_KEY | (source->gap ? TVS_FRAME_GAP : 0) | (index == 0 ? TVS_FRAME_NEW_STREAM : 0);
  source->gap = 0;
  frame->image = picture.image;
  frame->handle = picture.handle;
  frame->number = index;
  frame->time.received_ns = frame->time.host_ns = frame->time.device_ns = device_ns;
  frame->time.uncertainty_ns = 0;
  frame->time.clock_id = source->options.clock_id;
  frame->time.reserved = 0;
  if (source->options.imu) {
    read_attitudes_until(source, device_ns);
    if (tvs_attitudes_at(&source->attitudes, source->options.clock_id, device_ns,
                         source->options.max_gap_ns, &frame->attitude) == TVS_OK) {
      frame->flags |= TVS_FRAME_HAS_ATTITUDE;
    }
  }
  tvs_write_sized(frame, sizeof *frame, given, given->struct_size);
  return TVS_OK;
}

static void release_frame(void *user, tvs_frame *frame) {
  tvs_file_source *source = user;
  tvs_picture picture;
  if (!frame || !source->options.release) return;
  picture.image = frame->image;
  picture.handle = frame->handle;
  source->options.release(source->options.user, &picture);
}

static tvs_status read_options(const tvs_file_options *given, tvs_file_options *options,
                               tvs_imu_source *imu) {
  tvs_status status;
  tvs_file_options_init(options);
  status = tvs_read_sized(given, TVS_SIZE_THROUGH(tvs_file_options, max_gap_ns), options,
                          sizeof *options);
  if (status != TVS_OK) return status;
  if (!options->read) return TVS_ERR_NULL;
  if (!(options->frames_per_second > 0 && options->frames_per_second <= 10000) ||
      options->clock_id == 0 || options->max_gap_ns < 0) {
    return TVS_ERR_ARGUMENT;
  }
  memset(imu, 0, sizeof *imu);
  return options->imu ? tvs_read_sized(options->imu, TVS_SIZE_THROUGH(tvs_imu_source, next), imu,
                                       sizeof *imu)
                      : TVS_OK;
}

tvs_status tvs_file_source_init_sized(void *memory, size_t size_bytes,
                                      const tvs_file_options *options, tvs_frame_source *source,
                                      size_t source_size) {
  tvs_file_source *made = memory;
  tvs_frame_source own = {0, memory, next_frame, release_frame};
  tvs_file_options read;
  tvs_imu_source imu;
  tvs_status status;
  if (!memory || !options || !source) return TVS_ERR_NULL;
  status = read_options(options, &read, &imu);
  if (status != TVS_OK) return status;
  if (size_bytes < sizeof *made) return TVS_ERR_CAPACITY;
  memset(made, 0, sizeof *made);
  made->options = read;
  made->imu = imu;
  if (read.imu) made->options.imu = &made->imu;
  made->imu_device_ns = INT64_MIN;
  tvs_write_sized(&own, sizeof own, source, source_size);
  return TVS_OK;
}
