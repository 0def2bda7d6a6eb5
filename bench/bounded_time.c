/* The time of tv_reconstruct on images made to be slow and on natural images, with a fixed number
   of iterations.

   usage: bounded_time A0.pgm B0.pgm [A1.pgm B1.pgm ...]     natural pairs, 640x480, binary PGM

   Each time is the least of five CPU times of the process. The exit status is 1 if the largest time
   is more than 1.5 times the median over the natural pairs. scripts/bounded_time runs this program.
 */
#define _POSIX_C_SOURCE 199309L /* declares clock_gettime */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <twoview/alloc.h>
#include <twoview/twoview.h>

enum { WIDTH = 640, HEIGHT = 480, RUNS = 5, ITERATIONS = 200, MAX_PAIRS = 256, SHIFT = 7 };

static unsigned char pixels[2][WIDTH * HEIGHT];
static unsigned state = 1;

static int read_pgm(const char *path, unsigned char *out) {
  int width, height, ok;
  FILE *file = fopen(path, "rb");
  ok = file && fscanf(file, "P5 %d %d 255", &width, &height) == 2 && fgetc(file) != EOF &&
       width == WIDTH && height == HEIGHT && fread(out, 1, WIDTH * HEIGHT, file) == WIDTH * HEIGHT;
  if (file) fclose(file);
  return ok;
}

static int random_below(int n) {
  state = state * 1664525u + 1013904223u;
  return (int)((state >> 8) % (unsigned)n);
}

static int hash_of(int x, int y) {
  unsigned hash = (unsigned)x * 7919u + (unsigned)y * 104729u;
  hash ^= hash >> 7;
  return (int)(hash * 2654435761u >> 24);
}

static int blank(int x, int y, int size) { return (void)x, (void)y, (void)size, 128; }
static int noise(int x, int y, int size) {
  return (void)x, (void)y, 128 + random_below(2 * size + 1) - size;
}
static int checkerboard(int x, int y, int size) { return (x / size + y / size) % 2 ? 255 : 0; }
static int dots(int x, int y, int size) { return x % size < 2 && y % size < 2 ? 255 : 0; }
static int blocks(int x, int y, int size) { return hash_of(x / size, y / size); }
static int repeated(int x, int y, int size) { return hash_of(x % size, y % size); }

static const struct {
  const char *name;
  int (*grey)(int x, int y, int size);
  int sizes[8];
} kinds[] = {{"blank", blank, {1}},
             {"noise", noise, {2, 5, 10, 25, 60, 127}},
             {"checkerboard", checkerboard, {1, 2, 3, 4, 8, 16, 32}},
             {"dots", dots, {4, 5, 7, 8, 12, 20}},
             {"blocks", blocks, {2, 3, 4, 5, 6, 12}},
             {"repeated", repeated, {16, 24, 32, 64}}};

static double now_ms(void) {
  struct timespec time;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * (double)time.tv_sec + 1e-6 * (double)time.tv_nsec;
}

static double time_pair(tv_context *context, const char *name, int size) {
  tv_camera camera = {0};
  tv_view views[2];
  tv_estimate_options estimate;
  tv_reconstruct_options options;
  tv_two_view pose;
  tv_reconstruction found;
  double least = 1e300;
  int k;
  camera.model = TV_CAMERA_PINHOLE;
  camera.width = WIDTH;
  camera.height = HEIGHT;
  camera.fx = camera.fy = 525;
  camera.cx = 0.5 * (WIDTH - 1);
  camera.cy = 0.5 * (HEIGHT - 1);
  for (k = 0; k < 2; ++k) {
    tv_view_init(&views[k]);
    views[k].image.data = pixels[k];
    views[k].image.width = views[k].image.stride_bytes = WIDTH;
    views[k].image.height = HEIGHT;
    views[k].camera = &camera;
  }
  tv_estimate_options_init(&estimate);
  estimate.fixed_iterations = ITERATIONS;
  tv_reconstruct_options_init(&options);
  options.estimate = &estimate;
  for (k = 0; k < RUNS; ++k) {
    const double start = now_ms();
    tv_two_view_init(&pose);
    tv_reconstruction_init(&found);
    if (tv_reconstruct(context, &views[0], &views[1], &options, &pose, NULL, &found) != TV_OK)
      exit(2);
    if (now_ms() - start < least) least = now_ms() - start;
  }
  printf("%-14s %4d %8.2f ms  %4d %4d keypoints %4d matches\n", name, size, least,
         (int)found.num_keypoints[0], (int)found.num_keypoints[1], (int)pose.num_matches);
  return least;
}

static int ascending(const void *a, const void *b) {
  return (*(const double *)a > *(const double *)b) - (*(const double *)a < *(const double *)b);
}

int main(int argc, char **argv) {
  static double natural[MAX_PAIRS];
  tv_limits limits;
  tv_context *context;
  double worst = 0, median;
  int num = 0, k, s, v, x, y;
  tv_limits_init(&limits);
  if (tv_context_new(&context, &limits) != TV_OK) return 2;
  for (k = 1; k + 1 < argc && num < MAX_PAIRS; k += 2) {
    if (!read_pgm(argv[k], pixels[0]) || !read_pgm(argv[k + 1], pixels[1])) {
      fprintf(stderr, "bounded_time: %s, %s: no 640x480 PGM\n", argv[k], argv[k + 1]);
      return 2;
    }
    natural[num++] = time_pair(context, "natural", k / 2);
  }
  if (num == 0) return fputs("bounded_time: no natural pair\n", stderr), 2;
  for (k = 0; k < (int)(sizeof kinds / sizeof kinds[0]); ++k) {
    for (s = 0; s < 8 && kinds[k].sizes[s] > 0; ++s) {
      double time;
      for (v = 0; v < 2; ++v) {
        for (y = 0; y < HEIGHT; ++y) {
          for (x = 0; x < WIDTH; ++x) {
            pixels[v][y * WIDTH + x] =
                (unsigned char)kinds[k].grey(x + v * SHIFT, y, kinds[k].sizes[s]);
          }
        }
      }
      time = time_pair(context, kinds[k].name, kinds[k].sizes[s]);
      if (time > worst) worst = time;
    }
  }
  qsort(natural, (size_t)num, sizeof natural[0], ascending);
  median = natural[num / 2];
  printf("worst %.2f ms, median of %d natural pairs %.2f ms: %.2f (at most 1.5)\n", worst, num,
         median, worst / median);
  tv_context_free(context);
  return worst > 1.5 * median;
}
