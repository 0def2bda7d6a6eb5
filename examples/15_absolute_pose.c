/* Finds where a camera was from pixels and the points in space that they see, some of them wrong.
   usage: 15_absolute_pose POINTS.txt fx fy cx cy */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <twoview/alloc.h>
#include <twoview/odometry.h>

#define DEGREES 57.29577951308232
enum { MOST = 20000 };

static int fail(const char *what) {
  fprintf(stderr, "%s\n", what);
  return 2;
}

/* Lines of x y X Y Z: a pixel, and a point in the world's frame, in any unit. */
static int read_points(const char *path, double *pixels, double *points) {
  FILE *file = fopen(path, "r");
  int n = 0;
  while (file && n < MOST &&
         fscanf(file, "%lf %lf %lf %lf %lf", &pixels[2 * n], &pixels[2 * n + 1], &points[3 * n],
                &points[3 * n + 1], &points[3 * n + 2]) == 5)
    ++n;
  if (file) fclose(file);
  return n;
}

int main(int argc, char **argv) {
  static double pixels[2 * MOST], points[3 * MOST];
  static uint8_t inlier[MOST];
  tv_camera camera = {TV_CAMERA_PINHOLE};
  tv_limits limits;
  tv_context *context;
  tv_pixel_points matches;
  tv_absolute_pose pose;
  tv_status status;
  double centre[3];
  int k, wrong = 0; /* the line of the first wrong match */
  if (argc != 6) return fail("usage: 15_absolute_pose POINTS.txt fx fy cx cy");
  camera.fx = atof(argv[2]);
  camera.fy = atof(argv[3]);
  camera.cx = atof(argv[4]);
  camera.cy = atof(argv[5]);
  /* The verdict needs the image's area: the principal point is taken as the image's middle. */
  camera.width = (int)(2 * camera.cx);
  camera.height = (int)(2 * camera.cy);
  tv_limits_init(&limits);
  limits.purposes = TV_PURPOSE_ABSOLUTE_POSE;
  limits.max_matches = MOST;
  status = tv_context_new(&context, &limits);
  if (status != TV_OK) return fail(tv_status_string(status));
  tv_pixel_points_init(&matches);
  matches.num = read_points(argv[1], pixels, points);
  matches.pixels = pixels;
  matches.points = points;
  tv_absolute_pose_init(&pose);
  status = tv_estimate_absolute_pose(context, &camera, &matches, NULL, &pose, inlier);
  if (status != TV_OK) return fail(tv_status_string(status));
  printf("%s: %d of %d matches agree, to %.2f px\n", tv_verdict_string(pose.verdict),
         pose.num_inliers, pose.num_matches, pose.rms_error_px);
  if (!pose.has_pose) return 3;
  for (k = 0; k < 3; ++k) { /* the camera stands where x = R X + t is 0 */
    centre[k] = -(pose.R[k] * pose.t[0] + pose.R[3 + k] * pose.t[1] + pose.R[6 + k] * pose.t[2]);
    printf("  R % .6f % .6f % .6f   t % .6f\n", pose.R[3 * k], pose.R[3 * k + 1], pose.R[3 * k + 2],
           pose.t[k]);
  }
  printf("the camera stands at (%.4f, %.4f, %.4f)\n", centre[0], centre[1], centre[2]);
  if (pose.has_covariance)
    printf("sigma of the rotation: %.3f deg\n",
           DEGREES * sqrt(pose.covariance[0] + pose.covariance[7] + pose.covariance[14]));
  for (k = matches.num; k > 0; --k)
    if (!inlier[k - 1]) wrong = k;
  if (wrong) printf("the first wrong match is in line %d\n", wrong);
  tv_context_free(context);
  return 0;
}
