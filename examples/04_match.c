/* Corners, SIFT descriptors and matches of two images, one call a stage: two nearest neighbours,
   ratio test, one-to-one. Prints x0 y0 x1 y1 ratio.
   usage: 04_match A.pgm B.pgm [ratio] */
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

/* A corner has one or two orientations, and one keypoint for each orientation. */
enum { CORNERS = 2048, MOST = 2 * CORNERS };

int main(int argc, char **argv) {
  static tv_keypoint corner[CORNERS], keypoint[2][MOST];
  static uint8_t descriptor[2][MOST * TV_DESCRIPTOR_BYTES];
  static tv_correspondence match[MOST];
  int32_t count[2], corners, matches, v, k;
  tv_match_options options;
  tv_limits limits;
  tv_context *context;
  tv_features features[2];
  tv_image image[2];
  tv_status status;
  if (argc < 3) return fail("usage: 04_match A.pgm B.pgm [ratio]");
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 1;
  limits.max_keypoints = MOST;
  for (v = 0; v < 2; ++v) {
    image[v] = read_pgm(argv[1 + v]);
    if (!image[v].data) return fail("cannot read an image");
    if (image[v].width > limits.max_width) limits.max_width = image[v].width;
    if (image[v].height > limits.max_height) limits.max_height = image[v].height;
  }
  status = tv_context_new(&context, &limits);
  if (status != TV_OK) return fail(tv_status_string(status));
  for (v = 0; v < 2; ++v) { /* tv_extract: tv_detect, tv_orient, tv_describe in one */
    status = tv_detect(context, &image[v], NULL, NULL, corner, CORNERS, &corners);
    if (status == TV_OK)
      status = tv_orient(context, &image[v], corner, corners, NULL, keypoint[v], MOST, &count[v]);
    if (status == TV_OK)
      status = tv_describe(context, &image[v], keypoint[v], count[v], NULL, descriptor[v]);
    if (status != TV_OK) return fail(tv_status_string(status));
  }
  tv_match_options_init(&options);
  if (argc > 3) options.ratio = (float)atof(argv[3]);
  for (v = 0; v < 2; ++v) {
    tv_features_init(&features[v]);
    features[v].num = count[v];
    features[v].keypoints = keypoint[v];
    features[v].descriptors = descriptor[v];
  }
  status = tv_match(context, &features[0], &features[1], &options, match, MOST, &matches);
  if (status != TV_OK) return fail(tv_status_string(status));
  fprintf(stderr, "%d and %d keypoints, %d matches\n", count[0], count[1], matches);
  for (k = 0; k < matches; ++k) {
    const tv_keypoint *a = &keypoint[0][match[k].idx0], *b = &keypoint[1][match[k].idx1];
    printf("%.3f %.3f %.3f %.3f %.4f\n", a->x, a->y, b->x, b->y, match[k].ratio);
  }
  for (v = 0; v < 2; ++v) free((void *)image[v].data);
  tv_context_free(context);
  return 0;
}
