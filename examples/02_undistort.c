/* Removes a lens's distortion from an image, using the camera model only: figure 1b of the paper
   (docs/paper.md).
   usage: 02_undistort IN.pgm OUT.pgm fx fy cx cy k1 k2 p1 p2 k3 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
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

/* The grey level at a position between pixels, interpolated; 0 outside the image. */
static uint8_t sample(const tv_image *image, double x, double y) {
  const int left = (int)floor(x), top = (int)floor(y);
  const double fx = x - left, fy = y - top;
  const uint8_t *at = image->data + top * image->stride_bytes + left;
  if (left < 0 || top < 0 || left + 1 >= image->width || top + 1 >= image->height) return 0;
  return (uint8_t)((1 - fy) * ((1 - fx) * at[0] + fx * at[1]) +
                   fy * ((1 - fx) * at[image->stride_bytes] + fx * at[image->stride_bytes + 1]) +
                   0.5);
}

int main(int argc, char **argv) {
  tv_camera lens = {0};
  tv_image image;
  double angle;
  int x, y, seen = 0;
  FILE *out;
  if (argc != 12) return fail("usage: 02_undistort IN.pgm OUT.pgm fx fy cx cy k1 k2 p1 p2 k3");
  image = read_pgm(argv[1]);
  if (!image.data) return fail("cannot read the image");
  lens.model = TV_CAMERA_BROWN_CONRADY;
  lens.width = image.width;
  lens.height = image.height;
  lens.fx = atof(argv[3]);
  lens.fy = atof(argv[4]);
  lens.cx = atof(argv[5]);
  lens.cy = atof(argv[6]);
  for (x = 0; x < 5; ++x) lens.k[x] = atof(argv[7 + x]);
  if (tv_camera_valid_angle(&lens, &angle) != TV_OK) return fail("not a camera");
  out = fopen(argv[2], "wb");
  if (!out) return fail("cannot write");
  fprintf(out, "P5\n%d %d\n255\n", image.width, image.height);
  for (y = 0; y < image.height; ++y) {
    for (x = 0; x < image.width; ++x) {
      /* The ray of this pixel in a camera without distortion, and the pixel at which the lens
         shows that ray. */
      const double ray[3] = {(x - lens.cx) / lens.fx, (y - lens.cy) / lens.fy, 1};
      double pixel[2];
      const int found = tv_camera_project(&lens, ray, pixel, NULL) == TV_OK;
      seen += found;
      fputc(found ? sample(&image, pixel[0], pixel[1]) : 0, out);
    }
  }
  if (fclose(out) != 0) return fail("cannot write");
  printf("%d x %d, the lens is good to %.1f deg off its axis, %.1f %% of the pixels are seen\n",
         image.width, image.height, angle * 180 / 3.14159265358979,
         100.0 * seen / (image.width * image.height));
  free((void *)image.data);
  return 0;
}
