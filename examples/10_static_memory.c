/* Uses no malloc: the context lies in a static array, as on a flight computer. The program draws
   its own pair of images: a textured wall with two depths, seen from two places.
   usage: 10_static_memory */
#include <stdio.h>
#include <stdlib.h>
#include <twoview/twoview.h>

enum { WIDTH = 640, HEIGHT = 480, MEMORY = 3 << 20 };

static _Alignas(TV_CONTEXT_ALIGNMENT) unsigned char memory[MEMORY];
static uint8_t pixels[2][WIDTH * HEIGHT];

static unsigned next_random(void) {
  static unsigned state = 1;
  state = state * 1664525u + 1013904223u;
  return state >> 8;
}

/* Blocks of random grey. Those of the lower half are nearer, so they move about three times as
   far. */
static void paint(void) {
  int k, x, y;
  for (k = 0; k < 6000; ++k) {
    const int left = (int)(next_random() % (WIDTH - 60)) + 40,
              top = (int)(next_random() % (HEIGHT - 8));
    const int side = 4 + (int)(next_random() % 5),
              shift = top < HEIGHT / 2 ? 6 + k % 5 : 24 + k % 5;
    const uint8_t grey = (uint8_t)next_random();
    for (y = top; y < top + side && y < HEIGHT; ++y) {
      for (x = left; x < left + side; ++x) {
        pixels[0][y * WIDTH + x] = grey;
        pixels[1][y * WIDTH + x - shift] = grey;
      }
    }
  }
}

int main(void) {
  const tv_camera camera = {TV_CAMERA_PINHOLE, WIDTH, HEIGHT, 0, 520, 520, 319.5, 239.5, {0}};
  const tv_image image[2] = {{pixels[0], WIDTH, HEIGHT, WIDTH}, {pixels[1], WIDTH, HEIGHT, WIDTH}};
  tv_view view[2];
  tv_limits limits;
  tv_context *context;
  tv_two_view pose;
  tv_reconstruction cloud;
  tv_status status;
  size_t needed;
  int v;
  tv_limits_init(&limits); /* defaults: 640 x 480 px, 2048 keypoints */
  status = tv_context_size(&limits, &needed);
  if (status == TV_OK) status = tv_context_init(&context, &limits, memory, sizeof memory);
  if (status != TV_OK) {
    fprintf(stderr, "%s: %lu bytes are needed, %d are there\n", tv_status_string(status),
            (unsigned long)needed, MEMORY);
    return 2;
  }
  paint();
  for (v = 0; v < 2; ++v) {
    tv_view_init(&view[v]);
    view[v].image = image[v];
    view[v].camera = &camera;
  }
  tv_two_view_init(&pose);
  tv_reconstruction_init(&cloud);
  status = tv_reconstruct(context, &view[0], &view[1], NULL, &pose, NULL, &cloud);
  if (status != TV_OK) return 2;
  printf("%s (%s): %d of %d matches agree, t = (%.3f, %.3f, %.3f)\n", tv_kind_string(pose.kind),
         tv_verdict_string(pose.verdict), pose.num_inliers, pose.num_matches, pose.t[0], pose.t[1],
         pose.t[2]);
  printf("%lu of %lu bytes used, none of the heap\n", (unsigned long)tv_context_high_water(context),
         (unsigned long)needed);
  return pose.has_t ? 0 : 3;
}
