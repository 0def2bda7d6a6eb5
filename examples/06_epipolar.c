/* Prints the epipolar lines in image 1 of some points of image 0, and both epipoles: outside the
   images when the camera moved sideways, inside when it moved forward (the paper's figures 14, 15).

   usage: 06_epipolar MATCHES.txt WIDTH HEIGHT */
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

/* The null vector of F, or with `transposed` of F^T: the largest cross product of two rows. */
static void epipole_of(const double F[9], int transposed, double e[3]) {
  double largest = -1;
  int i, j, c;
  for (i = 0; i < 3; ++i) {
    double a[3], b[3], x[3], size;
    for (c = 0; c < 3; ++c) {
      const int r0 = i, r1 = (i + 1) % 3;
      a[c] = transposed ? F[3 * c + r0] : F[3 * r0 + c];
      b[c] = transposed ? F[3 * c + r1] : F[3 * r1 + c];
    }
    for (j = 0; j < 3; ++j)
      x[j] = a[(j + 1) % 3] * b[(j + 2) % 3] - a[(j + 2) % 3] * b[(j + 1) % 3];
    size = x[0] * x[0] + x[1] * x[1] + x[2] * x[2];
    if (size <= largest) continue;
    largest = size;
    for (j = 0; j < 3; ++j) e[j] = x[j];
  }
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
  int n, k, v, shown = 0;
  if (argc != 4) return fail("usage: 06_epipolar MATCHES.txt WIDTH HEIGHT");
  n = read_matches(argv[1], pixels[0], pixels[1], ratios);
  tv_limits_init(&limits);
  limits.purposes = TV_PURPOSE_ESTIMATE;
  limits.max_matches = MOST;
  if (tv_context_new(&context, &limits) != TV_OK) return fail("no memory");
  tv_estimate_options_init(&options);
  options.method = TV_SOLVER_SEVEN_POINT;
  tv_two_view_init(&found);
  tv_pixel_pairs_init(&pairs);
  pairs.num = n;
  pairs.pixels0 = pixels[0];
  pairs.pixels1 = pixels[1];
  pairs.ratios = ratios;
  if (tv_estimate_two_view(context, NULL, NULL, &pairs, &options, &found, NULL, inlier) != TV_OK ||
      !found.has_F)
    return fail("no fundamental matrix");
  for (v = 0; v < 2; ++v) {
    double e[3], x, y;
    epipole_of(found.F, v, e);
    x = e[0] / e[2];
    y = e[1] / e[2];
    printf("epipole in image %d: (%.1f, %.1f), %s\n", v, x, y,
           x > -0.5 && y > -0.5 && x < atof(argv[2]) - 0.5 && y < atof(argv[3]) - 0.5 ? "inside"
                                                                                      : "outside");
  }
  for (k = 0; k < n && shown < 5; ++k) {
    const double *a = pixels[0] + 2 * k, *b = pixels[1] + 2 * k, *F = found.F;
    const double l[3] = {F[0] * a[0] + F[1] * a[1] + F[2], F[3] * a[0] + F[4] * a[1] + F[5],
                         F[6] * a[0] + F[7] * a[1] + F[8]};
    const double size = hypot(l[0], l[1]);
    if (!inlier[k] || k % 7 != 0) continue;
    ++shown;
    printf("(%6.1f, %6.1f) -> line %+.4f x %+.4f y %+.2f = 0; its match is %.2f px off it\n", a[0],
           a[1], l[0] / size, l[1] / size, l[2] / size,
           fabs(l[0] * b[0] + l[1] * b[1] + l[2]) / size);
  }
  tv_context_free(context);
  return 0;
}
