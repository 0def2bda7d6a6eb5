/* Bilinear samples of a turned square. */

static inline int32_t clamp_i32(int32_t value, int32_t low, int32_t high) {
  return value < low ? low : value > high ? high : value;
}

/* Bilinear value, in 1/16 grey level, between four pixels; fx, fy in 1/256. */
static inline int16_t bilinear(int32_t a, int32_t b, int32_t c, int32_t d, int32_t fx, int32_t fy) {
  const int32_t upper = 256 * a + fx * (b - a);
  const int32_t lower = 256 * c + fx * (d - c);
  return (int16_t)((256 * upper + fy * (lower - upper) + 2048) >> 12);
}

/* Position clamped to the image; the neighbours of the last column and row are themselves. */
static int16_t sample_clamped(const uint8_t *image, int64_t stride, int32_t width, int32_t height,
                              int32_t x, int32_t y) {
  const int32_t sx = clamp_i32(x, 0, (width - 1) << 16), sy = clamp_i32(y, 0, (height - 1) << 16);
  const int32_t ix = sx >> 16, iy = sy >> 16;
  const uint8_t *top = image + (int64_t)iy * stride + ix;
  const uint8_t *bottom = top + (iy + 1 < height ? stride : 0);
  const int32_t right = ix + 1 < width ? 1 : 0;
  return bilinear(top[0], top[right], bottom[0], bottom[right], (sx >> 8) & 255, (sy >> 8) & 255);
}

static int is_inside(int32_t x, int32_t y, int32_t width, int32_t height) {
  return x >= 0 && y >= 0 && x < (width - 1) << 16 && y < (height - 1) << 16;
}

enum { SAMPLE_CHUNK = 24 }; /* at least a patch's side, and whole vectors */

/* A row of samples in three steps, so that all but the loads can run in vectors. */
static void sample_row(const uint8_t *image, int64_t stride, int32_t x, int32_t y, int32_t du_x,
                       int32_t du_y, int32_t side, int16_t *out) {
  int32_t offset[SAMPLE_CHUNK];
  int16_t fx[SAMPLE_CHUNK], fy[SAMPLE_CHUNK], value[SAMPLE_CHUNK];
  uint8_t a[SAMPLE_CHUNK] = {0}, b[SAMPLE_CHUNK] = {0}, c[SAMPLE_CHUNK] = {0}, d[SAMPLE_CHUNK] = {0};
  const int32_t pitch = (int32_t)stride;
  int32_t i;
  for (i = 0; i < SAMPLE_CHUNK; ++i) {
    const int32_t sx = x + i * du_x, sy = y + i * du_y;
    offset[i] = (sy >> 16) * pitch + (sx >> 16);
    fx[i] = (int16_t)((sx >> 8) & 255);
    fy[i] = (int16_t)((sy >> 8) & 255);
  }
  for (i = 0; i < side; ++i) {
    const uint8_t *top = image + offset[i], *bottom = top + stride;
    a[i] = top[0];
    b[i] = top[1];
    c[i] = bottom[0];
    d[i] = bottom[1];
  }
  for (i = 0; i < SAMPLE_CHUNK; ++i) value[i] = bilinear(a[i], b[i], c[i], d[i], fx[i], fy[i]);
  memcpy(out, value, (size_t)side * sizeof out[0]);
}

static void sample_patch(const uint8_t *image, int64_t stride, int32_t width, int32_t height,
                         int32_t x, int32_t y, int32_t du_x, int32_t du_y, int32_t side,
                         int16_t *patch) {
  const int32_t end = side - 1;
  const int inside = is_inside(x, y, width, height) &&
                     is_inside(x + end * du_x, y + end * du_y, width, height) &&
                     is_inside(x - end * du_y, y + end * du_x, width, height) &&
                     is_inside(x + end * (du_x - du_y), y + end * (du_y + du_x), width, height);
  int32_t i, j;
  for (j = 0; j < side; ++j) {
    const int32_t row_x = x - j * du_y, row_y = y + j * du_x;
    int16_t *row = patch + j * side;
    if (inside) {
      sample_row(image, stride, row_x, row_y, du_x, du_y, side, row);
      continue;
    }
    for (i = 0; i < side; ++i) {
      row[i] = sample_clamped(image, stride, width, height, row_x + i * du_x, row_y + i * du_y);
    }
  }
}
