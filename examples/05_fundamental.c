/* The fundamental matrix from matches by RANSAC with the eight-point algorithm, the paper's own
   path: no camera is needed. Prints F and the number of inliers.
   usage: 05_fundamental MATCHES.txt [max_error_px] */
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
  static double pixels[2][2 * MOST];
  static float ratios[MOST];
  static uint8_t inlier[MOST];
  tv_limits limits;
  tv_context *context;
  tv_pixel_pairs pairs;
  tv_estimate_options options;
  tv_two_view found;
  tv_status status;
  double worst = 0;
  int n, k, r;
  if (argc < 2) return fail("usage: 05_fundamental MATCHES.txt [max_error_px]");
  n = read_matches(argv[1], pixels[0], pixels[1], ratios);
  tv_limits_init(&limits);
  limits.purposes = TV_PURPOSE_ESTIMATE; /* no memory for images */
  limits.max_matches = MOST;
  status = tv_context_new(&context, &limits);
  if (status != TV_OK) return fail(tv_status_string(status));
  tv_estimate_options_init(&options);
  options.method = TV_SOLVER_EIGHT_POINT;
  if (argc > 2) options.max_error_px = atof(argv[2]);
  tv_two_view_init(&found);
  tv_pixel_pairs_init(&pairs);
  pairs.num = n;
  pairs.pixels0 = pixels[0];
  pairs.pixels1 = pixels[1];
  pairs.ratios = ratios;
  status = tv_estimate_two_view(context, NULL, NULL, &pairs, &options, &found, NULL, inlier);
  if (status != TV_OK) return fail(tv_status_string(status));
  printf("%s (%s): %d of %d matches agree after %d samples\n", tv_kind_string(found.kind),
         tv_verdict_string(found.verdict), found.num_inliers, n, found.num_iterations);
  for (r = 0; r < 3 && found.has_F; ++r)
    printf("  % .6e % .6e % .6e\n", found.F[3 * r], found.F[3 * r + 1], found.F[3 * r + 2]);
  for (k = 0; k < n && found.has_F; ++k) {
    /* The residual x1^T F x0 is 0 for a match without error. */
    const double *a = pixels[0] + 2 * k, *b = pixels[1] + 2 * k, *F = found.F;
    const double e = b[0] * (F[0] * a[0] + F[1] * a[1] + F[2]) +
                     b[1] * (F[3] * a[0] + F[4] * a[1] + F[5]) + F[6] * a[0] + F[7] * a[1] + F[8];
    if (inlier[k] && e * e > worst) worst = e * e;
  }
  printf("largest (x1' F x0)^2 of those that agree: %.2e\n", worst);
  tv_context_free(context);
  return found.has_F ? 0 : 3;
}
