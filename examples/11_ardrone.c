/* Receives live pictures of an AR.Drone 2.0 with their attitudes, and detects features in every
   tenth one. It sends no flight command. To try it without a drone, run the simulator: twoview
   drone simulate
   usage: 11_ardrone [host [seconds [at-port navdata-port video-port control-port]]] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <twoview/alloc.h>
#include <twoview/twoview.h>
#include <twoview_drivers/ardrone/sockets.h>
#include <twoview_drivers/h264.h>

static int fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  return 2;
}

static void use(tv_context *context, const tvs_frame *frame) {
  static tv_keypoint keypoint[2048];
  static uint8_t descriptor[2048 * TV_DESCRIPTOR_BYTES];
  const double *q = frame->attitude.world_from_body;
  int32_t count = 0;
  if (frame->number % 10 != 0) return;
  if (tv_extract(context, &frame->image, NULL, NULL, keypoint, descriptor, 2048, &count) != TV_OK)
    return;
  printf("picture %llu, %d x %d: %d keypoints%s", (unsigned long long)frame->number,
         frame->image.width, frame->image.height, count,
         frame->flags & TVS_FRAME_GAP ? ", after a gap" : "");
  if (frame->flags & TVS_FRAME_HAS_ATTITUDE)
    printf(", heading %.1f deg", 57.29577951308232 * atan2(2 * (q[0] * q[3] + q[1] * q[2]),
                                                           1 - 2 * (q[2] * q[2] + q[3] * q[3])));
  printf("\n");
}

int main(int argc, char **argv) {
  const char *host = argc > 1 ? argv[1] : ARDRONE_DEFAULT_HOST;
  const int64_t end = ardrone_now_ns() + (int64_t)(1e9 * (argc > 2 ? atof(argv[2]) : 10));
  const int channel[4] = {ARDRONE_CHANNEL_AT, ARDRONE_CHANNEL_NAVDATA, ARDRONE_CHANNEL_VIDEO,
                          ARDRONE_CHANNEL_CONTROL};
  ardrone_sockets sockets;
  ardrone_transport transport;
  ardrone_session_options options;
  ardrone_session *session;
  ardrone_counters counters;
  tvs_frame_source frames;
  tvs_frame frame;
  tvs_decoder decoder;
  tv_limits limits;
  tv_context *context;
  size_t size;
  void *memory;
  int k;
  if (ardrone_sockets_init(&sockets, host, &transport) != TVS_OK) return fail("no such host");
  for (k = 0; k < 4 && argc > 3 + k; ++k) sockets.port[channel[k]] = (uint16_t)atoi(argv[3 + k]);
  if (tvs_h264_open(&decoder) != TVS_OK) return fail("no H.264 decoder");
  tv_limits_init(&limits);
  limits.max_width = 1280;
  limits.max_height = 720;
  if (tv_context_new(&context, &limits) != TV_OK) return fail("no memory");
  ardrone_session_options_init(&options);
  options.decoder = &decoder;
  ardrone_session_size(&options, &size);
  memory = malloc(size);
  if (!memory || ardrone_session_init(&session, &options, &transport, memory, size) != TVS_OK)
    return fail("no session");
  ardrone_session_frames(session, &frames);
  frame.struct_size = sizeof frame;
  while (ardrone_now_ns() < end) {
    ardrone_session_step(session, ardrone_now_ns());
    while (frames.next(frames.user, &frame) == TVS_OK) {
      use(context, &frame);
      frames.release(frames.user, &frame);
    }
    ardrone_session_wait(session, end);
  }
  ardrone_session_counters(session, &counters);
  printf("%llu navdata, %llu pictures, %llu gaps\n", (unsigned long long)counters.navdata_received,
         (unsigned long long)counters.frames_decoded, (unsigned long long)counters.gaps);
  ardrone_session_close(session);
  tvs_h264_close(&decoder);
  tv_context_free(context);
  free(memory);
  return counters.frames_decoded > 0 ? 0 : 3;
}
