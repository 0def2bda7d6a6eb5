/* Maps a room while a drone flies through it: the pictures of an AR.Drone 2.0 with its attitude,
   height and velocity go to the odometry, so that the map is upright and in metres. It sends no
   flight command. To try it without a drone: twoview drone simulate --tour
   usage: 14_drone_map MAP.twm [host [seconds [at-port navdata-port video-port control-port]]] */
#include <stdio.h>
#include <stdlib.h>
#include <twoview/odometry.h>
#include <twoview_drivers/ardrone/sockets.h>
#include <twoview_drivers/h264.h>

enum { MEMORY = 24 << 20 };
static _Alignas(TV_CONTEXT_ALIGNMENT) unsigned char memory[MEMORY];
static uint8_t bytes[MEMORY];
/* About the lens of an AR.Drone 2.0; calibrate your own for a good map (01_calibrate). */
static const tv_camera camera = {TV_CAMERA_BROWN_CONRADY,        640, 360, 0, 568, 567, 320, 180,
                                 {-0.52, 0.27, 0, 0, 0, 0, 0, 0}};

static int fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  return 2;
}

static const int channel[] = {ARDRONE_CHANNEL_AT, ARDRONE_CHANNEL_NAVDATA, ARDRONE_CHANNEL_VIDEO,
                              ARDRONE_CHANNEL_CONTROL};

/* What the drone measured, on the camera's axes: x is the body's y (right), y its z (down), and z
   its x (forward). */
static void measured(const tvs_imu *imu, tv_odometry_frame *frame) {
  const double *q = imu->attitude.world_from_body, w = q[0], x = q[1], y = q[2], z = q[3];
  const double R[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                       2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                       2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  int k;
  for (k = 0; k < 9; ++k) frame->world_from_cam[k] = R[3 * (k / 3) + (k + 1) % 3];
  for (k = 0; k < 3; ++k) frame->velocity_m_s[k] = imu->velocity_m_s[(k + 1) % 3];
  frame->height_m = imu->altitude_m;
  frame->attitude_sigma_rad = imu->valid & TVS_IMU_ATTITUDE ? imu->attitude.sigma_rad : 0;
  frame->height_sigma_m = imu->valid & TVS_IMU_ALTITUDE ? imu->altitude_sigma : 0;
  frame->velocity_sigma_m_s = imu->valid & TVS_IMU_VELOCITY_Z ? imu->velocity_sigma : 0;
}

int main(int argc, char **argv) {
  const int64_t end = ardrone_now_ns() + (int64_t)(1e9 * (argc > 3 ? atof(argv[3]) : 30));
  ardrone_sockets sockets;
  ardrone_transport transport;
  ardrone_session_options options;
  ardrone_session *session;
  tvs_frame_source frames;
  tvs_frame picture = {.struct_size = sizeof picture};
  tvs_imu_source samples;
  tvs_imu imu = {.struct_size = sizeof imu};
  tvs_decoder decoder;
  tv_odometry *odometry;
  tv_odometry_frame frame;
  tv_odometry_state state;
  size_t size, num_bytes = 0;
  void *driver;
  FILE *file;
  int k;
  if (argc < 2) return fail("usage: 14_drone_map MAP.twm [host [seconds [ports]]]");
  if (ardrone_sockets_init(&sockets, argc > 2 ? argv[2] : ARDRONE_DEFAULT_HOST, &transport))
    return fail("no such host");
  for (k = 0; k < 4 && argc > 4 + k; ++k) sockets.port[channel[k]] = (uint16_t)atoi(argv[4 + k]);
  if (tvs_h264_open(&decoder) != TVS_OK) return fail("no H.264 decoder");
  ardrone_session_options_init(&options);
  options.decoder = &decoder;
  ardrone_session_size(&options, &size);
  driver = malloc(size);
  if (!driver || ardrone_session_init(&session, &options, &transport, driver, size) ||
      ardrone_session_frames(session, &frames) || ardrone_session_imu(session, &samples))
    return fail("no session");
  if (tv_odometry_init(&odometry, &camera, NULL, memory, MEMORY)) return fail("no odometry");
  tv_odometry_frame_init(&frame);
  tv_odometry_state_init(&state);
  while (ardrone_now_ns() < end) {
    ardrone_session_step(session, ardrone_now_ns());
    while (samples.next(samples.user, &imu) == TVS_OK) measured(&imu, &frame);
    while (frames.next(frames.user, &picture) == TVS_OK) {
      frame.image = picture.image;
      frame.time_s = 1e-9 * (double)picture.time.host_ns;
      frame.gap = (picture.flags & (TVS_FRAME_GAP | TVS_FRAME_NEW_STREAM)) != 0;
      if (tv_odometry_track(odometry, &frame, &state) == TV_OK && state.num_frames % 15 == 0)
        printf("%-8s at (% .2f, % .2f, % .2f)%s, %d points\n",
               tv_odometry_status_string(state.status), state.world_from_cam_t[0],
               state.world_from_cam_t[1], state.world_from_cam_t[2], state.scale_source ? " m" : "",
               state.num_points);
      frames.release(frames.user, &picture);
    }
    ardrone_session_wait(session, end);
  }
  ardrone_session_close(session);
  tv_odometry_finish(odometry);
  file = fopen(argv[1], "wb");
  if (!file || tv_odometry_save(odometry, bytes, sizeof bytes, &num_bytes) != TV_OK ||
      fwrite(bytes, 1, num_bytes, file) != num_bytes || fclose(file))
    return fail("cannot write the map");
  printf("%d pictures, %d points\n", state.num_frames, state.num_points);
  return state.num_points > 0 ? 0 : 3;
}
