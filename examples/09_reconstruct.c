/* Computes a pose and a point cloud from two images in one call. Writes the cloud as PLY, in
   camera 0's frame.
   usage: 09_reconstruct A.pgm B.pgm OUT.ply fx fy cx0 cx1 cy */
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
  tv_view view[2];
  tv_camera camera[2] = {{0}, {0}};
  tv_limits limits;
  tv_context *context;
  tv_two_view pose;
  tv_reconstruction cloud;
  tv_status status;
  FILE *out;
  int v, k;
  if (argc != 9) return fail("usage: 09_reconstruct A.pgm B.pgm OUT.ply fx fy cx0 cx1 cy");
  tv_limits_init(&limits);
  limits.max_width = limits.max_height = 1;
  for (v = 0; v < 2; ++v) {
    tv_view_init(&view[v]);
    view[v].image = read_pgm(argv[1 + v]);
    if (!view[v].image.data) return fail("cannot read an image");
    camera[v].model = TV_CAMERA_PINHOLE;
    camera[v].width = view[v].image.width;
    camera[v].height = view[v].image.height;
    if (camera[v].width > limits.max_width) limits.max_width = camera[v].width;
    if (camera[v].height > limits.max_height) limits.max_height = camera[v].height;
    camera[v].fx = atof(argv[4]);
    camera[v].fy = atof(argv[5]);
    camera[v].cx = atof(argv[6 + v]);
    camera[v].cy = atof(argv[8]);
    view[v].camera = &camera[v];
  }
  status = tv_context_new(&context, &limits);
  if (status != TV_OK) return fail(tv_status_string(status));
  tv_two_view_init(&pose);
  tv_reconstruction_init(&cloud);
  status = tv_reconstruct(context, &view[0], &view[1], NULL, &pose, NULL, &cloud);
  if (status != TV_OK) return fail(tv_status_string(status));
  printf("%s (%s): %d of %d matches agree, %d points\n", tv_kind_string(pose.kind),
         tv_verdict_string(pose.verdict), pose.num_inliers, pose.num_matches, cloud.num_points);
  if (!pose.has_R || !pose.has_t) return 3;
  for (k = 0; k < 3; ++k)
    printf("  R % .6f % .6f % .6f   t % .6f\n", pose.R[3 * k], pose.R[3 * k + 1], pose.R[3 * k + 2],
           pose.t[k]);
  out = fopen(argv[3], "w");
  if (!out) return fail("cannot write");
  fprintf(out,
          "ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\n"
          "property float z\nend_header\n",
          cloud.num_points);
  for (k = 0; k < cloud.num_matches; ++k) {
    const tv_point *p = &cloud.points[k];
    if (p->status == TV_POINT_OK)
      fprintf(out, "%.6g %.6g %.6g\n", p->position[0], p->position[1], p->position[2]);
  }
  if (fclose(out) != 0) return fail("cannot write");
  for (v = 0; v < 2; ++v) free((void *)view[v].image.data);
  tv_context_free(context);
  return 0;
}
