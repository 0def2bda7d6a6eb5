/* Triangulates matches by all seven methods from one pose: the paper's table 1 with your own
   matches.
   usage: 08_triangulate MATCHES.txt fx fy cx0 cx1 cy */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <twoview/alloc.h>
#include <twoview/twoview.h>

enum { MOST = 20000 };

/* Lines of x0 y0 x1 y1 ratio, as 04_match prints them. */
static int read_matches(const char *path, double *pixels0, double *pixels1, float *ratios) {
  FILE *file = fopen(path, "r");
  int n = 0;
  while (file && n < MOST &&
         fscanf(file, "%lf %lf %lf %lf %f", &pixels0[2 * n], &pixels0[2 * n + 1], &pixels1[2 * n],
                &pixels1[2 * n + 1], &ratios[n]) == 5)
    ++n;
  if (file) fclose(file);
  return n;
}

static int fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  return 2;
}

int main(int argc, char **argv) {
  static const char *const name[] = {"Poly",      "Poly-Abs",        "Linear-Eigen",
                                     "Linear-LS", "Iterative-Eigen", "Iterative-LS",
                                     "Midpoint"};
  static double pixels[2][2 * MOST];
  static float ratios[MOST];
  static uint8_t inlier[MOST];
  static tv_point point[MOST];
  tv_camera camera[2] = {{0}, {0}};
  tv_limits limits;
  tv_context *context;
  tv_pixel_pairs pairs;
  tv_camera_pair pair;
  tv_two_view pose;
  tv_status status;
  int n, k, v, method, kept = 0;
  if (argc != 7) return fail("usage: 08_triangulate MATCHES.txt fx fy cx0 cx1 cy");
  n = read_matches(argv[1], pixels[0], pixels[1], ratios);
  for (v = 0; v < 2; ++v) {
    camera[v].model = TV_CAMERA_PINHOLE;
    camera[v].width = camera[v].height = 1; /* any size: no image is used */
    camera[v].fx = atof(argv[2]);
    camera[v].fy = atof(argv[3]);
    camera[v].cx = atof(argv[4 + v]);
    camera[v].cy = atof(argv[6]);
  }
  tv_limits_init(&limits);
  limits.purposes = TV_PURPOSE_ESTIMATE;
  limits.max_matches = MOST;
  status = tv_context_new(&context, &limits);
  if (status != TV_OK) return fail(tv_status_string(status));
  tv_two_view_init(&pose);
  tv_pixel_pairs_init(&pairs);
  pairs.num = n;
  pairs.pixels0 = pixels[0];
  pairs.pixels1 = pixels[1];
  pairs.ratios = ratios;
  status = tv_estimate_two_view(context, &camera[0], &camera[1], &pairs, NULL, &pose, NULL, inlier);
  if (status != TV_OK) return fail(tv_status_string(status));
  if (!pose.has_R || !pose.has_t) return fail("no full pose");
  /* The pose with the cameras that it refers to: with the estimated shift of cx, cy, if any. */
  status = tv_corrected_pair(&pose, &camera[0], &camera[1], &pair);
  if (status != TV_OK) return fail(tv_status_string(status));
  for (k = 0; k < n; ++k) { /* moves the inliers to the front */
    if (!inlier[k]) continue;
    for (v = 0; v < 2; ++v) {
      pixels[v][2 * kept] = pixels[v][2 * k];
      pixels[v][2 * kept + 1] = pixels[v][2 * k + 1];
    }
    ++kept;
  }
  pairs.num = kept;
  printf("%-16s %8s %14s\n", "method", "points", "error, px rms");
  for (method = TV_TRIANGULATION_POLY; method <= TV_TRIANGULATION_MIDPOINT; ++method) {
    double sum = 0;
    int good = 0;
    status = tv_triangulate(&pair, &pairs, method, point);
    if (status != TV_OK) return fail(tv_status_string(status));
    for (k = 0; k < kept; ++k) {
      if (point[k].status != TV_POINT_OK) continue;
      sum += (double)point[k].error_px * point[k].error_px;
      ++good;
    }
    printf("%-16s %8d %14.4f\n", name[method], good, good ? sqrt(sum / good) : 0.0);
  }
  tv_context_free(context);
  return 0;
}
