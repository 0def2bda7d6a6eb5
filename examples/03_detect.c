/* Detects FAST corners in an image and draws them, as in figure 6 of the paper. An arc of 12 of 16
   pixels, the default, is the paper's.
   usage: 03_detect IMAGE.pgm OUT.ppm [arc 9..12] [threshold] */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <twoview/alloc.h>
#include <twoview/twoview.h>

/* An 8-bit PGM (P5) as a luma image; `data` is null when it cannot be read. */
static tv_image read_pgm(const char *path) {
  tv_image image = {NULL, 0, 0, 0};
  FILE *file = fopen(path, "rb");
  int width, height, top;
  if (file && fscanf(file, "P5 %d %d %d", &width, &height, &top) == 3 && fgetc(file) != EOF &&
      width > 0 && height > 0 && width <= 16384 && height <= 16384 && top == 255) {
    uint8_t *data = malloc((size_t)width * (size_t)height);
    if (data && fread(data, (size_t)width, (size_t)height, file) == (size_t)height)
      image = (tv_image){data, width, height, width};
    else
      free(data);
  }
  if (file) fclose(file);
  return image;
}

static int fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  return 2;
}

int main(int argc, char **argv) {
  enum { MOST = 20000 };
  static tv_keypoint corner[MOST];
  tv_limits limits;
  tv_context *context;
  tv_feature_options options;
  tv_status status;
  tv_image image;
  int32_t count, k;
  int x, y;
  uint8_t *marked;
  FILE *out;
  if (argc < 3) return fail("usage: 03_detect IMAGE.pgm OUT.ppm [arc 9..12] [threshold]");
  image = read_pgm(argv[1]);
  if (!image.data) return fail("cannot read the image");
  tv_limits_init(&limits);
  limits.max_width = image.width;
  limits.max_height = image.height;
  limits.max_keypoints = MOST;
  status = tv_context_new(&context, &limits);
  if (status != TV_OK) return fail(tv_status_string(status));
  tv_feature_options_init(&options);
  options.max_keypoints = MOST;
  options.arc = argc > 3 ? atoi(argv[3]) : 12;
  options.threshold = argc > 4 ? atoi(argv[4]) : 20;
  options.levels = 1;
  options.cell_px = 0;
  options.min_threshold = 0; /* 0: never lower the threshold to get more corners */
  status = tv_detect(context, &image, NULL, &options, corner, MOST, &count);
  if (status != TV_OK) return fail(tv_status_string(status));
  printf("FAST-%d at threshold %d: %d corners\n", options.arc, options.threshold, count);

  marked = calloc((size_t)image.width, (size_t)image.height);
  out = fopen(argv[2], "wb");
  if (!marked || !out) return fail("cannot write");
  for (k = 0; k < count; ++k) {
    for (x = -2; x <= 2; ++x) { /* draw a cross; corners are >= 3 px from the border */
      const int column = (int)lround(corner[k].x), row = (int)lround(corner[k].y);
      marked[row * image.width + column + x] = marked[(row + x) * image.width + column] = 1;
    }
  }
  fprintf(out, "P6\n%d %d\n255\n", image.width, image.height);
  for (y = 0; y < image.height; ++y) {
    for (x = 0; x < image.width; ++x) {
      const uint8_t grey = image.data[y * image.stride_bytes + x];
      const int mark = marked[y * image.width + x];
      fputc(mark ? 255 : grey, out);
      fputc(mark ? 90 : grey, out);
      fputc(mark ? 0 : grey, out);
    }
  }
  if (fclose(out) != 0) return fail("cannot write");
  free(marked);
  free((void *)image.data);
  tv_context_free(context);
  return 0;
}
