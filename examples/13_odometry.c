/* Follows a camera through a row of pictures: the odometry and its map lie in a static array, as on
   a flight computer. Prints where the camera was at the end of each tenth picture.
   usage: 13_odometry fx fy cx cy FRAME.pgm... */
#include <stdio.h>
#include <stdlib.h>
#include <twoview/odometry.h>

enum { MEMORY = 24 << 20, PIXELS = 1 << 20 };

static _Alignas(TV_CONTEXT_ALIGNMENT) unsigned char memory[MEMORY];
static uint8_t pixels[PIXELS];

static int fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  return 2;
}

static int read_pgm(const char *path, tv_image *image) {
  FILE *file = fopen(path, "rb");
  int width = 0, height = 0, most = 0;
  size_t count = 0;
  if (!file) return 0;
  if (fscanf(file, "P5 %d %d %d", &width, &height, &most) == 3 && most == 255 && width > 0 &&
      height > 0 && width <= PIXELS / height) {
    fgetc(file);
    count = fread(pixels, 1, (size_t)width * (size_t)height, file);
  }
  fclose(file);
  image->data = pixels;
  image->width = width;
  image->height = height;
  image->stride_bytes = width;
  return count > 0 && count == (size_t)width * (size_t)height;
}

int main(int argc, char **argv) {
  tv_camera camera = {TV_CAMERA_PINHOLE};
  tv_odometry_options options;
  tv_odometry *odometry = NULL;
  tv_odometry_frame frame;
  tv_odometry_state state;
  tv_status status;
  size_t needed = 0;
  int k, known = 0;
  if (argc < 6) return fail("usage: 13_odometry fx fy cx cy FRAME.pgm...");
  camera.fx = atof(argv[1]);
  camera.fy = atof(argv[2]);
  camera.cx = atof(argv[3]);
  camera.cy = atof(argv[4]);
  tv_odometry_frame_init(&frame);
  tv_odometry_state_init(&state);
  tv_odometry_options_init(&options); /* defaults: 1000 keypoints, 200 keyframes, 20000 points */
  for (k = 5; k < argc; ++k) {
    if (!read_pgm(argv[k], &frame.image)) return fail("cannot read a picture");
    if (!odometry) { /* the first picture tells the size */
      camera.width = frame.image.width;
      camera.height = frame.image.height;
      status = tv_odometry_size(&camera, &options, &needed);
      if (status == TV_OK)
        status = tv_odometry_init(&odometry, &camera, &options, memory, sizeof memory);
      if (status != TV_OK) {
        fprintf(stderr, "%s: %lu bytes are needed, %d are there\n", tv_status_string(status),
                (unsigned long)needed, MEMORY);
        return 2;
      }
    }
    frame.time_s = (k - 5) / 30.0;
    status = tv_odometry_track(odometry, &frame, &state);
    if (status != TV_OK) return fail(tv_status_string(status));
    known += state.has_pose;
    if ((k - 5) % 10 == 9 || k + 1 == argc) {
      printf("%6.2f s  %-8s", frame.time_s, tv_odometry_status_string(state.status));
      if (state.has_pose)
        printf("  at (% .3f, % .3f, % .3f)", state.world_from_cam_t[0], state.world_from_cam_t[1],
               state.world_from_cam_t[2]);
      printf("\n");
    }
  }
  printf("%d of %d poses known, %d keyframes, %d points\n", known, argc - 5, state.num_keyframes,
         state.num_points);
  printf("%lu bytes, none of the heap\n", (unsigned long)needed);
  return state.has_pose ? 0 : 3;
}
