/* Calls one stage CALLS times with the library's default options. The program needs only the
   library and libc, so that bench/counts.py can count its instructions in qemu without OpenCV.

     stages A.pgm B.pgm fx fy cx cy STAGE CALLS [KERNELS]

   STAGE: detect, describe, match, estimate, pair. Before these calls the features of both images
   are extracted and matched once, whatever STAGE is; a run with CALLS 0 does only this. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "twoview/alloc.h"
#include "twoview/twoview.h"

enum { MAX_KEYPOINTS = 2048 };

typedef struct stages {
  tv_context *context;
  tv_image image[2];
  tv_camera camera;
  tv_keypoint keypoints[2][MAX_KEYPOINTS];
  uint8_t descriptors[2][MAX_KEYPOINTS * TV_DESCRIPTOR_BYTES];
  int32_t num_keypoints[2];
  tv_correspondence matches[MAX_KEYPOINTS];
  int32_t num_matches;
  double pixels[2][2 * MAX_KEYPOINTS];
  float ratios[MAX_KEYPOINTS];
  tv_two_view pose;
} stages;

static void require(int held, const char *what) {
  if (held) return;
  fprintf(stderr, "stages: %s\n", what);
  exit(1);
}

static tv_image read_pgm(const char *path) {
  tv_image image = {NULL, 0, 0, 0};
  FILE *file = fopen(path, "rb");
  int width, height;
  unsigned char *data;
  require(file && fscanf(file, "P5 %d %d 255", &width, &height) == 2 && fgetc(file) != EOF, path);
  data = malloc((size_t)width * (size_t)height);
  require(data && fread(data, 1, (size_t)width * (size_t)height, file) == (size_t)width * height,
          path);
  fclose(file);
  image.data = data;
  image.width = width;
  image.height = height;
  image.stride_bytes = width;
  return image;
}

static void detect(stages *s) {
  require(tv_detect(s->context, &s->image[0], NULL, NULL, s->keypoints[0], MAX_KEYPOINTS,
                    &s->num_keypoints[0]) == TV_OK,
          "tv_detect");
}

static void describe(stages *s) {
  require(tv_describe(s->context, &s->image[0], s->keypoints[0], s->num_keypoints[0], NULL,
                      s->descriptors[0]) == TV_OK,
          "tv_describe");
}

static void extract_both(stages *s) {
  int v;
  for (v = 0; v < 2; ++v) {
    require(tv_extract(s->context, &s->image[v], NULL, NULL, s->keypoints[v], s->descriptors[v],
                       MAX_KEYPOINTS, &s->num_keypoints[v]) == TV_OK,
            "tv_extract");
  }
}

static void match(stages *s) {
  tv_features features[2];
  int v;
  for (v = 0; v < 2; ++v) {
    tv_features_init(&features[v]);
    features[v].num = s->num_keypoints[v];
    features[v].keypoints = s->keypoints[v];
    features[v].descriptors = s->descriptors[v];
  }
  require(tv_match(s->context, &features[0], &features[1], NULL, s->matches, MAX_KEYPOINTS,
                   &s->num_matches) == TV_OK,
          "tv_match");
}

static void gather(stages *s) {
  int k;
  for (k = 0; k < s->num_matches; ++k) {
    const tv_keypoint *p = &s->keypoints[0][s->matches[k].idx0];
    const tv_keypoint *q = &s->keypoints[1][s->matches[k].idx1];
    s->pixels[0][2 * k] = p->x;
    s->pixels[0][2 * k + 1] = p->y;
    s->pixels[1][2 * k] = q->x;
    s->pixels[1][2 * k + 1] = q->y;
    s->ratios[k] = s->matches[k].ratio;
  }
}

static void estimate(stages *s) {
  tv_pixel_pairs pairs;
  tv_pixel_pairs_init(&pairs);
  pairs.num = s->num_matches;
  pairs.pixels0 = s->pixels[0];
  pairs.pixels1 = s->pixels[1];
  pairs.ratios = s->ratios;
  tv_two_view_init(&s->pose);
  require(tv_estimate_two_view(s->context, &s->camera, &s->camera, &pairs, NULL, &s->pose, NULL,
                               NULL) == TV_OK,
          "tv_estimate_two_view");
}

static void pair(stages *s) {
  tv_view views[2];
  tv_reconstruction cloud;
  int v;
  for (v = 0; v < 2; ++v) {
    tv_view_init(&views[v]);
    views[v].image = s->image[v];
    views[v].camera = &s->camera;
  }
  tv_two_view_init(&s->pose);
  tv_reconstruction_init(&cloud);
  require(tv_reconstruct(s->context, &views[0], &views[1], NULL, &s->pose, NULL, &cloud) == TV_OK,
          "tv_reconstruct");
}

static tv_context *make_context(const tv_image *image, const char *kernels) {
  tv_limits limits;
  tv_context *context = NULL;
  tv_limits_init(&limits);
  limits.max_width = image->width;
  limits.max_height = image->height;
  while (strcmp(kernels, tv_kernels_string((tv_kernels)limits.kernels)) != 0) {
    require(++limits.kernels <= 64, "no such kernel set");
  }
  require(tv_context_new(&context, &limits) == TV_OK, "tv_context_new");
  return context;
}

int main(int argc, char **argv) {
  static const struct {
    const char *name;
    void (*call)(stages *);
  } list[] = {{"detect", detect},
              {"describe", describe},
              {"match", match},
              {"estimate", estimate},
              {"pair", pair}};
  static stages s;
  int k, calls;
  require(
      argc == 9 || argc == 10,
      "usage: stages A.pgm B.pgm fx fy cx cy detect|describe|match|estimate|pair CALLS [KERNELS]");
  for (k = 0; k < 2; ++k) s.image[k] = read_pgm(argv[1 + k]);
  s.camera.width = s.image[0].width;
  s.camera.height = s.image[0].height;
  s.camera.fx = atof(argv[3]);
  s.camera.fy = atof(argv[4]);
  s.camera.cx = atof(argv[5]);
  s.camera.cy = atof(argv[6]);
  s.context = make_context(&s.image[0], argc == 10 ? argv[9] : "auto");
  extract_both(&s);
  match(&s);
  gather(&s);
  for (k = 0; k < (int)(sizeof list / sizeof list[0]); ++k) {
    if (strcmp(argv[7], list[k].name) != 0) continue;
    for (calls = atoi(argv[8]); calls > 0; --calls) list[k].call(&s);
    return 0;
  }
  require(0, "no such stage");
  return 2;
}
