/* Compares the rotation between two views with an IMU's, with the IMU's gravity as a prior.
   Attitudes are w x y z, world from body; x is forward, y right, z down. The camera looks forward.
   usage: 07_imu MATCHES.txt fx fy cx cy  w0 x0 y0 z0  w1 x1 y1 z1  sigma_deg */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <twoview/alloc.h>
#include <twoview/twoview.h>

#define DEGREES 57.29577951308232
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

/* Converts a quaternion w x y z of world_from_body to the matrix world_from_camera (row-major). */
static void rotation_of(char **q, double R[9]) {
  const double w = atof(q[0]), x = atof(q[1]), y = atof(q[2]), z = atof(q[3]);
  const double body[9] = {
      1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
      2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
      2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  int r;
  for (r = 0; r < 3; ++r) { /* camera x, y, z = body y, z, x */
    R[3 * r] = body[3 * r + 1];
    R[3 * r + 1] = body[3 * r + 2];
    R[3 * r + 2] = body[3 * r];
  }
}

int main(int argc, char **argv) {
  static double pixels[2][2 * MOST], world[2][9];
  static float ratios[MOST];
  tv_camera camera = {TV_CAMERA_PINHOLE};
  tv_limits limits;
  tv_context *context;
  tv_pixel_pairs pairs;
  tv_estimate_options options;
  tv_two_view pose;
  tv_status status;
  double trace = 0;
  int n, i, k;
  if (argc != 15) return fail("usage: 07_imu MATCHES fx fy cx cy ATTITUDE0 ATTITUDE1 sigma_deg");
  n = read_matches(argv[1], pixels[0], pixels[1], ratios);
  camera.fx = atof(argv[2]);
  camera.fy = atof(argv[3]);
  camera.cx = atof(argv[4]);
  camera.cy = atof(argv[5]);
  /* The verdict needs the image's area: the principal point is taken as the image's middle. */
  camera.width = (int)(2 * camera.cx);
  camera.height = (int)(2 * camera.cy);
  rotation_of(argv + 6, world[0]);
  rotation_of(argv + 10, world[1]);
  tv_limits_init(&limits);
  limits.purposes = TV_PURPOSE_ESTIMATE;
  limits.max_matches = MOST;
  status = tv_context_new(&context, &limits);
  if (status != TV_OK) return fail(tv_status_string(status));
  tv_estimate_options_init(&options);
  memcpy(options.gravity0, world[0] + 6, sizeof options.gravity0); /* down, in the camera frame */
  memcpy(options.gravity1, world[1] + 6, sizeof options.gravity1);
  options.gravity_sigma_rad = atof(argv[14]) / DEGREES;
  tv_two_view_init(&pose);
  tv_pixel_pairs_init(&pairs);
  pairs.num = n;
  pairs.pixels0 = pixels[0];
  pairs.pixels1 = pixels[1];
  pairs.ratios = ratios;
  status = tv_estimate_two_view(context, &camera, &camera, &pairs, &options, &pose, NULL, NULL);
  if (status != TV_OK) return fail(tv_status_string(status));
  if (!pose.has_R) return fail("no rotation");
  for (i = 0; i < 9; ++i) /* trace of R_imu^T R; R_imu = world1^T world0 */
    for (k = 0; k < 3; ++k) trace += world[1][3 * k + i / 3] * world[0][3 * k + i % 3] * pose.R[i];
  printf("%s (%s), %d of %d matches agree\n", tv_kind_string(pose.kind),
         tv_verdict_string(pose.verdict), pose.num_inliers, n);
  printf("the cameras turned by %.3f deg, the IMU differs from that by %.3f deg\n",
         DEGREES * acos(fmax(-1, fmin(1, (pose.R[0] + pose.R[4] + pose.R[8] - 1) / 2))),
         DEGREES * acos(fmax(-1, fmin(1, (trace - 1) / 2))));
  if (pose.has_covariance)
    printf("sigma of the estimated rotation: %.3f deg\n",
           DEGREES * sqrt(pose.covariance[0] + pose.covariance[6] + pose.covariance[12]));
  tv_context_free(context);
  return 0;
}
