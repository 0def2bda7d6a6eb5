#include "twoview_drivers/file_source.h"

#include <string.h>

#include "twoview_drivers/attitude.h"

struct tvs_file_source {
  tvs_file_options options;
  uint64_t index; /* number of the next picture to read */
  int gap;        /* whether a picture was left out since the last frame */
  int imu_ended;
  int64_t imu_device_ns; /* time of the newest attitude that was read from options.imu, ns */
  tvs_attitudes attitudes;
};

void tvs_file_options_init(tvs_file_options *options) {
  if (!options) return;
  memset(options, 0, sizeof *options);
  options->struct_size = sizeof *options;
  options->frames_per_second = 30;
  options->clock_id = 1;
  options->max_gap_ns = 100000000;
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

static tvs_status next_frame(void *user, tvs_frame *frame) {
  tvs_file_source *source = user;
  tvs_picture picture;
  int64_t device_ns;
  uint64_t index;
  tvs_status status;
  if (!frame) return TVS_ERR_NULL;
  if (frame->struct_size != sizeof *frame) return TVS_ERR_STRUCT_SIZE;
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
  memset(&frame->attitude, 0, sizeof frame->attitude);
  if (source->options.imu) {
    read_attitudes_until(source, device_ns);
    if (tvs_attitudes_at(&source->attitudes, source->options.clock_id, device_ns,
                         source->options.max_gap_ns, &frame->attitude) == TVS_OK) {
      frame->flags |= TVS_FRAME_HAS_ATTITUDE;
    }
  }
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

tvs_status tvs_file_source_init(void *memory, size_t size_bytes, const tvs_file_options *options,
                                tvs_frame_source *source) {
  tvs_file_source *made = memory;
  if (!memory || !options || !source) return TVS_ERR_NULL;
  if (options->struct_size != sizeof *options) return TVS_ERR_STRUCT_SIZE;
  if (!options->read) return TVS_ERR_NULL;
  if (!(options->frames_per_second > 0 && options->frames_per_second <= 10000) ||
      options->clock_id == 0 || options->max_gap_ns < 0) {
    return TVS_ERR_ARGUMENT;
  }
  if (options->imu && options->imu->struct_size != sizeof *options->imu) return TVS_ERR_STRUCT_SIZE;
  if (size_bytes < sizeof *made) return TVS_ERR_CAPACITY;
  memset(made, 0, sizeof *made);
  made->options = *options;
  made->imu_device_ns = INT64_MIN;
  source->struct_size = sizeof *source;
  source->user = made;
  source->next = next_frame;
  source->release = release_frame;
  return TVS_OK;
}
