/* The frame loop of a flight program: NV12 pictures with a stride, as V4L2 has them, each with its
   time, to poses in static memory; with frames that come twice, and a clock that begins anew.
   usage: 16_frame_loop fx fy cx cy WIDTH HEIGHT STRIDE FRAMES|- [TIMES]
   FRAMES: NV12 pictures one after the other, - for stdin. TIMES: the seconds of each; without it
   the time is CLOCK_MONOTONIC's when the frame is there. */
#define _POSIX_C_SOURCE 200112L
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <twoview/odometry.h>
#include <unistd.h>

enum { MEMORY = 24 << 20, BUFFER = 4 << 20, TIMES = 1 << 20 };

static _Alignas(TV_CONTEXT_ALIGNMENT) unsigned char memory[MEMORY];
static uint8_t buffer[BUFFER];
static char times[TIMES];

static int fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  return 2;
}

/* A pipe gives what it has: reads until size bytes are there, or to the end. */
static size_t read_whole(int file, void *bytes, size_t size) {
  size_t num = 0;
  ssize_t more;
  while (num < size && (more = read(file, (char *)bytes + num, size - num)) > 0)
    num += (size_t)more;
  return num;
}

static double monotonic_s(void) {
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* TV_ERR_TIME: the frame is not later than the one before. By less than a second, it came twice or
   out of order, and the caller leaves it out; by more, the clock began anew, which gap 1 allows. */
static tv_status track(tv_odometry *odometry, tv_odometry_frame *frame, double last_s,
                       tv_odometry_state *state) {
  const tv_status status = tv_odometry_track(odometry, frame, state);
  if (status != TV_ERR_TIME || frame->time_s > last_s - 1) return status;
  frame->gap = 1;
  printf("%8.3f s  the clock began anew after %.3f s\n", frame->time_s, last_s);
  return tv_odometry_track(odometry, frame, state);
}

/* Here the vehicle's estimator is fed: with a pose, by a larger covariance where it is weak; with
   the attitude alone (rotation); or with nothing, and it goes on by its other sensors. */
static void give(double time_s, const tv_odometry_state *state) {
  const double *t = state->world_from_cam_t;
  printf("%8.3f s  %-8s", time_s, tv_odometry_status_string(state->status));
  if (state->has_pose && state->status != TV_ODOMETRY_ROTATION)
    printf("  at (% .3f, % .3f, % .3f) of segment %d", t[0], t[1], t[2], state->segment);
  printf("\n");
}

int main(int argc, char **argv) {
  tv_camera camera = {TV_CAMERA_PINHOLE};
  tv_odometry *odometry;
  tv_odometry_frame frame;
  tv_odometry_state state;
  tv_status status;
  char *at = NULL, *end = times;
  double last_s = 0;
  int file, num = 0, num_left_out = 0, num_known = 0;
  size_t size, got;
  if (argc < 9) return fail("usage: 16_frame_loop fx fy cx cy WIDTH HEIGHT STRIDE FRAMES [TIMES]");
  camera.fx = atof(argv[1]), camera.fy = atof(argv[2]);
  camera.cx = atof(argv[3]), camera.cy = atof(argv[4]);
  camera.width = atoi(argv[5]), camera.height = atoi(argv[6]);
  status = tv_odometry_init(&odometry, &camera, NULL, memory, sizeof memory);
  if (status != TV_OK) return fail(tv_status_string(status));
  tv_odometry_frame_init(&frame);
  tv_odometry_state_init(&state);
  frame.image = (tv_image){buffer, camera.width, camera.height, atoi(argv[7])};
  /* Behind the rows of Y are half as many of U and V, which nothing reads. */
  size = (size_t)atoi(argv[7]) * (size_t)(camera.height + (camera.height + 1) / 2);
  if (atoi(argv[7]) < 1 || size > BUFFER) return fail("the stride is out of its range");
  if (argc > 9 && read_whole(open(argv[9], O_RDONLY), times, TIMES - 1) == 0)
    return fail("no times");
  file = argv[8][0] == '-' ? 0 : open(argv[8], O_RDONLY);
  while ((got = read_whole(file, buffer, size)) == size) {
    frame.time_s = argc > 9 ? strtod(at = end, &end) : monotonic_s();
    if (argc > 9 && end == at) return fail("TIMES ends before the frames");
    status = track(odometry, &frame, last_s, &state);
    if (status == TV_ERR_TIME && ++num_left_out) continue;
    if (status != TV_OK) return fail(tv_status_string(status)); /* which names the argument */
    give(frame.time_s, &state);
    num_known += state.has_pose, ++num;
    last_s = frame.time_s, frame.gap = 0;
  }
  if (num == 0 || got > 0) return fail(num == 0 ? "no frame" : "the last frame is cut off");
  printf("%d frames, %d poses known, %d frames left out\n", num, num_known, num_left_out);
  return state.has_pose ? 0 : 3;
}
